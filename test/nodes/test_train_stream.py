"""Node `train` under streams: what goes wrong on a wire, for long, and while a fit runs."""

from __future__ import annotations

from pathlib import Path
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from diagnostic_msgs.msg import DiagnosticArray
from nodes import toy
from nodes.test_train import (
    joint_publisher,
    joint_state,
    publish_all,
    start_recording,
)
import numpy as np
from sensor_msgs.msg import JointState

from lip_id_ros.dataset import Dataset
from lip_id_ros.nodes import messages
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples, read_sources
from lip_id_ros.settings import RecordingSettings

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros


def counted(status: dict[str, Any]) -> int:
    return int(status['rows'] + sum(status['rejected'].values()))


def nearly_all(status: dict[str, Any], sent: int) -> bool:
    """Whether what was sent has come: a loaded machine loses some, since it is best effort."""
    return bool(status['received'] >= 0.98 * sent)


def publish_at(publisher: Any, rate_hz: float, stream: Any) -> int:
    begun, count = time.monotonic(), 0
    for count, message in enumerate(stream, start=1):
        publisher.publish(message)
        time.sleep(max(0.0, begun + count / rate_hz - time.monotonic()))
    return count


def test_one_wrong_stamp_spoils_nothing_a_new_clock_counts(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    train = graph.start('train', record_on_start=True)
    publisher = joint_publisher(client)
    for row in range(10):
        publisher.publish(joint_state(row))
    publisher.publish(joint_state(10_000_000))
    for row in range(10, 20):
        publisher.publish(joint_state(row))
    status = client.status('train', lambda status: counted(status) == 21)
    assert (status['rows'], status['rejected']) == (20, {'stamp far ahead': 1})
    for row in range(30):  # as after the restart of a simulation
        message = joint_state(row)
        message.header.stamp = messages.stamp_at(1_000_000_000 + row * 10_000_000)
        publisher.publish(message)
    status = client.status('train', lambda status: counted(status) == 51)
    assert (status['rows'], status['rejected']) == (50, {'stamp far ahead': 1})
    assert train.end() == 0
    before, after = read_sources(
        [tmp_path / 'unsaved.mcap', tmp_path / 'unsaved_1.mcap'], RecordingSettings()
    )
    assert (before.n_samples, after.n_samples) == (20, 30)
    assert after.start_s == 1.0


def test_a_full_recorder_warns(ros: Ros) -> None:
    graph, client = ros
    graph.start('train', record_on_start=True, max_rows=5)
    publisher = joint_publisher(client)
    diagnostics = client.listen(DiagnosticArray, '/diagnostics')
    for row in range(8):
        publisher.publish(joint_state(row))
    status = client.status('train', lambda status: counted(status) == 8)
    assert status['full'] is True
    assert status['rejected'] == {'buffer full': 3}
    assert status['summary'].startswith(
        'recording, 5 samples kept, no more fit under max_rows: call save_dataset, then clear'
    )

    def counted_there() -> bool:
        values = {pair.key: pair.value for pair in diagnostics[-1].status[0].values}
        return values.get('rejected.buffer full') == '3'

    client.wait_until(lambda: diagnostics and counted_there(), 'the count in /diagnostics')
    assert diagnostics[-1].status[0].level == b'\x01'


@pytest.mark.slow
def test_no_message_is_lost_while_a_fit_runs(ros: Ros) -> None:
    graph, client = ros
    graph.start(
        'train', record_on_start=True, fit__subset=60, preprocessing__decimate=2, fit__seed=1
    )
    publisher = joint_publisher(client)
    _, q, dq, ddq = toy.motion(1000)
    tau = toy.torque(q, ddq)

    def stream(first: int, last: int) -> Any:
        for row in range(first, last):
            at = row % 1000
            values = {'position': q[at], 'velocity': dq[at], 'effort': tau[at]}
            lists = {name: value.tolist() for name, value in values.items()}
            yield joint_state(row, **lists)

    publish_at(publisher, 1000.0, stream(0, 1000))
    client.status('train', lambda status: nearly_all(status, 1000))
    assert client.trigger('/train/fit').success

    def heard() -> list[dict[str, Any]]:
        received = list(client.received['/train/status'])
        return [messages.status_values(message) for message in received]

    sent = 1000
    while heard()[-1]['job']['state'] != 'done':
        sent += publish_at(publisher, 500.0, stream(sent, sent + 50))
    status = client.status('train', lambda status: nearly_all(status, sent))
    assert (status['rows'], status['rejected']) == (status['received'], {})
    fitting = [each['rows'] for each in heard() if each['job']['state'] == 'running']
    assert max(fitting) > 1000


def test_bags_and_live_samples_make_one_data_set(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    toy.dataset().save(tmp_path / 'earlier.npz')
    graph.start('train', bags=['earlier.npz'], recording__effort_scale=[1.0, -1.0])
    start_recording(client)
    _, q, dq, ddq = toy.motion(400, seed=3)
    effort = np.array([1.0, -1.0]) * toy.torque(q, ddq)

    def state(row: int) -> JointState:
        values = {'position': q[row].tolist(), 'velocity': dq[row].tolist()}
        return joint_state(row, effort=effort[row].tolist(), **values)

    publish_all(client, map(state, range(400)))
    client.status('train', lambda status: status['rows'] == 400)
    answer = client.trigger('/train/save_dataset')
    assert answer.success, answer.message
    status = client.status('train', lambda status: status['job']['state'] == 'done')
    result = status['job']['result']
    assert [source.get('samples') for source in result['sources']] == [400, None]
    data = Dataset.load(tmp_path / 'dataset.npz')
    assert data.n_samples == result['n_samples'] > 600
    live = data.segment == data.segment[0]
    assert np.count_nonzero(~live) == 600
    scale = RecordingSettings(effort_scale=(1.0, -1.0))
    t = 0.01 * np.arange(400, dtype=np.float64)  # without the rounding of a time of today
    samples = JointSamples(t, q, dq, effort, toy.JOINTS)
    expected = preprocess(samples, recording=scale)
    np.testing.assert_allclose(data.tau[live], expected.tau, rtol=0.0, atol=1e-9)
    truth = toy.torque(data.q[live], data.ddq[live])
    assert np.abs(data.tau[live] - truth).max() < 0.1 * np.abs(truth).max()
