"""A motion as a goal of the controller's action FollowJointTrajectory."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
import time
from typing import Any

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
import numpy as np
import rclpy
from rclpy.action import ActionClient
from rclpy.task import Future

from lip_id_ros.errors import LipIdError
from lip_id_ros.excitation.trajectory_file import Trajectory
from lip_id_ros.nodes import messages
from lip_id_ros.nodes.goals import action_type
from lip_id_ros.nodes.node import NodeBase

LONGEST_ANSWER_S = 5.0
"""Controllers answer sooner."""

LAST_ANSWER_S = 3.0
"""A node that ends waits so long for the controller: `launch` kills it after 10 s."""

EARLY_S = 0.5
"""A motion that ends before its time by more has not been executed."""

LATE_S = 0.01
"""A joint state is heard within this time."""

Until = Callable[..., Awaitable[Any]]
"""Await something, for so long [s] at most, of somebody by name; HaltError where it is halted."""


class HaltError(LipIdError):
    """Why the motions do not go on."""


class MotionGoal:
    """
    Has a controller execute motions, one at a time.

    `doubt`: a warning for the status, where the controller may not have stopped a motion. It is
    empty where there is none; `on_doubt` is called when one arises.
    """

    doubt = ''

    def __init__(self, node: NodeBase, action: str, on_doubt: Callable[[], None]) -> None:
        self._node, self._on_doubt, self._kind = node, on_doubt, action_type()
        self._action = node.resolve_service_name(action)
        self._client = ActionClient(node, self._kind, self._action)
        self._handle: Any = None
        self._uncancelled_after = np.inf
        self._sent: Future | None = None
        self._sent_at, self._accepted_at, self._takes_s = 0.0, np.inf, 0.0

    def forget(self) -> None:
        """Forget what was in doubt: somebody has looked at the arm."""
        self.doubt, self._uncancelled_after = '', np.inf

    def missing(self) -> str | None:
        """Return why no motion can begin, or None."""
        if not self._client.server_is_ready():
            return f'no controller offers {self._action}; activate it'
        controllers = self._node.count_services(f'{self._action}/_action/send_goal')
        if controllers > 1:
            return (
                f'{controllers} controllers offer {self._action}, and each would execute the '
                'motion; end all but one'
            )
        return None

    def since_start(self) -> tuple[float, float]:
        """Return between which times after its start a joint state heard now is [s]."""
        # the controller has begun between the goal and its answer, and joint states are late
        now = self._now_s()
        return max(0.0, now - self._accepted_at - LATE_S), now - self._sent_at

    async def execute(self, planned: Trajectory, until: Until) -> None:
        """Have a motion executed to its end; HaltError where the controller ends it otherwise."""
        names, t, *states = planned
        goal = self._kind.Goal(trajectory=messages.plan_message(names, t, *states))
        self._sent_at, self._accepted_at = self._now_s(), np.inf
        self._takes_s = float(t[-1])
        self._sent = sent = self._client.send_goal_async(goal)
        try:
            handle = await until(sent, LONGEST_ANSWER_S, self._action)
        except HaltError:
            sent.add_done_callback(self._on_late_answer)
            raise
        self._sent = None
        if not handle.accepted:
            raise HaltError(f'the controller of {self._action} has rejected the motion')
        self._handle, self._accepted_at = handle, self._now_s()
        try:
            answer = await until(handle.get_result_async())
        finally:
            self._handle = None
        if answer.status != GoalStatus.STATUS_SUCCEEDED:
            why = answer.result.error_string or f'error code {answer.result.error_code}'
            raise HaltError(f'the controller has ended the motion: {why}')
        lacking = self._sent_at + self._takes_s - self._now_s()
        if lacking > EARLY_S:
            raise HaltError(
                f'the controller has said {lacking:.3g} s before its end that the motion is done; '
                'look whether the arm rests'
            )

    def halt(self) -> None:
        """Have the controller cancel the motion that runs, if one does."""
        if self._handle is not None:
            self._cancel(self._handle)

    def stop(self) -> None:
        """Wait for the answer to a motion that the controller may still begin, and cancel it."""
        sent = self._sent
        if sent is None:
            return
        rclpy.spin_until_future_complete(self._node, sent, timeout_sec=LAST_ANSWER_S)
        if self._sent is not None and sent.done():
            self._on_late_answer(sent)

    def watch(self, moving: bool) -> str | None:
        """Return why a motion must be halted, or None; called again and again."""
        if time.monotonic() > self._uncancelled_after:
            self._uncancelled_after = np.inf
            self._tell(f'has not said in {LONGEST_ANSWER_S:g} s whether it ends the motion')
        if moving and not self._client.server_is_ready():
            return f'the controller of {self._action} has ended'
        late = self._now_s() - self._accepted_at - self._takes_s
        if moving and late > LONGEST_ANSWER_S:
            return f'the controller has not ended the motion {late:.3g} s after its time'
        return None

    def _cancel(self, handle: Any) -> None:
        self._uncancelled_after = time.monotonic() + LONGEST_ANSWER_S
        handle.cancel_goal_async().add_done_callback(self._on_cancelled)

    def _on_cancelled(self, answer: Future) -> None:
        self._uncancelled_after = np.inf
        if answer.exception() is None:
            response = answer.result()  # rclpy's servers refuse without an error code
            ended = response.return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED
            if ended or response.goals_canceling:
                return
        self._tell('has refused to cancel the motion')

    def _on_late_answer(self, sent: Future) -> None:
        self._sent = None
        if sent.exception() is None and sent.result().accepted:
            self._cancel(sent.result())

    def _tell(self, why: str) -> None:
        self.doubt = f'; the controller of {self._action} {why}: stop the arm by other means'
        self._node.get_logger().error(self.doubt.removeprefix('; '))
        self._on_doubt()

    def _now_s(self) -> float:
        return 1e-9 * float(self._node.get_clock().now().nanoseconds)
