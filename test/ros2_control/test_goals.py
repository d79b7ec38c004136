"""The action of `serve` in front of a real joint_trajectory_controller."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
import signal
import time
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('controller_manager_msgs')

from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from lifecycle_msgs.msg import Transition
from nodes import toy
from nodes.ros_graph import graph
import numpy as np
from numpy.typing import ArrayLike
import psutil
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.serialization import serialize_message
from rclpy.task import Future
from ros2_control.arm import commanded, Control, hear_until_now, plan, served, times
from ros2_control.test_plans import at_speed, states_of, wait_for
from trajectory_msgs.msg import JointTrajectory

from benchmarks._mock_controller import GAINS
from lip_id_ros.feedforward.goals import ErrorCode
from lip_id_ros.nodes import messages

if TYPE_CHECKING:
    from nodes.ros_graph import Process

pytestmark = [pytest.mark.ros, pytest.mark.ros2_control]

ACTION = '/serve/follow_joint_trajectory'
STATUS = {
    GoalStatus.STATUS_SUCCEEDED: 'succeeded',
    GoalStatus.STATUS_CANCELED: 'canceled',
    GoalStatus.STATUS_ABORTED: 'aborted',
}


class Sender:
    def __init__(self, control: Control) -> None:
        self._control = control
        self._results: dict[bytes, Any] = {}
        self._client = ActionClient(control.client.node, FollowJointTrajectory, ACTION)
        control.client.wait_until(self._client.server_is_ready, 'action of serve')

    def ask(self, goal: Any, feedback: Callable[[Any], None] | None = None) -> Any:
        answer = self._client.send_goal_async(goal, feedback_callback=feedback)
        self._control.client.wait_until(answer.done, 'answer to a goal')
        return answer.result()

    def refuses(self, goal: Any) -> bool:
        return not self.ask(goal).accepted

    def send(self, goal: Any, feedback: Callable[[Any], None] | None = None) -> Any:
        handle = self.ask(goal, feedback)
        assert handle.accepted
        self._results[bytes(handle.goal_id.uuid)] = handle.get_result_async()
        return handle

    def is_over(self, handle: Any) -> bool:
        return bool(self._results[bytes(handle.goal_id.uuid)].done())

    def result(self, handle: Any) -> tuple[str, Any]:
        asked = self._results[bytes(handle.goal_id.uuid)]
        self._control.client.wait_until(asked.done, 'result of a goal')
        return STATUS[asked.result().status], asked.result().result

    def cancel(self, handle: Any) -> Any:
        asked = handle.cancel_goal_async()
        self._control.client.wait_until(asked.done, 'answer to a cancel')
        return asked.result()

    def run(self, goal: Any) -> tuple[str, Any]:
        return self.result(self.send(goal))

    def destroy(self) -> None:
        node = self._control.client.node
        task = node.executor.create_task(self._client.destroy)
        self._control.client.wait_until(task.done, 'end of a client')


@pytest.fixture(scope='module')
def sender(control: Control) -> Iterator[Sender]:
    control.use('arm')
    made = Sender(control)
    yield made
    made.destroy()


def goal(*arguments: Any, **more: Any) -> Any:
    return FollowJointTrajectory.Goal(trajectory=plan(*arguments, **more))


def counts(control: Control, received: int) -> dict[str, Any]:
    """Counts of goals since the mark, once so many have come and ended."""

    def ended(status: dict[str, Any]) -> bool:
        counted = status['goals']
        return bool(counted['received'] == received and counted['running'] == 0)

    return dict(control.client.status('serve', ended)['goals'])


def test_constants_are_those_of_the_action() -> None:
    for code in ErrorCode:
        assert getattr(FollowJointTrajectory.Result, code.name) == code


def test_a_goal_is_executed_with_its_efforts(control: Control, sender: Sender) -> None:
    control.use('arm')
    states = states_of(control, 'arm')
    heard: list[Any] = []
    handle = sender.send(goal((0.4, -0.3)), heard.append)
    ending, result = sender.result(handle)
    assert (ending, result.error_code) == ('succeeded', 0)
    assert result.error_string == 'Goal successfully reached!'
    control.client.wait_until(lambda: heard, 'feedback')
    assert list(heard[0].feedback.joint_names) == list(toy.JOINTS)
    moving = [state for state in list(states) if state.reference.velocities[0] > 0.5]
    assert moving
    largest = max(abs(commanded(state)).max() for state in moving)
    assert largest > 5.0  # N m, of the plan's efforts; those without it are zero


def test_efforts_of_a_goal_are_those_of_the_speed_at_which_it_begins(
    tmp_path: Path, model_path: str
) -> None:
    with at_speed(0.3, tmp_path, model_path) as control:
        sender, states = Sender(control), states_of(control, 'arm')
        handle = sender.send(goal((1.0, 0.5), seconds=1.0))
        wait_for(control, states, lambda state: state.reference.positions[0] > 0.3)
        sender.cancel(handle)
        sender.result(handle)  # canceled, or on a loaded machine already succeeded
        moving = [state for state in list(states) if any(state.reference.accelerations)]
        for state in moving:
            ddq = 0.09 * np.array(state.reference.accelerations)
            expected = toy.torque(np.array(state.reference.positions), ddq)
            np.testing.assert_allclose(commanded(state), expected, atol=0.5)
        assert len(moving) > 10
        sender.destroy()


def largest_error(states: list[Any]) -> float:
    """Of efforts beside those that the motion of the controller's reference needs [N m]."""
    error = [
        commanded(state)
        - toy.torque(np.array(state.reference.positions), np.array(state.reference.accelerations))
        for state in states
    ]
    return float(np.quantile(np.abs(error).max(axis=1), 0.9))  # but for some near the points


@pytest.mark.parametrize('given', [3, 2])
def test_a_goal_of_one_point_has_the_efforts_of_its_motion(
    control: Control, sender: Sender, given: int
) -> None:
    """Two points at rest had 0.4 N m at both ends, where the motion needs 18.5."""
    control.use_anew('arm')
    states = states_of(control, 'arm')
    asked = goal((0.4, -0.3), seconds=0.5, n_points=2)
    for point in asked.trajectory.points:
        point.accelerations = point.accelerations if given > 2 else []
    assert len(asked.trajectory.points) == 1
    assert sender.run(asked)[0] == 'succeeded'
    moving = [state for state in list(states) if any(state.reference.velocities)]
    needed = max(
        np.abs(
            toy.torque(
                np.array(state.reference.positions), np.array(state.reference.accelerations)
            )
        ).max()
        for state in moving
    )
    assert len(moving) > 15
    assert largest_error(moving) < 0.4 * needed  # 1.0 without the points
    (serve,) = [control.client.status('serve', lambda status: status['added_points'] > 0)]
    assert serve['sparse_plans'] == 0


def test_a_goal_of_some_joints_holds_the_others(control: Control, sender: Sender) -> None:
    control.use_anew('arm')
    assert sender.run(goal((0.0, 0.0)))[0] == 'succeeded'
    states = states_of(control, 'arm')
    asked = FollowJointTrajectory.Goal(trajectory=plan((0.4,), n_points=11))
    asked.trajectory.joint_names = ['elbow']
    assert sender.run(asked)[0] == 'succeeded'
    wait_for(control, states, lambda state: is_at(states, [0.0, 0.4]))
    moving = [state for state in list(states) if any(state.reference.velocities)]
    assert largest_error(moving) < 1.0


def test_at_its_end_the_controller_holds_the_last_point(control: Control, sender: Sender) -> None:
    control.use('arm')
    states = states_of(control, 'arm')
    assert sender.run(goal((0.4, 0.2)))[0] == 'succeeded'

    def is_over() -> bool:
        return list(states[-1].reference.positions) == [0.4, 0.2]

    control.client.wait_until(lambda: states and is_over(), 'last state')
    # the effort of the last point is held too, and carries the arm
    gravity = toy.WEIGHT * np.sin([0.4, 0.2])
    np.testing.assert_allclose(commanded(states[-1]), gravity, atol=0.1)


def test_each_later_hold_adds_the_efforts_of_the_last_goal_that_succeeded(
    control: Control, sender: Sender
) -> None:
    """The controller's set_hold_position sets positions alone: docs/explanation/safety.md."""
    control.use_anew('arm')
    states = states_of(control, 'arm')
    assert sender.run(goal((0.4, 0.2)))[0] == 'succeeded'
    gravity = toy.WEIGHT * np.sin([0.4, 0.2])

    def assert_held() -> None:
        hear_until_now(control, states)
        held = states[-1]
        assert list(held.reference.positions) == [0.0, 0.0]  # mock hardware stands still
        np.testing.assert_allclose(commanded(held), gravity, atol=0.1)

    handle = sender.send(goal((1.0, 1.0), seconds=60.0))
    wait_for(control, states, lambda state: state.reference.velocities[0] > 0.0)
    assert len(sender.cancel(handle).goals_canceling) == 1
    assert sender.result(handle)[0] == 'canceled'
    assert_held()
    assert control.switch(deactivate=['arm'])
    assert control.switch(['arm'])
    assert_held()


def test_the_last_goal_preempts_the_one_before(control: Control, sender: Sender) -> None:
    control.use('arm')
    first = sender.send(goal((1.0, 1.0), seconds=60.0))
    second = sender.send(goal((0.1, 0.2)))
    ending, result = sender.result(first)
    assert ending == 'aborted'
    assert result.error_string == 'Current goal preempted by new incoming action.'
    assert sender.result(second)[0] == 'succeeded'


def test_a_goal_is_cancelled(control: Control, sender: Sender) -> None:
    control.use('arm')
    handle = sender.send(goal((1.0, 1.0), seconds=60.0))
    assert len(sender.cancel(handle).goals_canceling) == 1
    assert sender.result(handle)[0] == 'canceled'


def test_tolerances_reach_the_controller(control: Control, sender: Sender) -> None:
    control.use('arm')
    asked = goal((0.4, 0.4))
    asked.path_tolerance = [JointTolerance(name='shoulder', position=0.1)]
    ending, result = sender.run(asked)  # mock hardware stands still
    assert (ending, result.error_code) == ('aborted', ErrorCode.PATH_TOLERANCE_VIOLATED)
    asked = goal((0.4, 0.4))
    asked.goal_tolerance = [JointTolerance(name='elbow', position=0.1)]
    asked.goal_time_tolerance.nanosec = 1
    ending, result = sender.run(asked)
    assert (ending, result.error_code) == ('aborted', ErrorCode.GOAL_TOLERANCE_VIOLATED)


def test_what_cannot_be_filled_is_refused(control: Control, sender: Sender) -> None:
    control.use('arm')
    control.client.mark('serve')
    foreign, short, past = goal(), goal(), goal()
    foreign.trajectory.joint_names = ['shoulder', 'gripper']
    short.trajectory.points[0].velocities = [0.0]
    past.trajectory.header.stamp.sec = 1
    assert sender.refuses(foreign)
    assert sender.refuses(short)
    assert sender.refuses(past)
    assert counts(control, 3)['refused'] == {
        'foreign joint in a plan': 1,
        'plan that no controller takes': 1,
        'plan that is over': 1,
    }


def test_a_goal_that_comes_after_its_begin_is_told(control: Control, sender: Sender) -> None:
    control.use('arm')
    control.client.mark('serve')
    late = goal(seconds=60.0)
    now = control.client.node.get_clock().now().nanoseconds
    late.trajectory.header.stamp = messages.stamp_at(now - 10**9)
    sender.cancel(sender.send(late))
    control.client.status('serve', lambda status: status['late_plans'] == 1)


def test_goals_are_refused_while_references_contradict_each_other(
    control: Control, sender: Sender
) -> None:
    control.use('arm')
    client, topic = control.client, '/serve/desired_trajectory'
    client.set_parameters('serve', several_publishers='refuse')
    several = [client.node.create_publisher(JointTrajectory, topic, 10) for _ in range(2)]
    client.status('serve', lambda status: f'2 publishers of {topic}' in status['summary'])
    client.mark('serve')
    refused = sender.refuses(goal())
    for each in several:
        client.withdraw(each)
    client.status('serve', lambda status: 'publishers of' not in status['summary'])
    answered = sender.run(goal())
    client.set_parameters('serve', several_publishers='warn')
    assert refused
    assert answered[0] == 'succeeded'
    assert counts(control, 2)['refused'] == {'several publishers': 1}
    assert 'end all but one, or set several_publishers' in serve_process(control).log


def test_a_disabled_node_refuses_goals(control: Control, sender: Sender) -> None:
    control.use('arm')
    assert control.client.switch('/serve/enable', False).success
    refused = sender.refuses(goal())
    assert control.client.switch('/serve/enable', True).success
    assert refused
    assert 'the node is disabled; call its service enable' in serve_process(control).log


def test_a_controller_that_is_deactivated_or_ended(control: Control, sender: Sender) -> None:
    control.use('arm')
    heard: list[Any] = []
    handle = sender.send(goal((1.0, 1.0), seconds=60.0), heard.append)
    control.client.wait_until(lambda: heard, 'feedback')
    assert control.switch(deactivate=['arm'])
    ending, result = sender.result(handle)
    assert ending == 'aborted'
    assert result.error_string == 'Current goal cancelled during deactivate transition.'
    ending, result = sender.run(goal())
    assert ending == 'aborted'
    assert 'has rejected the plan' in result.error_string
    assert control.unload('arm')  # which the status of serve shows
    assert sender.refuses(goal())
    control.use('arm')


def test_goals_end_with_the_node_that_was_asked(control: Control, sender: Sender) -> None:
    control.use('arm')
    handle = sender.send(goal((1.0, 1.0), seconds=60.0))
    assert control.client.transition(Transition.TRANSITION_DEACTIVATE)
    ending, result = sender.result(handle)
    assert ending == 'aborted'
    assert (
        'disabled, deactivated or ended, and has asked the controller to cancel'
        in result.error_string
    )
    assert control.client.transition(Transition.TRANSITION_ACTIVATE)
    assert sender.run(goal())[0] == 'succeeded'


def test_goals_end_where_the_node_is_disabled(control: Control, sender: Sender) -> None:
    """Their efforts are in the controller: it would go on with them."""
    control.use('arm')
    states = states_of(control, 'arm')
    handle = sender.send(goal((1.0, 1.0), seconds=60.0))
    control.client.wait_until(
        lambda: states and states[-1].reference.velocities[0] > 0.0, 'motion'
    )
    assert control.client.switch('/serve/enable', False).success
    ending, result = sender.result(handle)
    assert control.client.switch('/serve/enable', True).success
    assert ending == 'aborted'
    assert 'the node was disabled' in result.error_string
    control.client.wait_until(lambda: not any(states[-1].reference.velocities), 'standstill')


def test_a_cancel_that_the_controller_refuses_is_asked_for_again(
    tmp_path: Path, model_path: str
) -> None:
    """The arm moves on: the goal is not called cancelled until it is."""
    answers, begun = [CancelResponse.REJECT, CancelResponse.ACCEPT], []

    def begin(handle: Any) -> None:
        begun.append(handle)
        handle.executing()

    action = '/arm/follow_joint_trajectory'
    with graph(tmp_path) as (made, client):
        controller = ActionServer(
            client.node,
            FollowJointTrajectory,
            action,
            execute_callback=None,
            handle_accepted_callback=begin,
            cancel_callback=lambda handle: answers.pop(0),
        )
        serve = made.start(
            'serve', model_path=model_path, torque_limits=[toy.LIMIT], controller_action=action
        )
        sender = Sender(Control(made, client, serve))
        client.status('serve', lambda status: status['summary'] == 'answering')
        handle = sender.send(goal((1.0, 1.0), seconds=60.0))
        client.wait_until(lambda: begun, 'goal at the controller')
        sender.cancel(handle)
        client.wait_until(
            lambda: begun[0].is_cancel_requested or sender.is_over(handle), 'another cancel'
        )
        stopped = FollowJointTrajectory.Result(error_string='stopped')
        assert not sender.is_over(handle)
        client.node.executor.create_task(begun[0].canceled, stopped)
        ending, result = sender.result(handle)
        assert (ending, result.error_string) == ('canceled', 'stopped')
        sender.destroy()
        client.node.executor.create_task(controller.destroy)


def test_a_cancel_that_overtakes_its_goal_is_asked_for_again(
    tmp_path: Path, model_path: str
) -> None:
    """The controller does not know the goal yet; the arm went on for all of its 12 s."""
    action, begun = '/arm/follow_joint_trajectory', []

    def begin(handle: Any) -> None:
        begun.append(handle)
        handle.executing()

    with graph(tmp_path) as (made, client):
        answer = Future(executor=client.node.executor)

        async def accept(_: Any) -> GoalResponse:
            return await answer

        controller = ActionServer(
            client.node,
            FollowJointTrajectory,
            action,
            execute_callback=None,
            goal_callback=accept,
            callback_group=ReentrantCallbackGroup(),  # cancels come while it waits
            handle_accepted_callback=begin,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )
        serve = made.start(
            'serve', model_path=model_path, torque_limits=[toy.LIMIT], controller_action=action
        )
        sender = Sender(Control(made, client, serve))
        client.status('serve', lambda status: status['summary'] == 'answering')
        handle = sender.send(goal((1.0, 1.0), seconds=60.0))
        sender.cancel(handle)
        client.status('serve', lambda status: status['goals']['running'] == 1)
        assert not begun
        client.node.executor.create_task(answer.set_result, GoalResponse.ACCEPT)
        client.wait_until(lambda: begun and begun[0].is_cancel_requested, 'another cancel')
        client.node.executor.create_task(begun[0].canceled, FollowJointTrajectory.Result())
        assert sender.result(handle)[0] == 'canceled'
        sender.destroy()
        client.node.executor.create_task(controller.destroy)


def test_a_goal_that_the_controller_has_not_answered_ends_with_the_node(
    control: Control, sender: Sender
) -> None:
    """The answer to it comes when nobody is there any more who could cancel it."""
    control.use('arm')
    assert sender.run(goal((0.1, 0.1)))[0] == 'succeeded'
    states = states_of(control, 'arm')
    control.process.hold()
    try:
        handle = sender.send(goal((1.0, 1.0), seconds=600.0))
        assert control.client.transition(Transition.TRANSITION_DEACTIVATE)
        assert control.client.transition(Transition.TRANSITION_CLEANUP)
        assert 'has asked the controller to cancel' in sender.result(handle)[1].error_string
    finally:
        control.process.send(signal.SIGCONT)
    begun = time.monotonic()
    control.client.wait_until(lambda: time.monotonic() - begun > 2.0, 'two seconds')
    hear_until_now(control, states)
    assert not any(states[-1].reference.velocities)
    assert control.client.transition(Transition.TRANSITION_CONFIGURE)
    assert control.client.transition(Transition.TRANSITION_ACTIVATE)
    assert sender.run(goal())[0] == 'succeeded'


def within(state: Any, limits: ArrayLike) -> bool:
    """Whether what the controller outputs, if it does, is within limits."""
    torque = np.abs(state.output.effort)
    return not torque.size or bool((torque <= np.add(limits, 1e-9)).all())


@pytest.fixture
def limited(control: Control) -> Iterator[list[float]]:
    """Give `serve` low limits, and the controller no feedback: what it outputs is feedforward."""
    client, limits = control.client, [3.0, 1.0]
    control.use('arm')
    gains = {f'gains.{joint}.{name}': GAINS[name] for joint in toy.JOINTS for name in ('p', 'd')}
    client.set_parameters('arm', **dict.fromkeys(gains, 0.0))
    client.set_parameters('serve', torque_limits=limits, rate_limits=[1e6])
    yield limits
    client.set_parameters('serve', torque_limits=[toy.LIMIT], rate_limits=[])
    client.set_parameters('arm', **gains)


def is_at(states: list[Any], end: list[float]) -> bool:
    return bool(states) and list(states[-1].reference.positions) == end


def hold_little(
    control: Control, sender: Sender, states: list[Any], limits: Sequence[float]
) -> None:
    """Have the controller hold torques within limits: a plan begins with those before it."""
    assert sender.run(goal())[0] == 'succeeded'
    hear_until_now(control, states)
    control.client.wait_until(lambda: within(states[-1], limits), 'low torques')
    states.clear()


@pytest.mark.parametrize('n_points', [11, 1000])
def test_a_goal_beyond_limits_is_slowed_until_it_fits(
    control: Control, sender: Sender, limited: list[float], n_points: int
) -> None:
    states = states_of(control, 'arm')
    hold_little(control, sender, states, limited)
    control.client.set_parameters('serve', overload_policy='slow')
    control.client.mark('serve')
    asked = goal((0.3, -0.2), seconds=0.5, n_points=n_points)
    ending, _ = sender.run(asked)
    control.client.set_parameters('serve', overload_policy='cut')
    assert ending == 'succeeded'
    # its states may come after its result
    control.client.wait_until(lambda: is_at(states, [0.3, -0.2]), 'last state')
    moving = [state for state in list(states) if state.reference.velocities[0] > 0.0]
    assert times([state.reference for state in moving]).max() > 0.6
    assert all(within(state, limited) for state in moving)
    assert not all(within(state, np.multiply(limited, 0.8)) for state in moving)
    control.client.status('serve', lambda status: status['slowed'] == 1)


def test_tolerances_of_a_slowed_goal_are_those_that_were_asked_for(
    control: Control, sender: Sender, limited: list[float]
) -> None:
    """Errors are those of mock hardware, which stands still: what is asked of it."""
    states = states_of(control, 'arm')
    hold_little(control, sender, states, limited)
    asked, late = goal((0.3, -0.2)), goal((0.3, -0.2))  # up to 1.1 rad/s in 0.5 s
    asked.path_tolerance = [JointTolerance(name='shoulder', velocity=0.9)]
    late.goal_tolerance = [JointTolerance(name='shoulder', position=0.1)]
    late.goal_time_tolerance.nanosec = 500_000_000
    control.client.set_parameters('serve', overload_policy='slow')
    slowed, begun = sender.run(asked), time.monotonic()
    ended, took = sender.run(late), time.monotonic() - begun
    control.client.set_parameters('serve', overload_policy='cut')
    assert slowed[0] == 'succeeded'  # with a share of it, the slower motion would be no better
    assert ended[1].error_code == ErrorCode.GOAL_TOLERANCE_VIOLATED
    assert took > 1.1  # s: the slower end, and the time that was given behind it
    assert sender.run(asked)[1].error_code == ErrorCode.PATH_TOLERANCE_VIOLATED


def test_goals_that_are_over_keep_no_plan(control: Control, sender: Sender) -> None:
    control.use('arm')
    process = psutil.Process(serve_process(control).pid)
    n_goals = 40
    asked = goal(seconds=10.0, n_points=240)

    def grown(asked: Any) -> float:
        """By how much the memory of `serve` grows [MiB]."""
        before = process.memory_info().rss
        for _ in range(n_goals):
            assert sender.run(asked)[0] == 'aborted'
        return float(process.memory_info().rss - before) / 2**20

    assert control.switch(deactivate=['arm'])  # it rejects goals then
    assert grown(asked) < 3.0  # that of the plans is 7


def serve_process(control: Control) -> Process:
    (serve,) = [each for each in control.graph.processes if each.log_path.stem == 'serve']
    return serve


def test_sigterm_ends_goals_that_are_executed(
    tmp_path: Path, model_path: str, parameters: Path
) -> None:
    with served(tmp_path, parameters, model_path) as control:
        control.use('arm')
        sender, serve = Sender(control), serve_process(control)
        states = states_of(control, 'arm')
        executed = sender.send(goal((1.0, 1.0), seconds=600.0))
        control.client.wait_until(
            lambda: states and states[-1].reference.velocities[0] > 0.0, 'motion'
        )
        serve.send(signal.SIGTERM)
        ending, result = sender.result(executed)
        assert ending == 'aborted'
        assert 'disabled, deactivated or ended' in result.error_string
        assert serve.wait() == 0
        control.client.wait_until(lambda: not any(states[-1].reference.velocities), 'standstill')
        sender.destroy()


def kill_manager(control: Control) -> None:
    control.process.send(signal.SIGKILL)
    control.process.wait()


def test_a_goal_ends_when_its_controller_is_killed(
    tmp_path: Path, model_path: str, parameters: Path
) -> None:
    """The whole controller manager gets SIGKILL in the middle of a goal: nobody says goodbye."""
    with served(tmp_path, parameters, model_path) as control:
        control.use('arm')
        sender = Sender(control)
        heard: list[Any] = []
        handle = sender.send(goal((1.0, 1.0), seconds=600.0), heard.append)
        control.client.wait_until(lambda: heard, 'feedback')
        kill_manager(control)
        ending, result = sender.result(handle)
        assert ending == 'aborted'
        assert 'the controller of /arm/follow_joint_trajectory is gone' in result.error_string
        assert 'Stop the arm' in result.error_string
        assert sender.refuses(goal())
        counted = counts(control, 2)
        assert (counted['aborted'], counted['refused']) == (1, {'no controller': 1})
        sender.destroy()


def test_a_controller_that_was_lost_cancels_its_goal_once_it_is_back(
    tmp_path: Path, model_path: str, parameters: Path
) -> None:
    """As where a link is down for longer than the middleware waits: the arm went on."""
    with served(tmp_path, parameters, model_path) as control:
        control.use('arm')
        sender = Sender(control)
        states = states_of(control, 'arm')
        handle = sender.send(goal((1.0, 1.0), seconds=600.0))
        wait_for(control, states, lambda state: state.reference.velocities[0] > 0.0)
        control.process.hold()
        try:
            ending, result = sender.result(handle)
            assert ending == 'aborted'
            assert 'is asked to cancel the goal until it answers' in result.error_string
            assert control.client.transition(Transition.TRANSITION_DEACTIVATE)
            assert control.client.transition(Transition.TRANSITION_CLEANUP)
            told = 'whether it cancels a goal, and is asked again and again'
            control.client.status('serve', lambda status: told in status['summary'])
        finally:
            control.process.send(signal.SIGCONT)
        hear_until_now(control, states)
        control.client.wait_until(lambda: not any(states[-1].reference.velocities), 'standstill')
        control.client.status('serve', lambda status: told not in status['summary'])
        sender.destroy()


GIVE_A_GOAL = """
import sys
import time
import rclpy
from rclpy.action import ActionClient
from rclpy.serialization import deserialize_message
from control_msgs.action import FollowJointTrajectory

rclpy.init()
node = rclpy.create_node('vanishing')
client = ActionClient(node, FollowJointTrajectory, sys.argv[1])
client.wait_for_server()
goal = deserialize_message(open(sys.argv[2], 'rb').read(), FollowJointTrajectory.Goal)
sent = client.send_goal_async(goal)
rclpy.spin_until_future_complete(node, sent)
sent.result().get_result_async()
print('accepted', flush=True)
rclpy.spin(node)
"""


def test_a_goal_is_executed_though_its_client_was_killed(
    control: Control, sender: Sender, tmp_path: Path
) -> None:
    """As with the controller alone: who wants the arm to stop cancels the goal."""
    control.use('arm')
    control.client.mark('serve')
    (tmp_path / 'goal').write_bytes(serialize_message(goal((0.3, 0.1), seconds=3.0)))
    arguments = ['-c', GIVE_A_GOAL, ACTION, str(tmp_path / 'goal')]
    client = control.graph.start_program('vanishing', arguments)
    control.client.wait_until(lambda: 'accepted' in client.log, 'goal of the client')
    client.send(signal.SIGKILL)
    client.wait()
    assert counts(control, 1)['succeeded'] == 1
    assert sender.run(goal())[0] == 'succeeded'  # and the next one is taken


def test_of_many_goals_none_is_lost_and_no_torque_is_beyond_its_limit(
    control: Control, sender: Sender, limited: list[float]
) -> None:
    """Goals that overtake each other, are cancelled at random, and cannot be filled."""
    states = states_of(control, 'arm')
    hold_little(control, sender, states, limited)
    control.client.mark('serve')
    n_goals, rng = 100, np.random.default_rng(0)
    handles, endings = [], Counter[str]()
    for _ in range(n_goals):
        asked = goal(rng.uniform(-1.0, 1.0, 2), seconds=float(rng.choice([0.05, 0.1, 0.4])))
        if rng.uniform() < 0.1:
            asked.trajectory.joint_names = ['shoulder', 'gripper']
        if 'gripper' in asked.trajectory.joint_names:
            endings['refused'] += sender.refuses(asked)
            continue
        handle = sender.send(asked)
        if rng.uniform() < 0.3:
            sender.cancel(handle)
        if rng.uniform() < 0.3:
            endings[sender.result(handle)[0]] += 1
        else:
            handles.append(handle)
    endings.update(sender.result(handle)[0] for handle in handles)
    counted = counts(control, n_goals)
    assert counted['succeeded'] == endings['succeeded']
    assert counted['canceled'] == endings['canceled']
    assert counted['aborted'] == endings['aborted']
    assert sum(counted['refused'].values()) == endings['refused'] > 0
    hear_until_now(control, states)
    assert all(within(state, limited) for state in list(states))
    assert not all(within(state, np.multiply(limited, 0.9)) for state in list(states))
