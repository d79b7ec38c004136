"""Requests and messages that ended a node, or kept it from its stream: it lives on and answers."""

from __future__ import annotations

import contextlib
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nodes import toy
from nodes.test_serve import (
    exchange,
    EXPECTED,
    GOOD,
    point,
    REFERENCE,
    start_serve,
    TORQUE,
    trajectory,
)
import numpy as np
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from benchmarks._hostile import counts, hostile_states, hostile_trajectory
from lip_id_ros.nodes import qos
from lip_id_ros.nodes.messages import count_points
from lip_id_ros.signals.joints import RefusedError

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Ros

pytestmark = pytest.mark.ros

PLAN = '/serve/trajectory_with_effort'
NOT_WHILE_ACTIVE = (0, 1, 2, 3, 5, 6, 8, 99, 255)


def plan(n_points: int) -> JointTrajectory:
    points = [point([0.3, -0.2], [0.5, 1.0], [1.0, -1.0]) for _ in range(n_points)]
    for number, each in enumerate(points):
        each.time_from_start.sec = number
    return trajectory(toy.JOINTS, *points)


def change(label: str) -> ChangeState.Request:
    request = ChangeState.Request()
    request.transition.label = label
    return request


def set_absurd_parameter(client: Client, node: str) -> None:
    absurd = Parameter(name='executor', value=ParameterValue(type=99))
    client.call(
        SetParameters, f'/{node}/set_parameters', SetParameters.Request(parameters=[absurd])
    )


def test_wrong_requests_are_answered_and_serve_lives(ros: Ros, model_path: str) -> None:
    graph, client = ros
    serve = start_serve(graph, model_path=model_path)
    _, torques, publisher = exchange(ros)
    for number in NOT_WHILE_ACTIVE:
        assert not client.transition(number), number
    assert not client.call(ChangeState, '/serve/change_state', change('no such')).success
    assert client.state() == 'active'
    publisher.publish(GOOD)
    client.wait_until(lambda: torques, 'answer')
    np.testing.assert_allclose(torques[0].effort, EXPECTED, atol=0.1)

    set_absurd_parameter(client, 'serve')
    client.status('serve', lambda status: status['faults'] == 1)
    client.wait_until(lambda: len(torques) == 2, 'safe torque')
    assert list(torques[1].effort) == [0.0, 0.0]
    publisher.publish(GOOD)
    client.wait_until(lambda: len(torques) == 3, 'answer')
    np.testing.assert_allclose(torques[2].effort, EXPECTED, atol=0.1)

    # three reloads at once: all are true
    reload = client.node.create_client(Trigger, '/serve/reload_model')
    client.wait_until(reload.service_is_ready, 'service')
    calls = [reload.call_async(Trigger.Request()) for _ in range(3)]
    client.wait_until(lambda: all(call.done() for call in calls), 'three reloads')
    assert [call.result().message for call in calls] == [f'serves {model_path}'] * 3
    assert all(call.result().success for call in calls)
    client.status('serve', lambda status: status['summary'] == 'answering')

    assert client.call(ChangeState, '/serve/change_state', change('deactivate')).success
    assert client.transition(Transition.TRANSITION_INACTIVE_SHUTDOWN)
    assert not client.transition(Transition.TRANSITION_INACTIVE_SHUTDOWN)
    assert client.state() == 'finalized'
    assert serve.alive
    assert 'refused transition no such: in state active there are only deactivate,' in serve.log


@pytest.mark.parametrize('node', ['train', 'monitor', 'adapt', 'simulated_panda'])
def test_an_absurd_parameter_ends_no_node(ros: Ros, model_path: str, node: str) -> None:
    graph, client = ros
    parameters = {'model_path': model_path} if node in ('monitor', 'adapt') else {}
    process = graph.start(node, **parameters)
    client.status(node, lambda status: status['faults'] == 0)
    set_absurd_parameter(client, node)
    client.status(node, lambda status: status['faults'] == 1)
    assert process.alive


@pytest.mark.parametrize('node', ['train', 'monitor'])
def test_random_bytes_end_no_node(ros: Ros, model_path: str, node: str) -> None:
    graph, client = ros
    settings = {'model_path': model_path} if node == 'monitor' else {'record_on_start': True}
    process = graph.start(node, **settings)
    publisher = client.speak(JointState, '/joint_states')
    rng = np.random.default_rng(6)
    for _ in range(500):
        publisher.publish(rng.bytes(40))
    good = JointState(name=list(toy.JOINTS), position=[0.0, 0.0], velocity=[0.0, 0.0])
    good.header.stamp.sec, good.effort = 1_700_000_000, [0.0, 0.0]

    def received(status: dict[str, Any]) -> bool:
        publisher.publish(good)
        return bool(status['received'])

    client.status(node, received)
    assert process.alive


def publisher_of_another_type(client: Client) -> Any:
    """Create one; the middleware refuses it while events of the one before are being handled."""
    made: list[Any] = []

    def is_made() -> bool:
        with contextlib.suppress(rclpy_implementation.RCLError):
            made.append(client.node.create_publisher(JointState, REFERENCE, qos.REFERENCE))
        return bool(made)

    client.wait_until(is_made, 'a publisher of another type')
    return made[0]


def test_a_publisher_whose_quality_of_service_does_not_fit_is_warned_of(
    serving: Ros,
) -> None:
    _, client = serving
    status = client.status('serve', lambda status: status['state'] == 'active')
    assert status['summary'] == 'answering'
    publisher = client.node.create_publisher(JointTrajectory, REFERENCE, qos.SENSOR_STREAM)
    diagnostics = client.listen(DiagnosticArray, '/diagnostics', qos.DIAGNOSTICS)
    sentence = (
        f'answering; client publishes {REFERENCE} with a quality of service that does not fit: '
    )
    client.status('serve', lambda status: status['summary'].startswith(sentence))
    client.wait_until(
        lambda: diagnostics and diagnostics[-1].status[0].level == DiagnosticStatus.WARN, 'WARN'
    )
    client.withdraw(publisher)
    client.status('serve', lambda status: status['summary'] == 'answering')
    publisher = publisher_of_another_type(client)
    sentence = 'as sensor_msgs/msg/JointState, which must be trajectory_msgs/msg/JointTrajectory'
    client.status('serve', lambda status: sentence in status['summary'])
    client.withdraw(publisher)
    client.status('serve', lambda status: status['summary'] == 'answering')


def test_a_long_plan_is_filled_and_a_longer_one_refused(ros: Ros, model_path: str) -> None:
    graph, client = ros
    start_serve(graph, model_path=model_path, torque_limits=[3.0, 100.0], rate_limits=[1e6])
    _, torques, publisher = exchange(ros)
    answers = client.listen(JointTrajectory, PLAN)
    for asked in (plan(12_000), plan(3000), GOOD):
        publisher.publish(asked)
    client.wait_until(lambda: torques and answers, 'answers')
    efforts = np.array([each.effort for each in answers[0].points])
    np.testing.assert_allclose(efforts, np.tile(torques[0].effort, (3000, 1)), atol=1e-4)
    status = client.status('serve', lambda status: status['answered']['samples'] == 1)
    assert status['refused'] == {'plan too long': 1}
    assert status['limited'] == 3000 + 1


def test_points_are_counted_without_being_read() -> None:
    for names in ((), ('a',), ('joint', 'xy', '', 'elbow_π')):
        for n_points in (0, 1, 7):
            message = trajectory(names, *[point([0.0], [], [1.0, 2.0])] * n_points)
            message.header.frame_id = 'base'
            raw = serialize_message(message)
            assert count_points(raw) == n_points
            for cut in range(4, len(raw) - 8 * n_points * 3, 5):
                if cut < 20:
                    with pytest.raises(RefusedError, match='could not be deserialised'):
                        count_points(raw[:cut])


def test_every_message_to_any_node_is_used_or_refused(ros: Ros, model_path: str) -> None:
    graph, client = ros
    limits = {'joints': list(toy.JOINTS), 'torque_limits': [5.0, 3.0]}
    start_serve(graph, model_path=model_path, **limits)
    graph.start('train', record_on_start=True, max_rows=150)
    graph.start('monitor', model_path=model_path)
    torques = client.listen(JointState, TORQUE)
    references = client.speak(JointTrajectory, REFERENCE)
    states = client.speak(JointState, '/joint_states', listeners=3)
    client.status('serve', lambda status: status['state'] == 'active')
    rng = np.random.default_rng(5)
    for _, state in zip(range(600), hostile_states(rng, toy.JOINTS), strict=False):
        states.publish(state)
        references.publish(hostile_trajectory(rng, toy.JOINTS))
        time.sleep(0.003)  # joint states are best effort: a loaded machine loses some
    client.status('serve', lambda status: status['received']['references'] == 600)
    for node in ('serve', 'train', 'monitor'):

        def complete(status: dict[str, Any], node: str = node) -> bool:
            received, accounted = counts(node, status)
            return received == accounted > 300

        status = client.status(node, complete)
        assert status['faults'] == 0, status['last_fault']
    assert torques
    assert all((np.abs(each.effort) <= limits['torque_limits']).all() for each in list(torques))
