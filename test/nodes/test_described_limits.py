"""Torque limits of the demo's Panda, from the URDF that is published or given as a parameter."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('pinocchio', reason='needs the URDF of the demo (the extra sim)')

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nodes.test_serve import point, REFERENCE, start_serve, TORQUE, trajectory
import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.nodes import qos
from lip_id_ros.simulation.arm import panda_urdf

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Ros

pytestmark = pytest.mark.ros

JOINTS = ('panda_joint5', 'panda_joint2')
LIMITS = [12.0, 87.0]
STRONG = trajectory(JOINTS, point([0.0, 0.0], [0.0, 0.0], [1e3, -1e3]))
FROM, TOPIC = 'robot_description', '/robot_description'


def described(**efforts: str) -> String:
    """Return the Panda's URDF, with other efforts for those that it has."""
    text = panda_urdf().read_text()
    for number, effort in efforts.items():
        text = text.replace(f'effort="{number[1:]}.0"', f'effort="{effort}"')
    return String(data=text)


@pytest.fixture
def panda_path(model_path: str, tmp_path: Path) -> str:
    path = tmp_path / 'panda.npz'
    replace(InverseDynamicsModel.load(model_path), joint_names=JOINTS).save(path)
    return str(path)


def answer(client: Client, torques: list[Any]) -> list[float]:
    before = len(torques)
    client.speak(JointTrajectory, REFERENCE).publish(STRONG)
    client.wait_until(lambda: len(torques) > before, 'a torque')
    return list(np.abs(torques[-1].effort))


def test_serve_takes_the_limits_of_the_topic_when_it_is_activated(
    ros: Ros, panda_path: str
) -> None:
    graph, client = ros
    limits = {'torque_limits_from': FROM, 'rate_limits': [1e9]}
    serve = start_serve(graph, model_path=panda_path, **limits)
    torques = client.listen(JointState, TORQUE)
    missing = (
        'not activated: a URDF was expected on /robot_description (torque_limits_from), but none '
        'has come; start robot_state_publisher, or give torque_limits.'
    )
    status = client.status('serve', lambda status: status['summary'] == missing)
    assert status['state'] == 'inactive'
    assert not client.transition(Transition.TRANSITION_ACTIVATE)
    descriptions = client.speak(String, TOPIC, qos.LATCHED)
    for message, sentence in (
        (String(data='/dev/zero'), "but '/dev/zero' came; correct its publisher."),
        (String(data='<robot'), '/robot_description is not a URDF'),
        (described(_12='0'), "joint 'panda_joint5' in /robot_description was expected to be"),
    ):
        descriptions.publish(message)

        def judged() -> bool:
            assert not client.transition(Transition.TRANSITION_ACTIVATE)
            return sentence in client.status('serve', lambda status: True)['summary']  # noqa: B023

        client.wait_until(judged, sentence)
    descriptions.publish(described())
    client.wait_until(lambda: client.transition(Transition.TRANSITION_ACTIVATE), 'activation')
    client.status('serve', lambda status: status['summary'] == 'answering')
    assert 'torque_limits of /robot_description: panda_joint5 12, panda_joint2 87' in serve.log
    assert answer(client, torques) == LIMITS

    descriptions.publish(described(_12='7', _87='8'))  # moves no limit of an active node
    (result,) = client.set_parameters('serve', torque_limits_from='robot_description')
    assert result.successful
    assert answer(client, torques) == LIMITS
    assert client.trigger('/serve/reload_model').success
    client.set_parameter('serve', 'torque_limits', [3.0])
    assert answer(client, torques) == LIMITS  # they come from the URDF
    client.set_parameter('serve', 'torque_limits_from', 'parameters')
    assert answer(client, torques) == [3.0, 3.0]
    assert client.transition(Transition.TRANSITION_DEACTIVATE)
    client.set_parameter('serve', 'torque_limits_from', 'robot_description')
    assert client.transition(Transition.TRANSITION_ACTIVATE)
    assert answer(client, torques) == [7.0, 8.0]
    assert 'another URDF came on /robot_description: limits of torques stay' in serve.log

    assert client.transition(Transition.TRANSITION_DEACTIVATE)
    assert client.transition(Transition.TRANSITION_CLEANUP)
    (result,) = client.set_parameters('serve', joints=['a', 'b', 'c'])  # of another arm
    assert result.successful, result.reason


def test_activation_waits_for_a_urdf_that_comes_with_it(ros: Ros, panda_path: str) -> None:
    """A launch starts robot_state_publisher and `serve` at once; the latter may be faster."""
    graph, client = ros
    start_serve(graph, model_path=panda_path, autostart=False, torque_limits_from=FROM)
    assert client.transition(Transition.TRANSITION_CONFIGURE)
    change = client.node.create_client(ChangeState, '/serve/change_state')
    activate = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_ACTIVATE))
    asked = change.call_async(activate)
    client.node.create_publisher(String, TOPIC, qos.LATCHED).publish(described())
    client.wait_until(asked.done, 'activation')
    assert asked.result().success


def test_a_long_plan_has_the_limits_of_the_urdf_that_is_in_force(
    ros: Ros, panda_path: str
) -> None:
    """It is answered in a process of its own, which gets the settings of the activation too."""
    graph, client = ros
    limits = {'torque_limits_from': FROM, 'rate_limits': [1e9]}
    start_serve(graph, model_path=panda_path, autostart=False, **limits)
    assert client.transition(Transition.TRANSITION_CONFIGURE)
    plans = client.listen(JointTrajectory, '/serve/trajectory_with_effort')
    descriptions = client.speak(String, TOPIC, qos.LATCHED)
    references = client.speak(JointTrajectory, REFERENCE)
    long = trajectory(JOINTS, *[deepcopy(STRONG.points[0]) for _ in range(1000)])
    for number, each in enumerate(long.points):
        each.time_from_start.sec = number

    def planned() -> list[float]:
        before = len(plans)
        references.publish(long)
        client.wait_until(lambda: len(plans) > before, 'a plan')
        return list(np.abs(plans[-1].points[-1].effort))

    descriptions.publish(described())
    assert client.transition(Transition.TRANSITION_ACTIVATE)
    assert planned() == LIMITS
    assert client.transition(Transition.TRANSITION_DEACTIVATE)
    descriptions.publish(described(_12='7', _87='8'))
    assert client.transition(Transition.TRANSITION_ACTIVATE)
    assert planned() == [7.0, 8.0]


def test_an_active_node_reads_no_limits(ros: Ros, panda_path: str) -> None:
    graph, client = ros
    start_serve(graph, model_path=panda_path, torque_limits=[5.0], rate_limits=[1e9])
    torques = client.listen(JointState, TORQUE)
    client.status('serve', lambda status: status['state'] == 'active')
    result = client.set_parameter('serve', 'torque_limits_from', 'robot_description')
    assert result.reason == (
        'torque_limits_from must not be robot_description here, which is read only when torques '
        'begin; deactivate the node first.'
    )
    assert answer(client, torques) == [5.0, 5.0]


def test_the_parameter_is_a_description_too(ros: Ros, panda_path: str) -> None:
    graph, client = ros
    given = {'torque_limits_from': FROM, 'robot_description': described().data}
    start_serve(graph, model_path=panda_path, rate_limits=[1e9], **given)
    torques = client.listen(JointState, TORQUE)
    client.status('serve', lambda status: status['state'] == 'active')
    assert answer(client, torques) == LIMITS
