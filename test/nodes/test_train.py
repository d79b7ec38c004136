"""Node `train` in a process of its own: what it keeps, what it drops, what it saves."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import itertools
from pathlib import Path
import signal
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from nodes import toy
import numpy as np
from rclpy.duration import Duration
from sensor_msgs.msg import JointState

from lip_id_ros.dataset import Dataset
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.nodes import messages, qos
from lip_id_ros.recording import read_bag, read_sources
from lip_id_ros.settings import RecordingSettings

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Ros

pytestmark = pytest.mark.ros

START_NS = 1_700_000_000_000_000_000
BATCH = 100  # messages that the middleware holds on any machine
SLACK_S = 2.0  # of a loaded machine


def joint_state(row: int, **changes: Any) -> JointState:
    fields = {'name': list(toy.JOINTS), 'position': [0.1, 0.2], 'velocity': [0.0, 0.0]}
    message = JointState(**{**fields, 'effort': [1.0, 2.0], **changes})
    message.header.stamp = messages.stamp_at(START_NS + row * 10_000_000)
    return message


def joint_publisher(client: Client) -> Any:
    """Return a publisher of joint states that `train` has discovered."""
    return client.speak(JointState, '/joint_states', qos.OUTPUT)


def publish_all(client: Client, states: Iterable[JointState]) -> None:
    """Publish joint states as fast as `train` counts them: on their way they are best effort."""
    publisher = joint_publisher(client)
    before = client.status('train', lambda status: True)['received']
    for count, state in enumerate(states, start=1):
        publisher.publish(state)
        if count % BATCH == 0:
            expected = before + count
            client.status('train', lambda status: status['received'] >= expected)  # noqa: B023


def publish_motion(client: Client, n_samples: int) -> None:
    _, q, dq, ddq = toy.motion(n_samples)
    tau = toy.torque(q, ddq) + 1e-3 * np.random.default_rng(1).standard_normal(q.shape)

    def state(row: int) -> JointState:
        # elbow first: what counts is the name
        values = {'position': q[row, ::-1], 'velocity': dq[row, ::-1], 'effort': tau[row, ::-1]}
        changes = {name: value.tolist() for name, value in values.items()}
        return joint_state(row, name=list(toy.JOINTS[::-1]), **changes)

    publish_all(client, map(state, range(n_samples)))


def start_recording(client: Client) -> None:
    assert client.switch('/train/record', True).success


def test_records_fits_and_saves(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    train = graph.start(
        'train',
        recording__joints=list(toy.JOINTS),
        fit__subset=30,
        fit__max_samples=60,
        fit__iterations=15,
        preprocessing__decimate=5,
    )
    answer = client.trigger('/train/fit')
    assert not answer.success
    assert answer.message == (
        'no samples of /joint_states are kept; call record and move the arm, or name recordings '
        'with bags.'
    )
    start_recording(client)
    publish_motion(client, 600)
    client.status('train', lambda status: status['rows'] == 600)

    answer = client.trigger('/train/fit')
    assert answer.success
    assert answer.message == 'job 1: fit of 600 samples; ~/status has its end under results.1'
    answer = client.trigger('/train/fit')
    assert not answer.success
    assert answer.message == 'a fit is running; wait until ~/status shows its end.'
    status = client.status('train', lambda status: '1' in status['results'])
    done = {'task': 'fit', 'state': 'done', 'path': 'model.npz', 'error': ''}
    assert status['results']['1'] == done, train.log
    assert status['job']['result']['path'] == 'model.npz'
    model = InverseDynamicsModel.load(tmp_path / 'model.npz')
    assert model.joint_names == toy.JOINTS
    _, q, dq, ddq = toy.motion(300, seed=5)
    error = model.predict(q, dq, ddq).tau - toy.torque(q, ddq)
    assert (error.var(axis=0) < 0.05 * toy.torque(q, ddq).var(axis=0)).all()

    answer = client.trigger('/train/save_dataset')
    assert answer.success, answer.message
    data = Dataset.load(tmp_path / 'dataset.npz')
    assert answer.message == f'{data.n_samples} samples in dataset.npz'
    assert data.joint_names == toy.JOINTS
    status = client.status('train', lambda status: '2' in status['results'])
    assert status['results']['1'] == done  # though another job has ended since
    assert train.end() == 0, train.log
    assert not (tmp_path / 'unsaved.mcap').exists()


def test_a_data_set_of_a_part_does_not_count_as_saved(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    train = graph.start('train', record_on_start=True, preprocessing__max_samples=20)
    publish_motion(client, 300)
    client.status('train', lambda status: status['rows'] == 300)
    answer = client.trigger('/train/save_dataset')
    assert answer.success
    assert answer.message == '20 samples in dataset.npz; the recording has more than these'
    status = client.status('train', lambda status: status['job']['state'] == 'done')
    assert status['rows_saved'] == 0
    assert train.end() == 0, train.log
    assert read_bag(tmp_path / 'unsaved.mcap').n_samples == 300


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_what_was_recorded_outlives_the_node(ros: Ros, tmp_path: Path, number: int) -> None:
    graph, client = ros
    train = graph.start('train', record_on_start=True, unsaved_path='kept.mcap')
    publish_motion(client, 50)
    client.status('train', lambda status: status['rows'] == 50)
    assert train.end(number) == 0, train.log
    assert 'kept 50 unsaved samples in kept.mcap' in train.log
    (samples,) = read_sources(
        [tmp_path / 'kept.mcap'], RecordingSettings(joints=('shoulder', 'elbow'))
    )
    np.testing.assert_array_equal(samples.position, toy.motion(50)[1])


BUSY = """
from pathlib import Path
import time
from lip_id_ros.nodes import qos, running, train

qos.SENSOR_STREAM = qos.OUTPUT  # so that the publisher knows what has arrived
make, stopped = running._stop_event, []
running._stop_event = lambda: stopped.append(make()) or stopped[0]

class Busy(train.TrainNode):
    def _on_joint_state(self, message):
        super()._on_joint_state(message)
        Path('busy').touch()
        stopped[0].wait()
        time.sleep(0.02)

raise SystemExit(running.run(Busy))
"""


@pytest.mark.parametrize('executor', ['events', 'single_threaded'])
def test_messages_that_wait_at_the_end_are_kept(ros: Ros, tmp_path: Path, executor: str) -> None:
    graph, client = ros
    options = ['-p', 'record_on_start:=true', '-p', f'executor:={executor}']
    train = graph.start_program('train', ['-c', BUSY, '--ros-args', *options])
    client.status('train', lambda status: status['recording'])
    publisher = joint_publisher(client)
    publisher.publish(joint_state(0))
    client.wait_until((tmp_path / 'busy').exists, 'the first message')
    for row in range(1, 20):
        publisher.publish(joint_state(row))
    assert publisher.wait_for_all_acked(Duration(seconds=60))
    assert train.end() == 0, train.log
    assert 'kept 20 unsaved samples in unsaved.mcap' in train.log


def test_what_was_recorded_outlives_fits_that_fail(ros: Ros, tmp_path: Path) -> None:
    graph, client = ros
    train = graph.start('train', record_on_start=True, model_path='absent/model.npz')
    answer = client.trigger('/train/fit')
    assert not answer.success
    assert answer.message.startswith('model_path: absent/model.npz cannot be written ')
    assert client.set_parameter('train', 'model_path', 'model.npz').successful
    publish_motion(client, 300)
    client.status('train', lambda status: status['rows'] == 300)
    assert client.set_parameter('train', 'preprocessing.min_segment_s', 60).successful
    assert client.trigger('/train/fit').success
    status = client.status('train', lambda status: status['job']['state'] == 'failed')
    assert status['job']['error'].startswith('recording must hold a motion of 60 s without a gap')
    assert status['rows'] == 300
    assert client.set_parameter('train', 'preprocessing.min_segment_s', 1).successful
    assert client.trigger('/train/fit').success
    client.status('train', lambda status: status['job']['state'] == 'running')
    assert client.trigger('/train/cancel').message == 'cancelled the fit'
    client.status('train', lambda status: status['job']['state'] == 'cancelled')
    assert client.trigger('/train/fit').success
    client.status('train', lambda status: status['job']['state'] == 'running')
    assert train.end(signal.SIGTERM) == 0, train.log
    assert read_bag(tmp_path / 'unsaved.mcap').n_samples == 300


def test_joints_do_not_change_under_what_is_recorded(ros: Ros) -> None:
    graph, client = ros
    graph.start('train', record_on_start=True)
    publish_motion(client, 3)
    client.status('train', lambda status: status['rows'] == 3)
    result = client.set_parameter('train', 'recording.joints', ['elbow'])
    assert result.reason == ('recording.joints cannot change while samples are kept; call clear.')
    assert client.trigger('/train/clear').message == 'forgot 3 samples'
    assert client.set_parameter('train', 'recording.joints', ['elbow']).successful
    publish_motion(client, 3)
    client.status('train', lambda s: s['rows'] == 3 and s['joint_names'] == ['elbow'])


def test_parameters_that_contradict_each_other_are_refused(ros: Ros) -> None:
    graph, client = ros
    failed = graph.start('train', bags=['absent.mcap'])
    assert failed.wait() == 1
    assert 'bags must be recordings or data sets, but absent.mcap does not exist;' in failed.log
    graph.start('train', recording__joints=['a', 'b'])
    for name, value, sentence in (
        ('recording.effort_scale', [1.0], 'must have one value for each of the 2'),
        ('recording.joints', ['a', 'a'], "must name each joint once, but 'a' comes twice."),
        ('bags', ['absent.mcap'], 'absent.mcap does not exist; correct the path'),
        ('record_on_start', True, 'Trying to set a read-only parameter: record_on_start.'),
    ):
        result = client.set_parameter('train', name, value)
        assert not result.successful
        assert sentence in result.reason
    assert client.set_parameter('train', 'recording.effort_scale', [1.0, -2.0]).successful


def split(row: int) -> list[JointState]:
    """Return the halves of an arm that two publishers share."""
    half = {'position': [0.1], 'velocity': [0.0], 'effort': [1.0]}
    return [joint_state(row, name=[name], **half) for name in toy.JOINTS]


@pytest.mark.parametrize(
    ('states', 'reason'),
    [
        (split, 'joint missing; have one publisher send all joints'),
        (
            lambda row: [joint_state(row, name=[])],
            'no joint names; have the driver name its joint',
        ),
        (lambda row: [zero_stamped()], 'stamp zero; have the driver stamp its joint states'),
        (None, '/joint_states is silent; start the driver, or remap the topic'),
    ],
    ids=['split', 'unnamed', 'unstamped', 'silent'],
)
def test_a_recording_without_a_usable_sample_is_told_within_a_second(
    ros: Ros, states: Callable[[int], list[JointState]] | None, reason: str
) -> None:
    graph, client = ros
    train = graph.start('train', recording__joints=list(toy.JOINTS))
    publisher = joint_publisher(client)
    status = client.status('train', lambda status: True)
    assert 'nothing is recorded' not in status['summary']  # nobody has asked for it
    begun = time.monotonic()
    start_recording(client)
    rows = itertools.count()

    def told() -> bool:
        for message in states(next(rows)) if states else ():
            publisher.publish(message)
        time.sleep(0.01)
        status = client.received['/train/status'][-1]
        return reason in status.message and status.level == b'\x01'

    client.wait_until(told, reason)
    assert time.monotonic() - begun < 1.0 + SLACK_S
    client.wait_until(lambda: reason in train.log, 'a line of the log')
    publish_all(client, map(joint_state, range(1000, 1010)))
    client.status('train', lambda status: status['rows'] >= 10)


def zero_stamped() -> JointState:
    message = joint_state(0)
    message.header.stamp = messages.stamp_at(0)
    return message


def test_a_recording_that_nobody_publishes_for_is_told(ros: Ros) -> None:
    graph, client = ros
    train = graph.start('train', record_on_start=True)
    sentence = 'nothing is recorded: /joint_states is silent; start the driver, or remap the topic'
    client.status('train', lambda status: sentence in status['summary'])
    client.wait_until(lambda: sentence in train.log, 'a line of the log')
