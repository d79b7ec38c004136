"""Node `monitor` in a process of its own: it detects contacts, whatever else it receives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from nodes import toy
from nodes.test_train_stream import publish_at
import numpy as np
from pal_statistics_msgs.msg import Statistics
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64

from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros

T, Q, DQ, DDQ = toy.motion(1500, seed=3)
TAU = toy.torque(Q, DDQ)
START_NS = 1_800_000_000_000_000_000
RATE_HZ = 100.0


def states(rows: range, contact: float = 0.0) -> Iterator[JointState]:
    """Yield samples of the motion; a contact at the elbow does a part of the work."""
    for row in rows:
        tau = TAU[row] - [0.0, contact]
        message = messages.torque_message(
            messages.stamp_at(START_NS + round(1e9 * T[row])), toy.JOINTS, tau
        )
        message.position = messages.doubles(Q[row])
        message.velocity = messages.doubles(DQ[row])
        yield message


def test_a_contact_is_published_after_calibration(ros: Ros, model_path: str) -> None:
    graph, client = ros
    graph.start('monitor', model_path=model_path, smallest_contact=[2.0], calibration_s=2.0)
    torques = client.listen(JointState, '/monitor/external_torque')
    deviations = client.listen(JointState, '/monitor/external_torque_std')
    blind = client.listen(Bool, '/monitor/blind')
    contacts = client.listen(Bool, '/monitor/contact')
    totals = client.listen(Float64, '/monitor/total_energy')
    powers = client.listen(Float64, '/monitor/power_unexplained')
    stamped = client.listen(Statistics, '/monitor/energy')
    publisher = client.speak(JointState, '/joint_states')
    client.status('monitor', lambda status: status['state'] == 'not calibrated')
    answer = client.trigger('/monitor/calibrate')
    assert answer.success
    publish_at(publisher, RATE_HZ, states(range(400)))
    client.status('monitor', lambda status: status['state'] == 'watching')
    client.wait_until(lambda: contacts, 'a word on contacts')
    assert not any(message.data for message in contacts)

    publish_at(publisher, RATE_HZ, states(range(400, 430), contact=2.0))
    client.wait_until(lambda: contacts[-1].data, 'contact')
    client.wait_until(lambda: torques[-1].header.stamp.nanosec == 290_000_000, 'the last torque')
    client.wait_until(lambda: stamped[-1].header.stamp.nanosec == 290_000_000, 'its energy')
    assert {each.name for each in stamped[-1].statistics} == {
        'total_energy', 'power_supplied', 'power_unexplained'
    }  # fmt: skip
    assert torques[-1].name == list(toy.JOINTS)
    np.testing.assert_allclose(torques[-1].effort, [0.0, 2.0], atol=0.3)
    client.wait_until(lambda: deviations[-1].header.stamp == torques[-1].header.stamp, 'its std')
    assert all(0.0 < each < 2.0 / 3.5 for each in deviations[-1].effort)
    assert not blind[-1].data
    client.wait_until(lambda: len(totals) == len(powers), 'an energy beside each power')
    assert powers[-1].data == pytest.approx(2.0 * DQ[429, 1], abs=0.5)
    assert client.status('monitor', lambda status: status['contacts'] == 1)


def test_a_model_that_is_not_there_is_one_line(ros: Ros) -> None:
    graph, _ = ros
    node = graph.start('monitor', model_path='none.npz')
    assert node.wait() == 1
    assert 'none.npz' in node.log
    assert 'Traceback' not in node.log
