"""A joint_trajectory_controller: its action FollowJointTrajectory, and its state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import time
from typing import Any
from uuid import uuid4

from action_msgs.srv import CancelGoal
from control_msgs.action import FollowJointTrajectory
import numpy as np
import rclpy
from rclpy.action import ActionClient
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from lip_id_ros.nodes import qos
from lip_id_ros.nodes.node import NodeBase

ASK_AGAIN_S = 1.0
"""A cancel without an answer is asked for so often: where a link was down, requests are lost."""

LONGEST_ANSWER_S = 5.0
"""Controllers answer sooner."""


LAST_ANSWER_S, LOOK_S = 3.0, 0.02
"""A node that ends waits so long for controllers and looks so often; `launch` kills at 10 s."""


@dataclass
class _Cancel:
    goal_id: UUID
    done: Future
    since: float
    on_refused: Callable[[], None]
    asked_at: float = -np.inf
    call: Future | None = None
    is_refused: bool = False


class Controller:
    """
    The action of a controller. A cancel is sent again until the controller answers it.

    `action`: its name.
    """

    def __init__(self, node: NodeBase, action: str) -> None:
        self.action = node.resolve_service_name(action)
        self._node = node
        self._client = ActionClient(node, FollowJointTrajectory, self.action)
        self._connect()
        self._pending: dict[bytes, _Cancel] = {}
        self._unanswered: dict[bytes, float] = {}  # goals, and when they were sent
        self._unwanted: set[bytes] = set()  # of these, what was cancelled

    def _connect(self) -> None:
        """Create the client of cancels, whose endpoints the middleware finds anew."""
        name, self._connected_at = f'{self.action}/_action/cancel_goal', time.monotonic()
        self._cancels = self._node.create_client(CancelGoal, name, qos_profile=qos.CALLS)

    @property
    def is_offered(self) -> bool:
        """Whether somebody offers the action."""
        ready: bool = self._client.server_is_ready()
        return ready

    @property
    def n_offering(self) -> int:
        """How many offer the action."""
        count: int = self._node.count_services(f'{self.action}/_action/send_goal')
        return count

    def send(
        self, goal: Any, goal_id: UUID, on_feedback: Callable[[Any], None] | None = None
    ) -> Future:
        """Ask for the execution of a goal; done with its handle."""
        key = bytes(goal_id.uuid)
        self._unanswered[key] = time.monotonic()
        sent = self._client.send_goal_async(goal, on_feedback, goal_id)
        sent.add_done_callback(lambda answer: self._on_sent(goal_id, answer))
        return sent

    def _on_sent(self, goal_id: UUID, answer: Future) -> None:
        """Cancel a goal that the cancel has overtaken: they go by two topics."""
        key = bytes(goal_id.uuid)
        self._unanswered.pop(key, None)
        if key in self._unwanted:
            self._unwanted.remove(key)
            if key in self._pending:
                self._ask(self._pending[key])
            elif answer.result().accepted:
                self.cancel(goal_id)

    def cancel(self, goal_id: UUID, on_refused: Callable[[], None] = lambda: None) -> Future:
        """
        Ask to cancel a goal; done once it is cancelled or unknown, whenever that is.

        `on_refused` is called where the controller refuses, at the first time.
        """
        key = bytes(goal_id.uuid)
        if key in self._unanswered:
            self._unwanted.add(key)
        if key not in self._pending:
            self._pending[key] = _Cancel(goal_id, Future(), time.monotonic(), on_refused)
            self._ask(self._pending[key])
        return self._pending[key].done

    @property
    def is_settled(self) -> bool:
        """Whether all that shall be cancelled is cancelled."""
        return not self._pending

    def warnings(self) -> list[str]:
        """Describe a controller that may execute what it shall not."""
        if any(each.is_refused for each in self._pending.values()):
            return [self._warning('has refused to cancel a goal')]
        since = min((each.since for each in self._pending.values()), default=np.inf)
        waited = time.monotonic() - since
        if waited < LONGEST_ANSWER_S:
            return []
        return [self._warning(f'has not said for {waited:.0f} s whether it cancels a goal')]

    def _warning(self, what: str) -> str:
        return (
            f'the controller of {self.action} {what}, and is asked again and again: stop the arm '
            'by other means'
        )

    def watch(self) -> None:
        """Ask again where there was no answer."""
        now = time.monotonic()
        pending = list(self._pending.values())
        since = min((each.since for each in pending), default=np.inf)
        if now - max(since, self._connected_at) > LONGEST_ANSWER_S:
            # after a link was down, requests came but answers went nowhere (1 of 6 with Fast DDS)
            for each in pending:
                each.call = None
            self._node.destroy_client(self._cancels)
            self._connect()
        for each in pending:
            if now - each.asked_at > ASK_AGAIN_S:
                self._ask(each)

    def destroy(self) -> None:
        """Release what belongs to the node; log an error where a cancel has no answer."""
        if self._pending:
            self._node.get_logger().error(
                f'the controller of {self.action} may still execute a goal that it was asked to '
                'cancel: stop the arm by other means'
            )
        self._pending.clear()
        self._client.destroy()
        self._node.destroy_client(self._cancels)

    def _ask(self, each: _Cancel) -> None:
        each.asked_at = time.monotonic()
        if each.call is not None:
            self._cancels.remove_pending_request(each.call)
        request = CancelGoal.Request()
        request.goal_info.goal_id = each.goal_id
        each.call = call = self._cancels.call_async(request)
        call.add_done_callback(lambda _: self._on_answer(each, call))

    def _on_answer(self, each: _Cancel, call: Future) -> None:
        answer = None if call.exception() is not None else call.result()
        if answer is None or each.done.done():
            return
        if self._may_still_come(each, answer):
            return
        if _is_cancelled(answer):
            self._pending.pop(bytes(each.goal_id.uuid), None)
            each.done.set_result(None)
        elif not each.is_refused:
            each.is_refused = True
            each.on_refused()

    def _may_still_come(self, each: _Cancel, answer: CancelGoal.Response) -> bool:
        """Whether a goal is unknown as its cancel has overtaken it."""
        sent_at = self._unanswered.get(bytes(each.goal_id.uuid), -np.inf)
        unknown = answer.return_code == CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID
        return bool(unknown and time.monotonic() - sent_at < LONGEST_ANSWER_S)


def await_last_answers(node: NodeBase, are_there: Callable[[], bool]) -> None:
    """Spin a node that ends until the answers of controllers are there, or for `LAST_ANSWER_S`."""
    until = time.monotonic() + LAST_ANSWER_S
    while not are_there() and time.monotonic() < until:
        rclpy.spin_once(node, timeout_sec=LOOK_S)


def new_goal_id() -> UUID:
    """Return the identity of a new goal."""
    return UUID(uuid=list(uuid4().bytes))


def _is_cancelled(response: CancelGoal.Response) -> bool:
    """Whether a goal is not executed any more, or is being ended."""
    ended = response.return_code in (
        CancelGoal.Response.ERROR_GOAL_TERMINATED,
        CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID,  # of a controller that was restarted
    )
    return bool(ended or response.goals_canceling)  # rclpy's servers refuse without a code


class SpeedScaling:
    """
    The factor on the time of a plan in the states of a controller.

    Controllers before ros2_controllers 4.18 leave it at zero, which those that have it take for a
    pause: where the reference moves all the same, the factor is one.
    """

    def __init__(self) -> None:
        self.is_known = False
        self._before: Any = None

    def read(self, message: Any) -> float:
        """Return the factor of a JointTrajectoryControllerState."""
        speed = float(message.speed_scaling_factor)
        self.is_known = self.is_known or speed != 0.0
        if self.is_known:
            return speed
        positions = message.reference.positions
        moves = self._before is not None and self._before != positions
        self._before = positions
        return 1.0 if moves else speed
