"""The action FollowJointTrajectory of `serve`, in front of that of the controller."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
import time
from typing import Any

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import GoalEvent
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward import goals
from lip_id_ros.feedforward.goals import Ending, GoalCounts, Outcome
from lip_id_ros.feedforward.server import Server
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.plans import Planned, Plans
from lip_id_ros.nodes.relay import ControllerAction, goal_of_feedback, Relay
from lip_id_ros.signals.joints import Refusal, RefusedError

NAME = '~/follow_joint_trajectory'

MOST_INLINE = 250
"""
A goal with more points is filled in a process beside the stream, as a long plan is. So many points
take 5 ms here, and there the way to the other process and back.
"""

LOOK_S = 0.1
"""A controller is looked for so often while it has goals: each look takes half a millisecond."""

KEPT_S = 60
"""Results are kept for so long: every client asks for them when its goal is accepted."""


class Goals:
    """
    Fill the efforts of goals, hand them to the controller, and hand back all that it answers.

    A goal keeps its identity, its tolerances and whatever else it has. `action` is that of the
    controller; ConfigError if its type is not installed.
    """

    def __init__(
        self, node: NodeBase, server: Server, plans: Plans, counts: GoalCounts, action: str
    ) -> None:
        self._node, self._server, self._plans, self._counts = node, server, plans, counts
        self._kind = action_type()
        # by the identity of the goal: those of the controller, and those filled beside the stream
        self._relays: dict[bytes, Relay] = {}
        self._look_at = 0.0
        self._filled: dict[bytes, tuple[Any, Callable[[Planned], None]]] = {}
        calls = dict.fromkeys(
            [f'{name}_service_qos_profile' for name in ('goal', 'result', 'cancel')], qos.CALLS
        )
        action = node.resolve_service_name(action)
        self._action = ControllerAction(node, self._kind, action, self._on_feedback)
        feedback = self._kind.Impl.FeedbackMessage
        self._feedback = node.create_publisher(feedback, f'{NAME}/_action/feedback', qos.OUTPUT)
        self._offered = ActionServer(
            node,
            self._kind,
            NAME,
            goal_callback=lambda goal: GoalResponse.ACCEPT,  # else there is no reason to give
            handle_accepted_callback=self._on_goal,
            cancel_callback=self._on_cancel,
            result_timeout=KEPT_S,
            **calls,
        )

    def warnings(self) -> list[str]:
        """Describe what is missing for goals."""
        if self._action.servers():
            return []
        return [f'no controller offers the action {self._action.name}']

    def watch(self) -> None:
        """Go on with goals that were cancelled, or whose controller is missing."""
        for handle, _ in list(self._filled.values()):
            if handle.is_cancel_requested:
                self._abandon(handle, goals.cancelled_early())
        self._action.time.advance(time.monotonic())
        now = self._action.time.now
        if not self._relays or now < self._look_at:
            return
        self._look_at, servers = now + LOOK_S, self._action.servers()
        for relay in list(self._relays.values()):
            relay.watch(servers)

    def release(self) -> None:
        """Have the controller cancel all goals: nobody wants their efforts, or can cancel them."""
        for relay in list(self._relays.values()):
            relay.release()
        for handle, _ in list(self._filled.values()):
            self._abandon(handle, goals.released())

    def destroy(self) -> None:
        """Offer the action no more."""
        self.release()
        self._offered.destroy()
        self._action.destroy()
        self._node.destroy_publisher(self._feedback)

    def _abandon(self, handle: Any, outcome: Outcome) -> None:
        """End a goal that is still being filled."""
        _, answered = self._filled.pop(_identity(handle))
        self._plans.abandon(answered)
        self._server.counts.references.refuse(Refusal.INTERRUPTED)
        self._end(handle, outcome)

    def _on_goal(self, handle: Any) -> None:
        self._counts.received += 1
        self._server.counts.references.received += 1
        with self._ending(handle):
            if not handle.is_cancel_requested:
                handle.executing()
            plan = handle.request.trajectory
            count = len(plan.points)
            if count > 1 and self._plans.are_slow(count > MOST_INLINE):
                answered = partial(self._answered, handle)
                self._plans.submit(serialize_message(plan), count, answered)
                self._filled[_identity(handle)] = handle, answered
                return
            messages.filled(plan, self._server)
            self._plans.interrupt()
            self._hand_on(handle)

    def _answered(self, handle: Any, planned: Planned) -> None:
        """Go on with a goal whose plan was filled beside the stream."""
        if self._filled.pop(_identity(handle), None) is None:  # it has ended meanwhile
            return
        with self._ending(handle):
            raw = self._plans.accept(planned)
            handle.request.trajectory = deserialize_message(raw, JointTrajectory)
            self._hand_on(handle)

    @contextmanager
    def _ending(self, handle: Any) -> Iterator[None]:
        """End a goal where it is refused, or an error arises."""
        try:
            yield
        except RefusedError as error:
            self._node.warn_of_refusal(error)
            self._end(handle, goals.refused(error.reason, str(error)))
        except Exception as error:
            self._node.caught(error)
            self._end(handle, goals.failed(error))

    def _hand_on(self, handle: Any) -> None:
        if not (servers := self._action.servers()):
            self._end(handle, goals.without_controller(self._action.name))
            return
        relay = Relay(self._action, servers, handle, self._finish)
        relay.send()
        self._relays[_identity(handle)] = relay
        _forget_plan(handle)

    def _on_feedback(self, raw: bytes) -> None:
        if goal_of_feedback(raw) in self._relays:
            self._feedback.publish(raw)

    def _on_cancel(self, handle: Any) -> CancelResponse:
        relay = self._relays.get(_identity(handle))
        if relay is not None:
            relay.cancel()
        return CancelResponse.ACCEPT

    def _finish(self, relay: Relay, outcome: Outcome, result: Any) -> None:
        del self._relays[_identity(relay.handle)]
        self._end(relay.handle, outcome, result)

    def _end(self, handle: Any, outcome: Outcome, result: Any = None) -> None:
        self._counts.end(outcome)
        _forget_plan(handle)
        if result is None:
            result = self._kind.Result(error_code=outcome.code, error_string=outcome.sentence)
        if outcome.ending is Ending.SUCCEEDED:
            handle.succeed(result)
        elif outcome.ending is Ending.CANCELED:
            if not handle.is_cancel_requested:  # the controller did it by itself
                handle._update_state(GoalEvent.CANCEL_GOAL)
            handle.canceled(result)
        else:
            handle.abort(result)


def _identity(handle: Any) -> bytes:
    return bytes(handle.goal_id.uuid)


def _forget_plan(handle: Any) -> None:
    """Let go of what is large in a goal: rclpy keeps it for `KEPT_S` after its end."""
    handle.request.trajectory = JointTrajectory()
    handle.request.multi_dof_trajectory = MultiDOFJointTrajectory()


def action_type() -> Any:
    """Return FollowJointTrajectory; ConfigError where its package is not installed."""
    try:
        from control_msgs.action import FollowJointTrajectory
    except ImportError:
        raise ConfigError(
            'controller_action needs the package control_msgs, which is not installed; install '
            'ros-jazzy-control-msgs or leave controller_action empty.'
        ) from None
    return FollowJointTrajectory
