"""The action FollowJointTrajectory of `serve`, in front of that of the controller."""

from __future__ import annotations

from collections.abc import Callable
import time
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import GoalEvent

from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward import goals
from lip_id_ros.feedforward.goals import Ending, GoalCounts, Outcome, Relayed
from lip_id_ros.feedforward.server import Server
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.signals.joints import RefusedError

NAME = '~/follow_joint_trajectory'

KEPT_S = 60
"""Results are kept for so long: every client asks for them when its goal is accepted."""

ENDINGS = {
    GoalStatus.STATUS_SUCCEEDED: Ending.SUCCEEDED,
    GoalStatus.STATUS_CANCELED: Ending.CANCELED,
    GoalStatus.STATUS_ABORTED: Ending.ABORTED,
}


class Goals:
    """
    Fill the efforts of goals, hand them to the controller, and hand back all that it answers.

    A goal keeps its identity, its tolerances and whatever else it has. `action` is that of the
    controller; ConfigError if its type is not installed.
    """

    def __init__(self, node: NodeBase, server: Server, counts: GoalCounts, action: str) -> None:
        self._node, self._server, self._counts = node, server, counts
        self._kind = _action_type()
        self._action: str = node.resolve_service_name(action)
        self._relays: list[_Relay] = []
        calls = dict.fromkeys(
            [f'{name}_service_qos_profile' for name in ('goal', 'result', 'cancel')], qos.CALLS
        )
        self._client = ActionClient(node, self._kind, self._action, **calls)
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
        if self._client.server_is_ready():
            return []
        return [f'no controller offers the action {self._action}']

    def watch(self) -> None:
        """End goals whose controller has ended, and ask again for results that were lost."""
        if not self._relays:
            return
        now, servers = time.monotonic(), self._servers()
        for relay in list(self._relays):
            relay.watch(now, servers)

    def release(self) -> None:
        """Have the controller cancel all goals, since nobody could through this node any more."""
        for relay in list(self._relays):
            relay.release()

    def destroy(self) -> None:
        """Offer the action no more."""
        self.release()
        self._offered.destroy()
        self._client.destroy()

    def _servers(self) -> frozenset[bytes]:
        topic = f'{self._action}/_action/status'
        infos = self._node.get_publishers_info_by_topic(topic)
        return frozenset(bytes(info.endpoint_gid) for info in infos)

    def _on_goal(self, handle: Any) -> None:
        self._counts.received += 1
        try:
            if not handle.is_cancel_requested:
                handle.executing()
            outcome = self._fill(handle.request.trajectory)
            if outcome is None and not self._client.server_is_ready():
                outcome = goals.without_controller(self._action)
            if outcome is None:
                self._relay(handle)
        except Exception as error:
            self._node.caught(error)
            outcome = goals.failed(error)
        if outcome is not None:
            self._end(handle, outcome)

    def _fill(self, plan: Any) -> Outcome | None:
        """Fill in the efforts of a plan; return the outcome of one that cannot be filled."""
        self._server.counts.references.received += 1
        try:
            messages.with_effort(plan, self._server.plan(plan.joint_names, plan.points))
        except RefusedError as error:
            self._node.warn_of_refusal(error)
            return goals.refused(error.reason, str(error))
        return None

    def _relay(self, handle: Any) -> None:
        relay = _Relay(self._client, handle, self._action, self._servers(), self._finish)
        self._relays.append(relay)
        relay.send()

    def _on_cancel(self, handle: Any) -> CancelResponse:
        for relay in self._relays:
            if relay.handle is handle:
                relay.cancel()
        return CancelResponse.ACCEPT

    def _finish(self, relay: _Relay, outcome: Outcome, result: Any) -> None:
        self._relays.remove(relay)
        self._end(relay.handle, outcome, result)

    def _end(self, handle: Any, outcome: Outcome, result: Any = None) -> None:
        self._counts.end(outcome)
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


class _Relay:
    """One goal at the controller: `handle` is the client's, `finish` takes its end."""

    def __init__(
        self,
        client: ActionClient,
        handle: Any,
        action: str,
        servers: frozenset[bytes],
        finish: Callable[[_Relay, Outcome, Any], None],
    ) -> None:
        self.handle = handle
        self._client, self._action, self._servers = client, action, servers
        self._finish = finish
        self._state = Relayed(time.monotonic())
        self._remote: Any = None  # the goal at the controller

    def send(self) -> None:
        answer = self._client.send_goal_async(
            self.handle.request,
            feedback_callback=self._on_feedback,
            goal_uuid=self.handle.goal_id,
        )
        answer.add_done_callback(self._on_answer)

    def cancel(self) -> None:
        if self._state.cancel(time.monotonic()):
            self._remote.cancel_goal_async()

    def release(self) -> None:
        self.cancel()
        self._end(goals.released())

    def watch(self, now: float, servers: frozenset[bytes]) -> None:
        if not self._servers & servers:
            self._end(goals.lost(self._action, 'has ended'))
        elif self._state.is_silent(now):
            self._end(goals.lost(self._action, 'has not answered'))
        elif self._state.is_forgotten(now):
            self._end(goals.forgotten(self._action))
        elif self._remote is not None:
            over = self._remote.status in ENDINGS
            if self._state.lacks_result(over, now):
                self._ask_for_result()

    def _on_answer(self, answer: Any) -> None:
        self._remote = answer.result()
        if not self._remote.accepted:
            self._end(goals.rejected(self._action))
            return
        if self._state.accept(time.monotonic()):
            self._remote.cancel_goal_async()
        if self._state.outcome is None:
            self._ask_for_result()

    def _on_feedback(self, message: Any) -> None:
        if self._state.outcome is None:
            self.handle.publish_feedback(message.feedback)

    def _ask_for_result(self) -> None:
        self._remote.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, answered: Any) -> None:
        status, result = answered.result().status, answered.result().result
        if status in ENDINGS:
            ending = ENDINGS[status]
            self._end(Outcome(ending, result.error_code, result.error_string), result)
        else:  # another controller of this name has never had the goal
            self._end(goals.lost(self._action, 'has forgotten the goal'))

    def _end(self, outcome: Outcome, result: Any = None) -> None:
        if self._state.end(outcome):
            self._finish(self, outcome, result)


def _action_type() -> Any:
    try:
        from control_msgs.action import FollowJointTrajectory
    except ImportError:
        raise ConfigError(
            'controller_action needs the package control_msgs, which is not installed; install '
            'ros-jazzy-control-msgs or leave controller_action empty.'
        ) from None
    return FollowJointTrajectory
