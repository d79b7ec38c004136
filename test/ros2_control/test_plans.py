"""Plans that `serve` has filled, in the hands of a real joint_trajectory_controller."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('controller_manager_msgs')

from control_msgs.msg import JointTrajectoryControllerState
from nodes import toy
from nodes.test_serve import REFERENCE
import numpy as np
from ros2_control.arm import (
    commanded,
    efforts,
    hear_until_now,
    plan,
    published_effort,
    RATE_HZ,
    times,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from benchmarks._mock_controller import JTC, trajectory_controller, write_parameters
from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.interpolation import Plan
from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from ros2_control.arm import Control

pytestmark = [pytest.mark.ros, pytest.mark.ros2_control]

LAST = 0.5  # s, of the usual plan


def filled_by_serve(control: Control, asked: JointTrajectory) -> JointTrajectory:
    """Have `serve` fill a plan, which it publishes to the controller `arm`."""
    filled = control.client.listen(JointTrajectory, '/arm/joint_trajectory')
    control.client.speak(JointTrajectory, REFERENCE).publish(asked)
    end = list(asked.points[-1].positions)

    def answers() -> list[JointTrajectory]:
        # what a test before sent to the controller may come late
        return [each for each in list(filled) if list(each.points[-1].positions) == end]

    control.client.wait_until(answers, 'plan')
    return answers()[0]


def states_of(control: Control, name: str) -> list[Any]:
    """Collect states of an active controller from now on, without late ones of a test before."""
    states = control.client.listen(JointTrajectoryControllerState, f'/{name}/controller_state')
    hear_until_now(control, states)
    states.clear()
    return states


def in_plan(state: Any) -> float:
    """Return how long the plan of a state has gone on [s]."""
    return float(times([state.reference])[0])


def begin(state: Any) -> float:
    return float(state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec - in_plan(state))


def wait_for(control: Control, states: list[Any], condition: Callable[[Any], Any]) -> Any:
    found: list[Any] = []

    def is_there() -> bool:
        found.extend(each for each in list(states) if condition(each))
        return bool(found)

    control.client.wait_until(is_there, 'state of the controller')
    return found[0]


def ends_at(end: Array) -> Callable[[Any], bool]:
    return lambda state: np.allclose(state.reference.positions, end) and in_plan(state) > LAST


def test_efforts_of_a_plan_are_interpolated_and_added_to_the_feedback(control: Control) -> None:
    control.use('arm')
    states = states_of(control, 'arm')
    joint_states = control.client.listen(JointState, '/joint_states')
    filled = filled_by_serve(control, plan())
    tau, t = efforts(filled), times(filled.points)
    last = wait_for(control, states, ends_at(np.array([0.4, -0.3])))
    during = [
        state
        for state in states
        if t[0] <= in_plan(state) <= t[-1] and abs(begin(state) - begin(last)) < 1e-3
    ]
    assert during
    for state in during:
        ahead = in_plan(state) + 1.0 / RATE_HZ  # a command is for the end of its period
        expected = [np.interp(ahead, t, column) for column in tau.T]
        np.testing.assert_allclose(commanded(state), expected, atol=1e-6)
    # the efforts of the last point are held: with gravity in them they carry the arm
    np.testing.assert_allclose(commanded(last), tau[-1], atol=1e-9)
    np.testing.assert_allclose(tau[-1], toy.WEIGHT * np.sin([0.4, -0.3]), atol=0.1)

    def reached_hardware() -> bool:
        newest = published_effort(joint_states[-1])
        return bool(np.allclose(newest, last.output.effort, atol=1e-9))

    control.client.wait_until(reached_hardware, 'effort in the joint states')


@pytest.mark.parametrize('n_given', [1, 2, 3])
def test_the_motion_between_points_is_that_of_a_plan_check(control: Control, n_given: int) -> None:
    """Points with positions alone, with velocities, with accelerations."""
    control.use('arm')
    states = states_of(control, 'arm')
    t = np.array([0.2, 0.5, 0.9])
    given = np.random.default_rng(n_given).uniform(-0.5, 0.5, (3, 3, 2))
    given[1:, -1] = 0.0  # else the controller refuses the plan
    asked = messages.plan_message(toy.JOINTS, t, *given)
    for point in asked.points:
        for field in ('velocities', 'accelerations')[n_given - 1 :]:
            setattr(point, field, [])
    given[n_given:] = np.nan
    control.client.speak(JointTrajectory, '/arm/joint_trajectory').publish(asked)
    end = given[0, -1]
    last = wait_for(
        control,
        states,
        lambda state: np.allclose(state.reference.positions, end) and in_plan(state) > t[-1],
    )
    during = [
        state
        for state in list(states)
        if t[0] < in_plan(state) < t[-1] - 2.0 / RATE_HZ and abs(begin(state) - begin(last)) < 1e-3
    ]
    assert during
    at, expected = Plan(toy.JOINTS, t, given).motion(1e-4)
    for state in during:
        row = int(np.argmin(np.abs(at - in_plan(state))))
        reference = state.reference
        found = reference.positions, reference.velocities, reference.accelerations
        for values, motion, tolerance in zip(found, expected, (1e-3, 2e-2, 0.5), strict=True):
            np.testing.assert_allclose(values, motion[row], atol=tolerance)


def test_a_plan_replaces_the_one_before(control: Control) -> None:
    control.use('arm')
    states = states_of(control, 'arm')
    filled_by_serve(control, plan((1.0, 1.0), seconds=60.0))
    wait_for(control, states, lambda state: state.reference.velocities[0] > 0.0)
    filled = filled_by_serve(control, plan((-0.2, 0.1)))
    state = wait_for(control, states, ends_at(np.array([-0.2, 0.1])))
    np.testing.assert_allclose(commanded(state), efforts(filled)[-1], atol=1e-9)


def test_joints_may_come_in_any_order(control: Control) -> None:
    control.use('arm')
    states = states_of(control, 'arm')
    asked = plan((0.1, 0.2))
    asked.joint_names = toy.JOINTS[::-1]
    filled = filled_by_serve(control, asked)
    state = wait_for(control, states, ends_at(np.array([0.2, 0.1])))
    np.testing.assert_allclose(commanded(state), efforts(filled)[-1, ::-1], atol=1e-9)


def without_first_joint(asked: JointTrajectory) -> None:
    asked.joint_names = asked.joint_names[1:]
    for point in asked.points:
        for field in ('positions', 'velocities', 'accelerations', 'effort'):
            setattr(point, field, getattr(point, field)[1:])


def with_equal_times(asked: JointTrajectory) -> None:
    asked.points[1].time_from_start = asked.points[0].time_from_start


def with_foreign_joint(asked: JointTrajectory) -> None:
    asked.joint_names = ['shoulder', 'gripper']


def with_motion_at_the_end(asked: JointTrajectory) -> None:
    asked.points[-1].velocities = [0.1, 0.0]


def in_the_past(asked: JointTrajectory) -> None:
    asked.header.stamp.sec = 1


@pytest.mark.parametrize(
    ('spoil', 'sentence'),
    [
        (without_first_joint, "don't match the controller joints"),
        (with_equal_times, 'is not strictly increasing'),
        (with_foreign_joint, "doesn't match the controller's joints"),
        (with_motion_at_the_end, 'Velocity of last trajectory point of joint shoulder is not'),
        (in_the_past, 'that ends in the past'),
    ],
)
def test_the_controller_refuses(
    control: Control, spoil: Callable[[JointTrajectory], None], sentence: str
) -> None:
    control.use('arm')
    states = states_of(control, 'arm')
    held = [0.3, 0.001 * len(sentence)]  # of this test alone
    filled = deepcopy(filled_by_serve(control, plan(held)))
    wait_for(control, states, ends_at(np.array(held)))
    for point in filled.points:
        point.positions = [0.0, 0.0]
    spoil(filled)
    before = control.process.log.count(sentence)
    control.client.speak(JointTrajectory, '/arm/joint_trajectory').publish(filled)
    control.client.wait_until(
        lambda: control.process.log.count(sentence) > before, 'refusal in the log'
    )
    states.clear()
    control.client.wait_until(lambda: len(states) > 2, 'states')
    assert list(states[-1].reference.positions) == held


@pytest.mark.parametrize('effort', [[1.0, 2.0, 3.0], [np.nan, np.nan]])
def test_the_controller_checks_neither_number_nor_values_of_efforts(
    control: Control, effort: list[float]
) -> None:
    control.use('arm')
    filled = deepcopy(filled_by_serve(control, plan((0.2, 0.2))))
    control.use('arm_once')
    states = states_of(control, 'arm_once')
    for point in filled.points:
        point.effort = effort
    control.client.speak(JointTrajectory, '/arm_once/joint_trajectory').publish(filled)
    wait_for(control, states, ends_at(np.array([0.2, 0.2])))
    control.use('arm')
    assert control.unload('arm_once')  # after what is not a number its states lack the output


def test_a_deactivated_controller_commands_nothing_and_resumes_nothing(control: Control) -> None:
    """Before a first goal has succeeded: later it holds with the efforts of that goal's end."""
    control.use_anew('arm')
    states = states_of(control, 'arm')
    filled_by_serve(control, plan((1.0, 1.0), seconds=60.0))
    wait_for(control, states, lambda state: state.reference.velocities[0] > 0.0)
    joint_states = control.client.listen(JointState, '/joint_states')
    assert control.switch(deactivate=['arm'])
    hear_until_now(control, joint_states)
    control.client.wait_until(
        lambda: joint_states and not published_effort(joint_states[-1]).any(), 'no effort'
    )
    joint_states.clear()
    assert control.switch(['arm'])
    switched = control.client.node.get_clock().now().nanoseconds
    held = wait_for(
        control, states, lambda state: messages.nanoseconds(state.header.stamp) > switched
    )
    # the output in its state may still be that of before
    hear_until_now(control, joint_states)
    assert joint_states
    assert not any(published_effort(each).any() for each in list(joint_states))
    assert held.reference.positions == held.feedback.positions, held


def test_a_controller_that_was_restarted_takes_the_next_plan(control: Control) -> None:
    control.use_anew('arm')
    states = states_of(control, 'arm')
    control.client.status('serve', lambda status: status['state'] == 'active')
    filled = filled_by_serve(control, plan((0.1, -0.1)))
    state = wait_for(control, states, ends_at(np.array([0.1, -0.1])))
    np.testing.assert_allclose(commanded(state), efforts(filled)[-1], atol=1e-9)


def test_the_reference_of_the_controller_is_followed(control: Control) -> None:
    control.use('arm')
    torques = control.client.listen(JointState, '/serve/feedforward_torque')
    states = states_of(control, 'arm')
    filled_by_serve(control, plan())
    wait_for(control, states, ends_at(np.array([0.4, -0.3])))
    stamped = {(each.header.stamp.sec, each.header.stamp.nanosec): each for each in states}
    answered = [
        (stamped[key], torque)
        for torque in list(torques)
        if (key := (torque.header.stamp.sec, torque.header.stamp.nanosec)) in stamped
    ]
    assert answered
    for state, torque in answered:
        point = state.reference
        expected = toy.torque(np.array(point.positions), np.array(point.accelerations))
        np.testing.assert_allclose(torque.effort, expected, rtol=5e-3, atol=0.3)


def test_torques_are_those_of_the_speed_at_which_a_plan_is_executed(
    tmp_path: Path, model_path: str
) -> None:
    """At 0.3 of the speed they were 6 N m too large."""
    factor = 0.3
    with at_speed(factor, tmp_path, model_path) as control:
        torques = control.client.listen(JointState, '/serve/feedforward_torque')
        states = states_of(control, 'arm')
        filled_by_serve(control, plan((1.0, 0.5), seconds=2.0))
        begun = wait_for(control, states, lambda state: state.reference.positions[0] > 0.3)
        hear_until_now(control, states)
    stamped = {(each.header.stamp.sec, each.header.stamp.nanosec): each for each in states}
    answered = [
        (state, torque)
        for torque in torques
        if (state := stamped.get((torque.header.stamp.sec, torque.header.stamp.nanosec)))
        and any(state.reference.accelerations)
    ]
    assert begun.speed_scaling_factor == factor
    assert len(answered) > 5
    for state, torque in answered:
        ddq = factor**2 * np.array(state.reference.accelerations)
        expected = toy.torque(np.array(state.reference.positions), ddq)
        np.testing.assert_allclose(torque.effort, expected, rtol=5e-3, atol=0.3)


@contextmanager
def at_speed(factor: float, folder: Path, model_path: str) -> Iterator[Control]:
    """Give a controller whose plans are executed at a share of their speed, and `serve`."""
    from ros2_control.arm import BROADCASTER, served

    scaling = {'state_interface': 'speed/factor'}
    broadcaster = {'joints': list(toy.JOINTS), 'interfaces': ['position', 'velocity', 'effort']}
    parameters = write_parameters(
        folder / 'controllers.yaml',
        RATE_HZ,
        {
            BROADCASTER: ('joint_state_broadcaster/JointStateBroadcaster', broadcaster),
            'arm': (JTC, trajectory_controller(toy.JOINTS, speed_scaling=scaling)),
        },
    )
    with served(folder, parameters, model_path, factor) as control:
        control.use('arm')
        yield control


def test_position_and_effort_are_passed_on_without_feedback(control: Control) -> None:
    control.use('arm')
    filled = deepcopy(filled_by_serve(control, plan()))
    control.use('arm_both')
    states = states_of(control, 'arm_both')
    control.client.speak(JointTrajectory, '/arm_both/joint_trajectory').publish(filled)
    state = wait_for(control, states, ends_at(np.array([0.4, -0.3])))
    assert state.output.positions == state.reference.positions
    np.testing.assert_allclose(state.output.effort, efforts(filled)[-1], atol=1e-9)


def test_without_effort_among_the_command_interfaces_a_plan_with_effort_is_refused(
    control: Control,
) -> None:
    control.use('arm')
    filled = deepcopy(filled_by_serve(control, plan()))
    control.use('arm_position')
    states_of(control, 'arm_position')
    control.client.speak(JointTrajectory, '/arm_position/joint_trajectory').publish(filled)
    sentence = "only supported for controllers using the 'effort' command interface"
    control.client.wait_until(lambda: sentence in control.process.log, 'refusal in the log')


def test_some_of_the_joints_where_the_controller_allows_that(control: Control) -> None:
    """`serve` fills whole plans alone; what a joint that is left out gets is its feedback."""
    control.use('arm')
    filled = deepcopy(filled_by_serve(control, plan((0.4, -0.2))))
    without_first_joint(filled)
    control.use('arm_partial')
    states = states_of(control, 'arm_partial')
    control.client.speak(JointTrajectory, '/arm_partial/joint_trajectory').publish(filled)
    state = wait_for(
        control,
        states,
        lambda state: state.reference.positions[1] == -0.2 and in_plan(state) > LAST,
    )
    np.testing.assert_allclose(commanded(state), [0.0, efforts(filled)[-1, 0]], atol=1e-9)


def test_effort_beside_velocity_is_no_interface_of_the_controller(control: Control) -> None:
    assert not control.load('arm_wrong')
    assert "'velocity' command interface can be used either alone or" in control.process.log
