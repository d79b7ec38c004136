"""The node `computed_torque` and the simulated arm on a real graph: when the torque lets go."""

from __future__ import annotations

import signal
import threading
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from builtin_interfaces.msg import Duration
from nodes import toy
import numpy as np
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from collections.abc import Iterator

    from nodes.ros_graph import Client, Ros

pytestmark = pytest.mark.ros

SETTINGS = {
    'joints': list(toy.JOINTS),
    'stiffness': [100.0, 50.0],
    'damping': [10.0, 5.0],
    'torque_limits': [30.0, 20.0],
    'ramp_s': 0.0,
    'stale_timeout_s': 2.0,  # of a busy machine
}
EFFORT = [20.0, -4.0]
PERIOD_S = 0.01


def still(seconds: int = 1000, effort: list[float] = EFFORT, n_points: int = 2) -> JointTrajectory:
    plan = JointTrajectory(joint_names=list(toy.JOINTS))
    for number in range(n_points):
        sec, part = divmod(seconds * number, n_points - 1)
        plan.points.append(
            JointTrajectoryPoint(
                positions=[0.0, 0.0],
                velocities=[0.0, 0.0],
                accelerations=[0.0, 0.0],
                effort=effort,
                time_from_start=Duration(sec=sec, nanosec=1_000_000_000 * part // (n_points - 1)),
            )
        )
    return plan


class Driver:
    """A driver of an arm that stands at zero, publishing from a thread of its own."""

    def __init__(self, client: Client) -> None:
        self._publisher = client.speak(JointState, '/joint_states')
        self.position = [0.0, 0.0]
        self.ahead_s = 0
        self.paused = self._ended = False
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def end(self) -> None:
        self._ended = True
        self._thread.join()

    def _run(self) -> None:
        while not self._ended:
            if not self.paused:
                stamp = messages.stamp_at(time.time_ns() + self.ahead_s * messages.NANOSECONDS)
                self.ahead_s = 0  # once
                message = messages.joint_state_message(
                    stamp, toy.JOINTS, np.array(self.position), np.zeros(2), np.zeros(2)
                )
                self._publisher.publish(message)
            time.sleep(PERIOD_S)


@pytest.fixture
def following(ros: Ros) -> Iterator[tuple[Any, Client, Driver, list[Any]]]:
    """Give the node, a client, a driver and the torques, once a plan's effort is held."""
    graph, client = ros
    process = graph.start('computed_torque', **SETTINGS)
    torques = client.listen(JointState, '/computed_torque/command')
    plans = client.speak(JointTrajectory, '/computed_torque/joint_trajectory')
    driver = Driver(client)
    try:
        plans.publish(still())
        client.wait_until(lambda: torques and held(torques) == EFFORT, 'the effort of the plan')
        yield process, client, driver, torques
    finally:
        driver.end()


def held(torques: list[Any]) -> list[float]:
    return [round(float(each), 6) for each in torques[-1].effort]


def assert_went_to_zero(torques: list[Any]) -> None:
    values = np.abs([each.effort for each in list(torques)])
    assert values[-1].tolist() == [0.0, 0.0]
    assert (values <= EFFORT[0] + 1.0).all()


def test_joint_states_that_stop_take_the_torque_to_zero(
    following: tuple[Any, Client, Driver, list[Any]],
) -> None:
    process, client, driver, torques = following
    driver.paused = True
    client.wait_until(lambda: held(torques) == [0.0, 0.0], 'zero torque')
    assert_went_to_zero(torques)
    status = client.status('computed_torque', lambda status: status['let_go'])
    assert status['summary'] == 'let go: no joint state has come for 2 s'
    assert 'let go: no joint state has come for 2 s' in process.log
    driver.paused = False  # after four seconds of the plan nothing moves
    client.status('computed_torque', lambda later: later['idle'] > status['idle'] + 10)
    assert held(torques) == [0.0, 0.0]


def test_a_stamp_far_ahead_and_a_second_track_of_positions(
    following: tuple[Any, Client, Driver, list[Any]],
) -> None:
    _, client, driver, torques = following
    n_before = len(torques)
    driver.ahead_s = 9
    client.wait_until(lambda: len(torques) > n_before + 50, 'torques')
    efforts = np.array([each.effort for each in torques[n_before : n_before + 50]])
    np.testing.assert_allclose(efforts, np.tile(EFFORT, (50, 1)))
    status = client.status('computed_torque', lambda status: status['refused'])
    assert status['refused'] == {'stamp far ahead': 1}
    driver.position = [1.0, 0.0]
    client.wait_until(lambda: held(torques) == [0.0, 0.0], 'zero torque')
    assert_went_to_zero(torques)
    status = client.status('computed_torque', lambda status: status['let_go'])
    assert status['let_go'] == {'arm left the plan': 1}


def test_plans_that_may_not_be_followed_and_long_ones_leave_the_torque_as_it_is(
    following: tuple[Any, Client, Driver, list[Any]],
) -> None:
    """One of 50,000 points stopped the torques for a second, its velocities asked for 1e9 N m."""
    _, client, _, torques = following
    plans = client.speak(JointTrajectory, '/computed_torque/joint_trajectory')
    moving, contradicting = still(1), still(1)
    moving.points[-1].velocities = [0.05, 0.0]
    for point in contradicting.points:
        point.velocities = [1e6, 0.0]
    for plan in (still(n_points=50_000), moving, contradicting, still(n_points=10_000)):
        plans.publish(plan)
    status = client.status('computed_torque', lambda status: status['plans'] == 2)
    assert status['refused'] == {
        'plan too long': 1,
        'positions contradict velocities': 1,
        'plan ends in motion': 1,
    }
    n_before = len(torques)
    client.wait_until(lambda: len(torques) > n_before + 10, 'torques')
    assert held(torques) == EFFORT


def test_two_publishers_of_joint_states_are_told_or_refused(ros: Ros) -> None:
    graph, client = ros
    graph.start('computed_torque', **SETTINGS, several_publishers='refuse')
    torques = client.listen(JointState, '/computed_torque/command')
    plans = client.speak(JointTrajectory, '/computed_torque/joint_trajectory')
    driver = Driver(client)
    try:
        plans.publish(still())
        client.wait_until(lambda: torques and held(torques) == EFFORT, 'the effort of the plan')
        second = client.node.create_publisher(JointState, '/joint_states', 10)
        client.wait_until(lambda: held(torques) == [0.0, 0.0], 'zero torque')
        sentence = '2 publishers of /joint_states may contradict each other: client, client'
        status = client.status('computed_torque', lambda each: sentence in each['summary'])
        assert status['summary'] == f'let go: joint states have several publishers; {sentence}'
        assert status['let_go'] == {'several publishers': 1}
        client.withdraw(second)
        client.status('computed_torque', lambda each: sentence not in each['summary'])
        plans.publish(still())
        client.wait_until(lambda: held(torques) == EFFORT, 'the effort of the plan')
    finally:
        driver.end()


def test_a_node_that_ends_takes_the_torque_to_zero(
    following: tuple[Any, Client, Driver, list[Any]],
) -> None:
    process, client, _, torques = following
    assert process.end(signal.SIGTERM) == 0
    client.wait_until(lambda: held(torques) == [0.0, 0.0], 'zero torque')
    assert_went_to_zero(torques)


def test_a_callback_that_fails_takes_the_torque_to_zero(
    following: tuple[Any, Client, Driver, list[Any]],
) -> None:
    from nodes.test_hostile import set_absurd_parameter

    _, client, _, torques = following
    set_absurd_parameter(client, 'computed_torque')
    client.wait_until(lambda: held(torques) == [0.0, 0.0], 'zero torque')
    assert_went_to_zero(torques)
    status = client.status('computed_torque', lambda status: status['faults'] == 1)
    assert status['let_go'] == {'callback failed': 1}


def test_without_limits_it_does_not_start(ros: Ros) -> None:
    graph, client = ros
    unlimited = {**SETTINGS, 'torque_limits': []}
    process = graph.start('computed_torque', **unlimited)
    assert process.wait() == 1
    assert 'torque_limits must hold the largest torque of each joint' in process.log
    graph.start('computed_torque', **{**SETTINGS, 'torque_limits': 'none'})
    status = client.status('computed_torque', lambda status: True)
    assert status['summary'] == 'all messages are answered; torques are not limited'


def test_the_simulated_arm_stays_finite_and_stops_under_an_absurd_torque(
    ros: Ros,
) -> None:
    pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')
    graph, client = ros
    graph.start('simulated_arm', n_joints=2)
    states = client.listen(JointState, '/joint_states')
    commands = client.speak(JointState, '/command')
    client.wait_until(lambda: states, 'a joint state')
    for torque in ([1e300, -1e300], [1e300, 1e308], [1e4, 1e5], *[[9e3, -9e3]] * 20):
        asked = states[-1]
        command = messages.torque_message(asked.header.stamp, asked.name, np.array(torque))
        commands.publish(command)
        client.wait_until(
            lambda: states[-1].header.stamp != asked.header.stamp,  # noqa: B023
            'the next joint state',
        )
    values = np.array([[each.position, each.velocity, each.effort] for each in list(states)])
    assert np.isfinite(values).all()
    assert np.abs(values[:, 1]).max() < 101.0
    status = client.status('simulated_arm', lambda status: status['steps'] == 23)
    assert status['stops'] > 0
