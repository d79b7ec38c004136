"""Node `serve` in a process of its own: its lifecycle, its answers, and what it never sends."""

from __future__ import annotations

from functools import partial
import math
from pathlib import Path
import signal
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from lifecycle_msgs.msg import Transition
from nodes import toy
import numpy as np
from pal_statistics_msgs.msg import Statistics
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Graph, Process, Ros

pytestmark = pytest.mark.ros

REFERENCE = '/serve/desired_trajectory'
TORQUE = '/serve/feedforward_torque'
SWAPPED = toy.JOINTS[::-1]


def point(q: list[float], dq: list[float], ddq: list[float]) -> JointTrajectoryPoint:
    return JointTrajectoryPoint(positions=q, velocities=dq, accelerations=ddq)


def trajectory(names: tuple[str, ...], *points: JointTrajectoryPoint) -> JointTrajectory:
    message = JointTrajectory(joint_names=list(names), points=list(points))
    message.header.stamp = messages.stamp_at(2_000_000_000_123_456_789)  # of no test's time
    return message


GOOD = trajectory(toy.JOINTS, point([0.3, -0.2], [0.5, 1.0], [1.0, -1.0]))
EXPECTED = toy.torque(np.array([0.3, -0.2]), np.array([1.0, -1.0]))


def start_serve(graph: Graph, **parameters: Any) -> Process:
    """Start the node so that every answer is the model's own, and none comes unasked."""
    usual = {
        'ramp_s': 0.0,
        'stale_timeout_s': 0.0,
        'torque_limits': [toy.LIMIT],
        'refine_plans': False,
    }
    return graph.start('serve', **{**usual, **parameters})


def exchange(ros: Ros) -> tuple[Client, list[Any], Any]:
    """Return the client of an active `serve`, its torques, and a publisher of references."""
    _, client = ros
    torques = client.listen(JointState, TORQUE)
    publisher = client.speak(JointTrajectory, REFERENCE)
    client.status('serve', lambda status: status['state'] == 'active')
    return client, torques, publisher


def test_a_sample_is_answered_with_torque_and_energies(serving: Ros) -> None:
    _, client = serving
    torques = client.listen(JointState, TORQUE)
    kinetic = client.listen(Float64, '/serve/kinetic_energy')
    potential = client.listen(Float64, '/serve/potential_energy')
    stamped = client.listen(Statistics, '/serve/energies')
    publisher = client.speak(JointTrajectory, REFERENCE)
    publisher.publish(GOOD)
    client.wait_until(lambda: torques and kinetic and potential and stamped, 'answer')
    assert stamped[0].header.stamp == GOOD.header.stamp
    values = {each.name: each.value for each in stamped[0].statistics}
    assert values == {'kinetic_energy': kinetic[0].data, 'potential_energy': potential[0].data}
    assert torques[0].header.stamp == GOOD.header.stamp
    assert torques[0].name == list(toy.JOINTS)
    np.testing.assert_allclose(torques[0].effort, EXPECTED, atol=0.1)
    assert kinetic[0].data == pytest.approx(toy.kinetic(np.array([0.5, 1.0])), abs=0.05)
    assert math.isfinite(potential[0].data)

    # the same motion, joints in another order and one more: the same answer
    publisher.publish(
        trajectory(('tool', *SWAPPED), point([9, -0.2, 0.3], [9, 1, 0.5], [9, -1, 1]))
    )
    client.wait_until(lambda: len(torques) == 2, 'second answer')
    assert torques[1].effort == torques[0].effort


def test_a_plan_comes_back_with_efforts(serving: Ros) -> None:
    _, client = serving
    client.set_parameter('serve', 'torque_limits', [4.0, 100.0])
    plans = client.listen(JointTrajectory, '/serve/trajectory_with_effort')
    publisher = client.speak(JointTrajectory, REFERENCE)
    _, q, dq, ddq = toy.motion(200, seed=5)
    rows = zip(q[:, ::-1].tolist(), dq[:, ::-1].tolist(), ddq[:, ::-1].tolist(), strict=True)
    plan = trajectory(SWAPPED, *(point(*row) for row in rows))
    for number, each in enumerate(plan.points):
        each.time_from_start.sec = number
    publisher.publish(plan)
    client.wait_until(lambda: plans, 'plan')
    efforts = np.array([each.effort for each in plans[0].points])[:, ::-1]
    expected = np.clip(toy.torque(q, ddq), [-4.0, -100.0], [4.0, 100.0])
    np.testing.assert_allclose(efforts, expected, atol=0.3)
    assert np.abs(efforts[:, 0]).max() == 4.0
    for each in plans[0].points:
        each.effort = []
    assert plans[0] == plan


def test_bad_references_are_counted_and_the_node_lives(serving: Ros) -> None:
    graph, client = serving
    serve = graph.processes[0]
    torques = client.listen(JointState, TORQUE)
    publisher = client.speak(JointTrajectory, REFERENCE)
    two = [0.0, 0.0]
    bad = [
        trajectory(('shoulder',), point([0.0], [0.0], [0.0])),
        trajectory(('elbow', 'elbow'), point(two, two, two)),
        trajectory(toy.JOINTS, point(two, two, [])),
        trajectory(toy.JOINTS, point([0.0], two, two)),
        trajectory(toy.JOINTS, point(two, [math.nan, 0.0], two)),
        trajectory(toy.JOINTS, point(two, two, two), point(two, two, [math.inf, 0.0])),
        trajectory((*toy.JOINTS, 'tool'), *[point([0.0] * 3, [0.0] * 3, [0.0] * 3)] * 2),
    ]
    for message in bad:
        publisher.publish(message)
    publisher.publish(GOOD)
    client.wait_until(lambda: torques, 'answer')
    status = client.status('serve', lambda status: status['answered']['samples'] == 1)
    assert status['refused'] == {
        'joint missing': 1,
        'joint name repeated': 1,
        'wrong length': 2,
        'value not finite': 2,
        'foreign joint in a plan': 1,
    }
    assert len(torques) == 1
    assert 'refused a message (joint missing): the message must name every joint' in serve.log


def test_lifecycle_without_autostart(ros: Ros, model_path: str, foreign_model_path: str) -> None:
    graph, client = ros
    serve = start_serve(graph, autostart=False, joints=list(SWAPPED))
    torques = client.listen(JointState, TORQUE)
    publisher = client.speak(JointTrajectory, REFERENCE)
    assert client.state() == 'unconfigured'
    assert not client.transition(Transition.TRANSITION_CONFIGURE)
    assert client.state() == 'unconfigured'
    assert 'not configured: model.npz: No such file or directory; correct the path.' in serve.log
    assert client.set_parameter('serve', 'model_path', foreign_model_path).successful
    assert not client.transition(Transition.TRANSITION_CONFIGURE)
    assert 'must be a model of the joints elbow, shoulder, but has left, right;' in serve.log
    assert client.set_parameter('serve', 'model_path', model_path).successful
    assert client.transition(Transition.TRANSITION_CONFIGURE)
    assert client.state() == 'inactive'
    publisher.publish(GOOD)
    client.status('serve', lambda status: status['refused'] == {'inactive': 1})
    assert client.set_parameter('serve', 'torque_limits', []).successful
    assert not client.transition(Transition.TRANSITION_ACTIVATE)
    refused = client.status('serve', lambda status: status['summary'].startswith('not activated'))
    assert 'torque_limits must hold the largest of each joint' in refused['summary']
    assert client.set_parameter('serve', 'torque_limits_from', 'none').successful
    assert client.transition(Transition.TRANSITION_ACTIVATE)
    client.status('serve', lambda status: 'torques are not limited' in status['summary'])
    assert 'torques are not limited, and neither are their steps' in serve.log
    assert client.set_parameter('serve', 'torque_limits', [toy.LIMIT]).successful
    assert client.set_parameter('serve', 'torque_limits_from', 'parameters').successful
    no_limits: list[Any] = [[], None]  # None deletes it
    for value in no_limits:
        assert not client.set_parameter('serve', 'torque_limits', value).successful
    assert not client.set_parameter('serve', 'torque_limits_from', 'none').successful
    publisher.publish(GOOD)
    client.wait_until(lambda: torques, 'answer')
    assert client.transition(Transition.TRANSITION_DEACTIVATE)
    client.wait_until(lambda: len(torques) == 2, 'zero torque')
    assert list(torques[1].effort) == [0.0, 0.0]
    assert client.transition(Transition.TRANSITION_CLEANUP)
    assert client.state() == 'unconfigured'
    assert client.transition(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN)
    assert client.state() == 'finalized'
    assert serve.end() == 0, serve.log


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_the_last_word_is_zero_torque(ros: Ros, model_path: str, number: int) -> None:
    graph, client = ros
    joints = ['elbow', 'shoulder']  # the order of commands, which have no names
    serve = start_serve(graph, model_path=model_path, publish_commands=True, joints=joints)
    commands = client.listen(Float64MultiArray, '/serve/commands')
    publisher = client.speak(JointTrajectory, REFERENCE)
    client.status('serve', lambda status: status['state'] == 'active')
    publisher.publish(GOOD)
    client.wait_until(lambda: commands, 'command')
    np.testing.assert_allclose(commands[0].data, EXPECTED[::-1], atol=0.1)
    assert serve.end(number) == 0, serve.log
    client.wait_until(lambda: len(commands) == 2, 'zero torque')
    assert list(commands[1].data) == [0.0, 0.0]


WAITS = 'waits until every subscriber has the last torque'
LISTENER = """
import sys
import rclpy
from std_msgs.msg import Float64MultiArray
from lip_id_ros.nodes import qos
rclpy.init()
node = rclpy.create_node('slow')
show = lambda message: print('heard', list(message.data), flush=True)
node.create_subscription(Float64MultiArray, '/serve/commands', show, qos.OUTPUT)
rclpy.spin(node)
"""


def test_the_last_word_reaches_a_controller_that_is_late(ros: Ros, model_path: str) -> None:
    """A process that does not run for a while, as on a loaded machine, hears the zero too."""
    graph, client = ros
    serve = start_serve(graph, model_path=model_path, publish_commands=True)
    publisher = client.speak(JointTrajectory, REFERENCE)
    client.status('serve', lambda status: status['state'] == 'active')
    listener = graph.start_program('slow', ['-c', LISTENER])

    def is_heard() -> bool:
        publisher.publish(GOOD)  # until the node has discovered the other process
        return 'heard' in listener.log

    client.wait_until(is_heard, 'command')
    listener.hold()
    serve.send(signal.SIGINT)
    client.wait_until(lambda: WAITS in serve.log or not serve.alive, 'end of the node')
    assert WAITS in serve.log
    assert serve.alive  # what the other process hears depends on it
    listener.send(signal.SIGCONT)
    client.wait_until(lambda: 'heard [0.0, 0.0]' in listener.log, 'zero torque')
    assert serve.wait() == 0, serve.log


def test_disabled_means_silent_after_one_zero(serving: Ros) -> None:
    client, torques, publisher = exchange(serving)
    assert client.switch('/serve/enable', False).success
    publisher.publish(GOOD)
    status = client.status('serve', lambda status: status['refused'])
    assert status['refused'] == {'disabled': 1}
    client.wait_until(lambda: torques, 'zero torque')
    assert [list(each.effort) for each in torques] == [[0.0, 0.0]]
    assert client.switch('/serve/enable', True).success
    publisher.publish(GOOD)
    client.wait_until(lambda: len(torques) == 2, 'answer')


def test_limits_change_while_it_runs_and_wrong_ones_are_refused(
    serving: Ros,
) -> None:
    client, torques, publisher = exchange(serving)
    result = client.set_parameter('serve', 'torque_limits', [1.0, 2.0, 3.0])
    assert result.reason.startswith('torque_limits must hold one value per joint (2)')
    result = client.set_parameter('serve', 'joints', ['left', 'right'])
    assert result.reason.startswith('joints is read when the node is configured, which it is;')
    assert not client.set_parameter('serve', 'output_scale', 1.5).successful
    assert client.set_parameter('serve', 'torque_limits', [0.5, 0.25]).successful
    publisher.publish(GOOD)
    client.wait_until(lambda: torques, 'answer')
    assert list(torques[0].effort) == [0.5, -0.25]
    client.status('serve', lambda status: status['limited'] == 1)


def test_reload_swaps_the_model_or_keeps_the_old_one(
    serving: Ros, model_path: str, foreign_model_path: str, tmp_path: Path
) -> None:
    client, torques, publisher = exchange(serving)
    publisher.publish(GOOD)
    client.set_parameter('serve', 'model_path', foreign_model_path)
    answer = client.trigger('/serve/reload_model')
    assert not answer.success
    assert 'must be a model of the joints shoulder, elbow, but has left, right;' in answer.message
    (tmp_path / 'broken.npz').write_bytes(b'not a model')
    client.set_parameter('serve', 'model_path', str(tmp_path / 'broken.npz'))
    answer = client.trigger('/serve/reload_model')
    assert not answer.success
    assert 'broken.npz' in answer.message
    client.set_parameter('serve', 'model_path', model_path)
    answer = client.trigger('/serve/reload_model')
    assert answer.success
    assert answer.message == f'serves {model_path}'
    publisher.publish(GOOD)
    client.wait_until(lambda: len(torques) == 2, 'answer')
    assert torques[0].effort == torques[1].effort


def answered(torques: list[Any], before: int) -> bool:
    return len(torques) > before


def test_payloads_are_switched_without_a_reload(ros: Ros, model_path: str, tmp_path: Path) -> None:
    graph, client = ros
    toy.heavier(InverseDynamicsModel.load(model_path)).save(tmp_path / 'heavy.npz')
    heavy = str(tmp_path / 'heavy.npz')
    start_serve(graph, model_path=model_path, payload_models=[heavy])
    torques = client.listen(JointState, TORQUE)
    publisher = client.speak(JointTrajectory, REFERENCE)
    (tmp_path / 'heavy.npz').unlink()
    for payload in ('', heavy, ''):
        before = len(torques)
        assert client.set_parameter('serve', 'payload', payload).successful
        publisher.publish(GOOD)
        client.wait_until(partial(answered, torques, before), 'answer')
    bare, loaded, again = (np.array(each.effort) for each in torques)
    np.testing.assert_allclose(bare, EXPECTED, atol=0.1)
    assert again.tolist() == bare.tolist()
    assert np.abs(loaded - bare).max() > 1.0
    answer = client.set_parameter('serve', 'payload', 'other.npz')
    assert not answer.successful
    assert 'payload must be one of the payload_models that are loaded' in answer.reason
