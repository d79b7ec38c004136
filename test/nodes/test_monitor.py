"""Node `monitor` in a process of its own: it detects contacts, whatever else it receives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from control_msgs.msg import DynamicJointState
from nodes import toy
from nodes.test_train_stream import publish_at
import numpy as np
from pal_statistics_msgs.msg import Statistics
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Ros

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


def values_of(message: DynamicJointState, name: str) -> list[float]:
    """Return the named value of each joint."""
    return [
        dict(zip(each.interface_names, each.values, strict=True))[name]
        for each in message.interface_values
    ]


def test_a_contact_is_published_after_calibration(ros: Ros, model_path: str) -> None:
    graph, client = ros
    graph.start('monitor', model_path=model_path, smallest_contact=[2.0], calibration_s=2.0)
    torques = client.listen(JointState, '/monitor/external_torque')
    contacts = client.listen(DynamicJointState, '/monitor/contact')
    totals = client.listen(Float64, '/monitor/total_energy')
    powers = client.listen(Float64, '/monitor/power_unexplained')
    stamped = client.listen(Statistics, '/monitor/energy')
    publisher = client.speak(JointState, '/joint_states')
    client.status('monitor', lambda status: status['state'] == 'not calibrated')
    answer = calibrate(client)
    publish_at(publisher, RATE_HZ, states(range(400)))
    client.wait_until(answer.done, 'the end of the calibration')
    assert answer.result().success
    assert answer.result().message.startswith('calibrated: shoulder ')
    client.status('monitor', lambda status: status['state'] == 'watching')
    client.wait_until(lambda: contacts, 'a word on contacts')
    assert not any(messages.any_joint(message, 'contact') for message in contacts)

    publish_at(publisher, RATE_HZ, states(range(400, 430), contact=2.0))
    client.wait_until(lambda: messages.any_joint(contacts[-1], 'contact'), 'contact')
    client.wait_until(lambda: torques[-1].header.stamp.nanosec == 290_000_000, 'the last torque')
    client.wait_until(lambda: stamped[-1].header.stamp.nanosec == 290_000_000, 'its energy')
    assert {each.name for each in stamped[-1].statistics} == {
        'total_energy', 'power_supplied', 'power_unexplained'
    }  # fmt: skip
    assert torques[-1].name == list(toy.JOINTS)
    np.testing.assert_allclose(torques[-1].effort, [0.0, 2.0], atol=0.3)
    client.wait_until(lambda: contacts[-1].header.stamp == torques[-1].header.stamp, 'contacts')
    assert contacts[-1].joint_names == list(toy.JOINTS)
    assert values_of(contacts[-1], 'torque') == list(torques[-1].effort)
    assert all(0.0 < each < 2.0 / 3.5 for each in values_of(contacts[-1], 'deviation'))
    assert all(0.4 <= each < 2.0 for each in values_of(contacts[-1], 'threshold'))
    assert values_of(contacts[-1], 'contact') == [0.0, 1.0]
    assert values_of(contacts[-1], 'blind') == [0.0, 0.0]
    client.wait_until(lambda: len(totals) == len(powers), 'an energy beside each power')
    assert powers[-1].data == pytest.approx(2.0 * DQ[429, 1], abs=0.5)
    assert client.status('monitor', lambda status: status['contacts'] == 1)


def calibrate(client: Client) -> Any:
    """Begin a calibration; return its answer to come."""
    service = client.node.create_client(Trigger, '/monitor/calibrate')
    client.wait_until(service.service_is_ready, 'the service calibrate')
    answer = service.call_async(Trigger.Request())
    client.status('monitor', lambda status: status['state'] == 'calibrating')
    return answer


def test_a_contact_that_is_too_small_is_refused_with_the_smallest_that_shows(
    ros: Ros, model_path: str
) -> None:
    graph, client = ros
    tiny = {'model_path': model_path, 'smallest_contact': [1e-4], 'calibration_s': 2.0}
    monitor = graph.start('monitor', **tiny)
    contacts = client.listen(DynamicJointState, '/monitor/contact')
    publisher = client.speak(JointState, '/joint_states')
    interrupted, answer = calibrate(client), calibrate(client)
    client.wait_until(interrupted.done, 'the end of the first call')
    assert not interrupted.result().success
    publish_at(publisher, RATE_HZ, states(range(400)))
    client.wait_until(answer.done, 'the end of the calibration')
    assert not answer.result().success
    status = client.status('monitor', lambda status: status['failure'])
    shoulder, elbow = least = status['least_contact']
    sentence = f'but shoulder {shoulder:g}, elbow {elbow:g} N m or N would; set smallest_cont'
    path = graph.folder / 'state/ros/lip_id_ros/monitor/monitor.yaml'
    for text in (status['failure'], answer.result().message, monitor.log):
        assert sentence in text
    assert f'parameters that do are in {path}' in answer.result().message
    assert not contacts

    refused = client.set_parameter('monitor', 'smallest_contact', [shoulder, 0.9 * elbow])
    assert not refused.successful
    assert sentence in refused.reason
    assert client.set_parameter('monitor', 'smallest_contact', least).successful
    publish_at(publisher, RATE_HZ, states(range(400, 430), contact=2.0))
    client.wait_until(lambda: contacts, 'a word on contacts, without another calibration')
    assert monitor.end() == 0

    options = ['--params-file', str(path), '-p', f'model_path:={model_path}']
    graph.start_with('monitor', options)
    client.forget('/monitor/status')
    status = client.status('monitor', lambda status: status['state'] == 'watching')
    assert status['least_contact'] is None


def test_a_model_that_is_not_there_is_one_line(ros: Ros) -> None:
    graph, _ = ros
    node = graph.start('monitor', model_path='none.npz')
    assert node.wait() == 1
    assert 'none.npz' in node.log
    assert 'Traceback' not in node.log
