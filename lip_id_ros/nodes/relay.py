"""The action of a controller, and goals of `serve` that it executes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalInfo, GoalStatus
from rclpy.task import Future

from lip_id_ros.feedforward import goals
from lip_id_ros.feedforward.goals import Ending, Outcome, Relayed, WatchedTime
from lip_id_ros.nodes import qos
from lip_id_ros.nodes.node import NodeBase

ENDINGS = {
    GoalStatus.STATUS_SUCCEEDED: Ending.SUCCEEDED,
    GoalStatus.STATUS_CANCELED: Ending.CANCELED,
    GoalStatus.STATUS_ABORTED: Ending.ABORTED,
}
ENCAPSULATION, UUID_BYTES, STAMP_BYTES = 4, 16, 8


class ControllerAction:
    """
    The services and topics of a controller's action.

    `kind`: its type. `name`: its full name. `time`: by which its goals are watched.
    rclpy's own client makes objects of every list of goals, which the controller publishes at each
    change: of all goals of 15 minutes, 10 ms for 400 of them. Here lists and feedback stay bytes.
    """

    def __init__(
        self, node: NodeBase, kind: Any, name: str, on_feedback: Callable[[bytes], None]
    ) -> None:
        self.name = name
        self._node, self._kind = node, kind.Impl
        self.time = WatchedTime()
        self._statuses = b''
        topics = f'{name}/_action'
        self._send, self._result, self._cancel = self._clients = [
            node.create_client(service, f'{topics}/{call}', qos_profile=qos.CALLS)
            for call, service in (
                ('send_goal', self._kind.SendGoalService),
                ('get_result', self._kind.GetResultService),
                ('cancel_goal', self._kind.CancelGoalService),
            )
        ]
        self._status_topic = f'{topics}/status'
        self._subscriptions = [
            node.create_subscription(kind, topic, callback, profile, raw=True)
            for kind, topic, callback, profile in (
                (self._kind.FeedbackMessage, f'{topics}/feedback', on_feedback, qos.OUTPUT),
                (self._kind.GoalStatusMessage, self._status_topic, self._on_status, qos.LATCHED),
            )
        ]

    def servers(self) -> frozenset[bytes]:
        """Return who offers the whole action, by identities: one that was restarted is another."""
        if not all(each.service_is_ready() for each in self._clients):
            return frozenset()
        infos = self._node.get_publishers_info_by_topic(self._status_topic)
        return frozenset(bytes(info.endpoint_gid) for info in infos)

    def send(self, goal_id: Any, goal: Any) -> Future:
        """Ask for the execution of a goal."""
        return self._send.call_async(
            self._kind.SendGoalService.Request(goal_id=goal_id, goal=goal)
        )

    def ask_for_result(self, goal_id: Any) -> Future:
        """Ask for the result of a goal, which is answered at its end."""
        return self._result.call_async(self._kind.GetResultService.Request(goal_id=goal_id))

    def cancel(self, goal_id: Any) -> None:
        """Ask to cancel a goal."""
        info = GoalInfo(goal_id=goal_id)
        self._cancel.call_async(self._kind.CancelGoalService.Request(goal_info=info))

    def is_over(self, goal_id: Any) -> bool:
        """Whether a goal has ended by the newest list."""
        return status_of(self._statuses, bytes(goal_id.uuid)) in ENDINGS

    def is_executed(self, goal_id: Any) -> bool:
        """Whether a goal is executed by the newest list, and not being cancelled."""
        status = status_of(self._statuses, bytes(goal_id.uuid))
        return status == int(GoalStatus.STATUS_EXECUTING)

    def destroy(self) -> None:
        """Release what belongs to the node."""
        for client in self._clients:
            self._node.destroy_client(client)
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)

    def _on_status(self, raw: bytes) -> None:
        self._statuses = raw


def status_of(statuses: bytes, goal_id: bytes) -> int:
    """Return the status of a goal in a serialised GoalStatusArray; unknown where it is not."""
    at = statuses.find(goal_id)
    if at < 0:
        return int(GoalStatus.STATUS_UNKNOWN)
    stamp = (at + UUID_BYTES + 3) & ~3  # aligned
    return int(statuses[stamp + STAMP_BYTES])


def goal_of_feedback(raw: bytes) -> bytes:
    """Return the identity of the goal that a serialised feedback is of."""
    return raw[ENCAPSULATION : ENCAPSULATION + UUID_BYTES]


class Relay:
    """One goal at the controller: `handle` is the client's, `finish` takes its end."""

    def __init__(
        self,
        action: ControllerAction,
        servers: frozenset[bytes],
        handle: Any,
        finish: Callable[[Relay, Outcome, Any], None],
    ) -> None:
        self.handle = handle
        self._action, self._servers, self._finish = action, servers, finish
        self._state = Relayed(self._action.time.now)

    def send(self) -> None:
        """Hand the goal to the controller."""
        answer = self._action.send(self.handle.goal_id, self.handle.request)
        answer.add_done_callback(self._on_answer)

    def cancel(self) -> None:
        """Have the controller cancel the goal, once it has it."""
        if self._state.cancel(self._action.time.now):
            self._action.cancel(self.handle.goal_id)

    def release(self) -> None:
        """End the goal here, and have the controller cancel it, if it has not answered too."""
        self._state.cancel(self._action.time.now)
        # its answer may come when this node is no more; it looks at goals before cancels
        self._action.cancel(self.handle.goal_id)
        self._end(goals.released())

    def watch(self, servers: frozenset[bytes]) -> None:
        """End the goal where the controller is lost or silent; ask again for a lost result."""
        action, now = self._action.name, self._action.time.now
        if not self._servers & servers:
            self._end(goals.lost(action, 'has ended'))
        elif self._state.is_silent(now):
            self._end(goals.lost(action, 'has not answered'))
        elif self._state.is_forgotten(now):
            if self._action.is_executed(self.handle.goal_id):  # the request was lost or refused
                self.cancel()
            else:
                self._end(goals.forgotten(action))
        elif self._state.lacks_result(self._action.is_over(self.handle.goal_id), now):
            self._ask_for_result()

    def _on_answer(self, answer: Any) -> None:
        if not answer.result().accepted:
            self._end(goals.rejected(self._action.name))
            return
        if self._state.accept(self._action.time.now):
            self._action.cancel(self.handle.goal_id)
        if self._state.outcome is None:
            self._ask_for_result()

    def _ask_for_result(self) -> None:
        asked = self._action.ask_for_result(self.handle.goal_id)
        asked.add_done_callback(self._on_result)

    def _on_result(self, answered: Any) -> None:
        status, result = answered.result().status, answered.result().result
        if status in ENDINGS:
            ending = ENDINGS[status]
            self._end(Outcome(ending, result.error_code, result.error_string), result)
        else:  # another controller of this name has never had the goal
            self._end(goals.lost(self._action.name, 'has forgotten the goal'))

    def _end(self, outcome: Outcome, result: Any = None) -> None:
        if self._state.end(outcome):
            self._finish(self, outcome, result)
