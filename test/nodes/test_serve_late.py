"""Node `serve` behind its references: what is old is not answered as if it were fresh."""

from __future__ import annotations

from copy import deepcopy
import signal
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from nodes.test_serve import exchange, GOOD, REFERENCE, start_serve, TORQUE
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.nodes import messages, qos

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

pytestmark = pytest.mark.ros


LATER_NS = 2_000_000_000 * 10**9
"""In the future, so that no stamp is old."""


def reference(number: int) -> JointTrajectory:
    """Return a reference whose answer is known by its stamp."""
    return stamped(LATER_NS + number)


def stamped(nanoseconds: int) -> JointTrajectory:
    message = JointTrajectory(joint_names=GOOD.joint_names, points=GOOD.points)
    message.header.stamp = messages.stamp_at(nanoseconds)
    return message


def stamps(torques: list[JointState]) -> set[int]:
    return {messages.nanoseconds(each.header.stamp) - LATER_NS for each in torques}


@pytest.mark.parametrize('executor', ['events', 'single_threaded'])
def test_references_that_waited_while_the_node_stood_still_are_not_answered(
    ros: Ros, model_path: str, executor: str
) -> None:
    graph, client = ros
    serve = start_serve(graph, model_path=model_path, stale_timeout_s=0.5, executor=executor)
    _, torques, publisher = exchange(ros)
    publisher.publish(reference(1))
    client.wait_until(lambda: 1 in stamps(torques), 'answer')
    serve.hold()
    for number in range(2, 52):
        publisher.publish(reference(number))
    time.sleep(0.6)  # longer than a reference may wait
    serve.send(signal.SIGCONT)

    def told(status: dict[str, Any]) -> bool:
        return bool(sum(status['refused'].values()) == 50)

    refused = client.status('serve', told)['refused']
    assert set(refused) <= {'overtaken by a newer one', 'reference too old'}
    assert refused['reference too old'] >= 1
    assert not stamps(torques) & set(range(2, 52))
    publisher.publish(reference(60))
    client.wait_until(lambda: 60 in stamps(torques), 'answer to a fresh reference')


def test_of_references_that_lag_the_newest_is_answered_and_every_plan(
    serving: Ros,
) -> None:
    """Without a timeout: nothing is too old, but the queue is emptied."""
    graph, client = serving
    serve = graph.processes[0]
    torques = client.listen(JointState, TORQUE)
    plans = client.listen(JointTrajectory, '/serve/trajectory_with_effort')
    publisher = client.speak(JointTrajectory, REFERENCE)
    publisher.publish(reference(1))
    client.wait_until(lambda: 1 in stamps(torques), 'answer')
    serve.hold()
    try:
        for number in range(2, 12):
            publisher.publish(reference(number))
        end = deepcopy(GOOD.points[0])
        end.time_from_start.sec = 1
        publisher.publish(
            JointTrajectory(joint_names=GOOD.joint_names, points=[GOOD.points[0], end])
        )
        for number in range(12, 22):
            publisher.publish(reference(number))
        time.sleep(0.2)
    finally:
        serve.send(signal.SIGCONT)
    client.wait_until(lambda: 21 in stamps(torques) and plans, 'answers')
    status = client.status('serve', lambda status: status['received']['references'] == 22)
    assert status['answered']['plans'] == 1
    overtaken = status['refused'].get('overtaken by a newer one', 0)
    assert overtaken >= 10
    assert status['answered']['samples'] + overtaken == 21


@pytest.mark.parametrize('age_s', [2, 10.5, 3600])
def test_a_stamp_says_how_old_a_reference_is(ros: Ros, model_path: str, age_s: float) -> None:
    """Those of 10.5 s to an hour were taken for stamps of another clock, and answered in full."""
    graph, client = ros
    start_serve(graph, model_path=model_path, stale_timeout_s=0.5)
    _, torques, publisher = exchange(ros)
    publisher.publish(stamped(time.time_ns() - round(1e9 * age_s)))
    client.status('serve', lambda status: status['refused'] == {'reference too old': 1})
    assert not torques


def test_stamps_that_go_back_are_not_answered(ros: Ros, model_path: str) -> None:
    graph, client = ros
    start_serve(graph, model_path=model_path, stale_timeout_s=0.5)
    _, torques, publisher = exchange(ros)
    for _ in range(20):
        now = time.time_ns()
        publisher.publish(stamped(now))
        publisher.publish(stamped(now - 400_000_000))
    status = client.status('serve', lambda status: status['received']['references'] == 40)
    assert status['refused']['stamp went back'] > 0
    client.wait_until(lambda: len(torques) == status['answered']['samples'], 'answers')
    answered = [messages.nanoseconds(each.header.stamp) for each in torques]
    assert answered == sorted(answered)


def test_plans_that_waited_while_the_node_stood_still_are_not_executed(
    ros: Ros, model_path: str
) -> None:
    """Three came out up to 16.7 s after they were sent."""
    graph, client = ros
    serve = start_serve(graph, model_path=model_path, stale_timeout_s=0.5)
    plans = client.listen(JointTrajectory, '/serve/trajectory_with_effort')
    publisher = client.speak(JointTrajectory, REFERENCE)
    client.status('serve', lambda status: status['state'] == 'active')
    asked = JointTrajectory(joint_names=GOOD.joint_names)
    asked.points = [deepcopy(GOOD.points[0]) for _ in range(2)]
    asked.points[1].time_from_start.sec = 1
    serve.hold()
    try:
        for _ in range(3):
            publisher.publish(asked)
        time.sleep(0.8)
    finally:
        serve.send(signal.SIGCONT)
    client.status('serve', lambda status: status['refused'] == {'reference too old': 3})
    asked.header.stamp = messages.stamp_at(time.time_ns() - 2 * 10**9)
    publisher.publish(asked)
    refused = {'reference too old': 3, 'plan that is over': 1}
    client.status('serve', lambda status: status['refused'] == refused)
    asked.header.stamp = messages.stamp_at(0)
    publisher.publish(asked)
    client.wait_until(lambda: plans, 'a plan')
    assert len(plans) == 1


def test_a_million_names_are_refused_unread(serving: Ros) -> None:
    client, torques, publisher = exchange(serving)
    message = JointTrajectory(joint_names=[f'joint{n}' for n in range(1_000_000)])
    message.points = GOOD.points
    publisher.publish(message)
    publisher.publish(GOOD)
    client.wait_until(lambda: torques, 'answer')
    client.status('serve', lambda status: status['refused'] == {'too many joint names': 1})


def test_references_of_several_publishers_are_told_or_refused(ros: Ros, model_path: str) -> None:
    graph, client = ros
    start_serve(graph, model_path=model_path)
    torques = client.listen(JointState, TORQUE)
    first = client.speak(JointTrajectory, REFERENCE)
    client.status('serve', lambda status: status['state'] == 'active')
    second = client.node.create_publisher(JointTrajectory, REFERENCE, qos.REFERENCE)
    told = client.status('serve', lambda status: '2 publishers of' in status['summary'])
    assert REFERENCE in told['summary']
    first.publish(reference(1))
    client.wait_until(lambda: 1 in stamps(torques), 'answer')
    client.set_parameter('serve', 'several_publishers', 'refuse')
    client.wait_until(lambda: list(torques[-1].effort) == [0.0, 0.0], 'zero torque')
    first.publish(reference(2))
    client.status('serve', lambda status: status['refused'] == {'several publishers': 1})
    client.withdraw(second)
    client.status('serve', lambda status: 'publishers of' not in status['summary'])
    first.publish(reference(3))
    client.wait_until(lambda: 3 in stamps(torques), 'answer')
    assert 2 not in stamps(torques)
