"""The action FollowJointTrajectory of `serve`, in front of that of the controller."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import time
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import GoalEvent
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory, MultiDOFJointTrajectory

from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward import goals
from lip_id_ros.feedforward.goals import Ending, GoalCounts, Outcome, Relayed
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.server import Server
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.plans import accept, INTERRUPTED, is_slow, Planned, PlanWorker, submit
from lip_id_ros.signals.joints import RefusedError

NAME = '~/follow_joint_trajectory'

MOST_INLINE = 250
"""
A goal with more points is filled in a process beside the stream, as a long plan is. So many points
take 5 ms here, and there the way to the other process and back.
"""

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
        self._settings = ServeSettings()
        self._worker: PlanWorker | None = None
        self._waiting: deque[Any] = deque()  # handles; None for a goal that has ended meanwhile
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

    @property
    def n_waiting(self) -> int:
        """How many goals are being filled beside the stream."""
        return len(self._waiting)

    def use(self, loaded: LoadedModel) -> None:
        """Fill long goals by this model from now on."""
        self._stop_worker()
        self._worker = PlanWorker(loaded.file) if loaded.file is not None else None

    def adjust(self, settings: ServeSettings) -> None:
        """Fill long goals by these settings; those that wait are aborted."""
        self._settings = settings
        self._interrupt()

    def watch(self) -> None:
        """Go on with goals that were filled or cancelled, or whose controller is missing."""
        self._end_cancelled()
        planned = self._worker.take() if self._worker else None
        if planned is not None:
            handle = self._waiting.popleft()
            if handle is not None:
                self._answered(handle, planned)
        if not self._relays:
            return
        now, servers = time.monotonic(), self._servers()
        for relay in list(self._relays):
            relay.watch(now, servers)

    def release(self) -> None:
        """Have the controller cancel all goals, since nobody could through this node any more."""
        for relay in list(self._relays):
            relay.release()
        waiting = [handle for handle in self._waiting if handle is not None]
        self._waiting = deque([None] * len(self._waiting))  # their answers are still to come
        for handle in waiting:
            self._end(handle, goals.released())

    def destroy(self) -> None:
        """Offer the action no more."""
        self.release()
        self._stop_worker()
        self._offered.destroy()
        self._client.destroy()

    def _end_cancelled(self) -> None:
        """End goals that nobody wants any more at once: their efforts may be long in coming."""
        for place, handle in enumerate(self._waiting):
            if handle is not None and handle.is_cancel_requested:
                self._waiting[place] = None
                self._end(handle, goals.cancelled_early())

    def _stop_worker(self) -> None:
        self._end_cancelled()
        if self._worker is not None:
            self._worker.stop()
            self._worker = None
        while self._waiting:
            if (handle := self._waiting.popleft()) is not None:
                self._answered(handle, INTERRUPTED)

    def _servers(self) -> frozenset[bytes]:
        topic = f'{self._action}/_action/status'
        infos = self._node.get_publishers_info_by_topic(topic)
        return frozenset(bytes(info.endpoint_gid) for info in infos)

    def _on_goal(self, handle: Any) -> None:
        self._counts.received += 1
        self._server.counts.references.received += 1
        with self._ending(handle):
            if not handle.is_cancel_requested:
                handle.executing()
            plan = handle.request.trajectory
            count = len(plan.points)
            if count > 1 and is_slow(count > MOST_INLINE, self._settings):
                raw = serialize_message(plan)
                submit(self._worker, self._server, raw, count, self._settings)
                self._waiting.append(handle)
                return
            messages.filled(plan, self._server)
            self._interrupt()
            self._hand_on(handle)

    def _answered(self, handle: Any, planned: Planned) -> None:
        """Go on with a goal whose plan was filled beside the stream."""
        with self._ending(handle):
            raw = accept(planned, self._server)
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
        if self._client.server_is_ready():
            self._relay(handle)
        else:
            self._end(handle, goals.without_controller(self._action))

    def _interrupt(self) -> None:
        if self._worker is not None:
            self._worker.interrupt()

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
        _forget_plan(self.handle)
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
            # rclpy forgets it with a result only, which a goal that was rejected never has
            self._client._feedback_callbacks.pop(bytes(self.handle.goal_id.uuid), None)
            self._finish(self, outcome, result)


def _forget_plan(handle: Any) -> None:
    """Let go of what is large in a goal: rclpy keeps it for `KEPT_S` after its end."""
    handle.request.trajectory = JointTrajectory()
    handle.request.multi_dof_trajectory = MultiDOFJointTrajectory()


def _action_type() -> Any:
    try:
        from control_msgs.action import FollowJointTrajectory
    except ImportError:
        raise ConfigError(
            'controller_action needs the package control_msgs, which is not installed; install '
            'ros-jazzy-control-msgs or leave controller_action empty.'
        ) from None
    return FollowJointTrajectory
