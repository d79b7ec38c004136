"""Node `serve` with more than one source, or consumer, of the same kind."""

from __future__ import annotations

from copy import deepcopy
import time
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from nodes import toy
from nodes.test_serve import exchange, GOOD, REFERENCE, start_serve, TORQUE, trajectory
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros


@pytest.mark.parametrize('rule', ['warn', 'refuse'])
def test_references_of_a_controller_and_of_a_topic_contradict_each_other(
    ros: Ros, model_path: str, rule: str
) -> None:
    """Torques alternated by 6.7 N m, with level 0."""
    control_msgs = pytest.importorskip('control_msgs.msg')
    graph, client = ros
    start_serve(
        graph,
        model_path=model_path,
        follow_controller=True,
        stale_timeout_s=5.0,
        several_publishers=rule,
    )
    _, torques, publisher = exchange(ros)
    State = control_msgs.JointTrajectoryControllerState
    controller = client.speak(State, '/serve/controller_state')
    state = State(joint_names=GOOD.joint_names, reference=deepcopy(GOOD.points[0]))
    state.speed_scaling_factor = 1.0
    state.reference.positions = [-0.3, 0.2]
    controller.publish(state)
    client.wait_until(lambda: torques, 'answer to the controller')
    publisher.publish(GOOD)
    told = client.status('serve', lambda status: 'and may contradict' in status['summary'])
    for topic in (REFERENCE, '/serve/controller_state'):
        assert topic in told['summary']
    if rule == 'refuse':
        client.wait_until(lambda: list(torques[-1].effort) == [0.0, 0.0], 'zero torque')
        publisher.publish(GOOD)
        client.status('serve', lambda status: status['refused'] == {'several publishers': 1})


@pytest.mark.parametrize('rule', ['warn', 'refuse'])
def test_two_nodes_that_command_one_arm_are_told(ros: Ros, model_path: str, rule: str) -> None:
    graph, client = ros
    start_serve(graph, model_path=model_path, several_publishers=rule)
    client.status('serve', lambda status: status['summary'] == 'answering')
    other = client.node.create_publisher(JointState, TORQUE, 10)
    told = client.status('serve', lambda status: f'publishers of {TORQUE}' in status['summary'])
    assert 'client' in told['summary']
    if rule == 'refuse':
        publisher = client.speak(JointTrajectory, REFERENCE)
        publisher.publish(GOOD)
        client.status('serve', lambda status: status['refused'] == {'several publishers': 1})
    client.withdraw(other)
    client.status('serve', lambda status: status['summary'] == 'answering')


def test_plans_are_not_answered_to_oneself(ros: Ros, model_path: str) -> None:
    """One topic for both had 518 plans a second."""
    graph, client = ros
    serve = graph.start_with(
        'serve',
        [
            *('-p', f'model_path:={model_path}', '-p', f'torque_limits:=[{toy.LIMIT}]'),
            *('-p', 'autostart:=true'),
            *('-r', '~/trajectory_with_effort:=/plans', '-r', '~/desired_trajectory:=/plans'),
        ],
    )
    status = client.status('serve', lambda status: 'not configured' in status['summary'])
    assert status['state'] == 'unconfigured'
    assert '/plans must not be both an input and an output of this node' in serve.log


def test_a_trajectory_without_points_ends_the_motion(ros: Ros, model_path: str) -> None:
    graph, client = ros
    start_serve(graph, model_path=model_path, safe_ramp_s=0.0)
    _, torques, publisher = exchange(ros)
    plans = client.listen(JointTrajectory, '/serve/trajectory_with_effort')
    publisher.publish(GOOD)
    client.wait_until(lambda: torques, 'answer')
    publisher.publish(trajectory(toy.JOINTS))
    client.wait_until(lambda: list(torques[-1].effort) == [0.0, 0.0], 'zero torque')
    client.wait_until(lambda: plans, 'the end for the controller')
    assert plans[0].points == []
    assert client.switch('/serve/enable', False).success
    publisher.publish(trajectory(toy.JOINTS))  # what was sent before may still be executed
    client.wait_until(lambda: len(plans) == 2, 'the end from a disabled node')


def test_a_clock_that_is_set_back_is_believed_in_half_a_second(ros: Ros, model_path: str) -> None:
    """A step of 1 s stopped a stream of 100 Hz for 36 s."""
    graph, client = ros
    start_serve(graph, model_path=model_path, stale_timeout_s=0.5)
    _, torques, publisher = exchange(ros)

    def stream(seconds: float, back_s: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = deepcopy(GOOD)
            message.header.stamp = messages.stamp_at(time.time_ns() - round(1e9 * back_s))
            publisher.publish(message)
            time.sleep(0.01)

    stream(0.5, 0.0)
    client.wait_until(lambda: torques, 'answers')
    stream(0.3, 0.3)  # by less than the timeout: only the order of stamps shows it
    stream(0.7, 0.3)
    newest = time.time_ns() - 600_000_000

    def is_answered() -> bool:
        return messages.nanoseconds(torques[-1].header.stamp) > newest

    client.wait_until(is_answered, 'answers after the step')
