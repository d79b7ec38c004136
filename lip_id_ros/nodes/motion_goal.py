"""A motion as a goal of the controller's action FollowJointTrajectory."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
import time
from typing import Any

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
import numpy as np
from rcl_interfaces.srv import GetParameters
import rclpy
from rclpy.action import ActionClient
from rclpy.task import Future

from lip_id_ros.arrays import Array
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

HOLD_S = 0.5
"""From where a motion was ended to rest at the measured position."""

Until = Callable[..., Awaitable[Any]]
"""Await something, for so long [s] at most, of somebody by name; HaltError where it is halted."""


class HaltError(LipIdError):
    """Why the motions do not go on."""


class MotionGoal:
    """
    Has a controller execute motions, one at a time, and hold the arm where one has ended early.

    `measured` returns where joints are, shape (n,), or None where that is not known now. `held`:
    positions by name that the arm was last told to hold. `doubt`: a warning for the status, where
    the controller may not have stopped a motion. It is empty where there is none; `on_news` is
    called where either changes.
    """

    doubt = ''

    def __init__(
        self,
        node: NodeBase,
        action: str,
        measured: Callable[[Sequence[str]], Array | None],
        on_news: Callable[[], None],
    ) -> None:
        self._node, self._measured, self._on_news = node, measured, on_news
        self._kind = action_type()
        self._action = node.resolve_service_name(action)
        self._client = ActionClient(node, self._kind, self._action)
        controller = self._action.rpartition('/')[0]
        self._parameters = node.create_client(GetParameters, f'{controller}/get_parameters')
        self.held: dict[str, float] = {}
        self._names: tuple[str, ...] = ()
        self._order: Sequence[str] | None = None
        self._handle: Any = None
        self._uncancelled_after = np.inf
        self._sent: Future | None = None
        self._ending: Future | None = None
        self._sent_at, self._accepted_at, self._takes_s = 0.0, np.inf, 0.0

    def forget(self) -> None:
        """Forget what was in doubt: somebody has looked at the arm."""
        self.doubt, self._uncancelled_after, self.held = '', np.inf, {}

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

    async def require_joints(self, names: Sequence[str], until: Until) -> str:
        """
        Return a warning where the controller does not say which joints it moves, or nothing.

        HaltError where it moves others than those of the motion.
        """
        self._order = theirs = await self._joints(until)
        if theirs is None:
            return f'Nobody knows which joints the controller of {self._action} moves.'
        if sorted(theirs) != sorted(names):
            raise HaltError(
                f'the controller of {self._action} moves {", ".join(theirs)}, but the motion '
                f'{", ".join(names)}; name its joints in motion.joints, or another controller'
            )
        return ''

    async def _joints(self, until: Until) -> list[str] | None:
        """Return the joints of the controller by its parameter, as ros2_control has it."""
        if not self._parameters.service_is_ready():
            return None
        request = GetParameters.Request(names=['joints'])
        answer = await until(
            self._parameters.call_async(request), LONGEST_ANSWER_S, self._parameters.srv_name
        )
        return [name for each in answer.values for name in each.string_array_value] or None

    def since_start(self) -> tuple[float, float]:
        """Return between which times after its start a joint state heard now is [s]."""
        # the controller has begun between the goal and its answer, and joint states are late
        now = self._now_s()
        return max(0.0, now - self._accepted_at - LATE_S), now - self._sent_at

    async def execute(self, planned: Trajectory, until: Until) -> None:
        """Have a motion executed to its end; HaltError where the controller ends it otherwise."""
        # a controller may take no notice of names
        self._names, t, *states = planned.in_order(self._order or planned.joint_names)
        goal = self._kind.Goal(trajectory=messages.plan_message(self._names, t, *states))
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
        if (reason := self._ended_otherwise(answer)) is not None:
            self._hold()
            raise HaltError(reason)

    def _ended_otherwise(self, answer: Any) -> str | None:
        """Return how the controller has ended the motion, if not at its end and in time."""
        if answer.status != GoalStatus.STATUS_SUCCEEDED:
            why = answer.result.error_string or f'error code {answer.result.error_code}'
            return f'the controller has ended the motion: {why}'
        lacking = self._sent_at + self._takes_s - self._now_s()
        if lacking > EARLY_S:
            return (
                f'the controller has said {lacking:.3g} s before its end that the motion is done; '
                'look whether the arm rests'
            )
        return None

    def halt(self) -> None:
        """Have the controller cancel the motion that runs, and hold the arm where it is then."""
        if self._handle is not None:
            self._cancel(self._handle)

    def stop(self) -> None:
        """Wait until the controller has heard that it shall cancel a motion, and hold the arm."""
        until = time.monotonic() + LAST_ANSWER_S
        sent = self._sent
        if sent is not None:  # the controller may still begin it
            rclpy.spin_until_future_complete(self._node, sent, timeout_sec=LAST_ANSWER_S)
            if self._sent is not None and sent.done():
                self._on_late_answer(sent)
        if self._ending is not None:
            left = max(0.0, until - time.monotonic())
            rclpy.spin_until_future_complete(self._node, self._ending, timeout_sec=left)

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
        self._ending = Future(executor=self._node.executor)
        handle.cancel_goal_async().add_done_callback(self._on_cancelled)

    def _on_cancelled(self, answer: Future) -> None:
        self._uncancelled_after = np.inf
        if answer.exception() is not None or not _is_cancelled(answer.result()):
            self._tell('has refused to cancel the motion')
        self._hold()

    def _hold(self) -> None:
        """Have the arm hold where it was measured: its last reference may be far from that."""
        position = self._measured(self._names)
        if position is None:  # the controller holds the arm as its settings have it
            self._has_ended()
            return
        still = np.zeros((1, len(self._names)))
        plan = messages.plan_message(self._names, np.array([HOLD_S]), position[None], still, still)
        sent = self._client.send_goal_async(self._kind.Goal(trajectory=plan))
        sent.add_done_callback(self._on_held)
        self.held = dict(zip(self._names, position.tolist(), strict=True))
        self._on_news()

    def _on_held(self, answer: Future) -> None:
        if answer.exception() is not None or not answer.result().accepted:
            self.held = {}
            self._tell('has refused to hold the arm where it was measured')
        self._has_ended()

    def _has_ended(self) -> None:
        if self._ending is not None and not self._ending.done():
            self._ending.set_result(None)

    def _on_late_answer(self, sent: Future) -> None:
        self._sent = None
        if sent.exception() is None and sent.result().accepted:
            self._cancel(sent.result())

    def _tell(self, why: str) -> None:
        sentence = f'the controller of {self._action} {why}: stop the arm by other means'
        self.doubt += f'; {sentence}'
        self._node.get_logger().error(sentence)
        self._on_news()

    def _now_s(self) -> float:
        return 1e-9 * float(self._node.get_clock().now().nanoseconds)


def _is_cancelled(response: Any) -> bool:
    # rclpy's servers refuse without an error code
    ended = response.return_code == CancelGoal.Response.ERROR_GOAL_TERMINATED
    return bool(ended or response.goals_canceling)
