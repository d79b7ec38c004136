"""A motion as a goal of the controller's action FollowJointTrajectory."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from typing import Any

from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
import numpy as np
from rcl_interfaces.srv import GetParameters
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from lip_id_ros.arrays import Array
from lip_id_ros.errors import LipIdError
from lip_id_ros.excitation.trajectory_file import Trajectory
from lip_id_ros.nodes import messages
from lip_id_ros.nodes.controller import (
    await_last_answers,
    Controller,
    LONGEST_ANSWER_S,
    new_goal_id,
)
from lip_id_ros.nodes.node import NodeBase

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
    the positions by joint that the controller was last asked to hold; `on_news` is called where
    they change.
    """

    def __init__(
        self,
        node: NodeBase,
        action: str,
        measured: Callable[[Sequence[str]], Array | None],
        on_news: Callable[[], None],
    ) -> None:
        self._node, self._measured, self._on_news = node, measured, on_news
        self._controller = Controller(node, action)
        self._action = self._controller.action
        name = self._action.rpartition('/')[0]
        self._parameters = node.create_client(GetParameters, f'{name}/get_parameters')
        self.held: dict[str, float] = {}
        self._names: tuple[str, ...] = ()
        self._order: Sequence[str] | None = None
        self._goal_id: UUID | None = None  # of the motion that runs
        self._holding: Future | None = None
        self._is_not_held = False
        self._sent_at, self._accepted_at, self._takes_s = 0.0, np.inf, 0.0

    @property
    def doubt(self) -> str:
        """A warning where the controller may not have stopped a motion, or empty."""
        found = self._controller.warnings()
        if self._is_not_held:
            found.append(
                f'the controller of {self._action} has refused to hold the arm where it was '
                'measured: stop the arm by other means'
            )
        return ''.join(f'; {each}' for each in found)

    def forget(self) -> None:
        """Forget what was in doubt: somebody has looked at the arm."""
        self._is_not_held, self.held = False, {}

    def missing(self) -> str | None:
        """Return why no motion can begin, or None."""
        if not self._controller.is_offered:
            return f'no controller offers {self._action}; activate it'
        if not self._controller.is_settled:
            return f'the controller of {self._action} has not cancelled a motion before'
        if (controllers := self._controller.n_offering) > 1:
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
        goal = FollowJointTrajectory.Goal(
            trajectory=messages.plan_message(self._names, t, *states)
        )
        self._sent_at, self._accepted_at = self._now_s(), np.inf
        self._takes_s, self._goal_id = float(t[-1]), new_goal_id()
        sent = self._controller.send(goal, self._goal_id)
        handle = await until(sent, LONGEST_ANSWER_S, self._action)
        if not handle.accepted:
            self._goal_id = None
            raise HaltError(f'the controller of {self._action} has rejected the motion')
        self._accepted_at = self._now_s()
        answer = await until(handle.get_result_async())
        self._goal_id = None
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
        if self._goal_id is not None:
            done = self._controller.cancel(self._goal_id, on_refused=self._hold)
            done.add_done_callback(lambda _: self._hold())
            self._goal_id = None

    def stop(self) -> None:
        """Wait until the controller has cancelled a motion, and holds the arm."""

        def are_there() -> bool:
            is_held = self._holding is None or self._holding.done()
            return is_held and self._controller.is_settled

        await_last_answers(self._node, are_there)
        self._controller.destroy()

    def watch(self, moving: bool) -> str | None:
        """Return why a motion must be halted, or None; called again and again."""
        self._controller.watch()
        if moving and not self._controller.is_offered:
            return f'the controller of {self._action} is gone'
        late = self._now_s() - self._accepted_at - self._takes_s
        if moving and late > LONGEST_ANSWER_S:
            return f'the controller has not ended the motion {late:.3g} s after its time'
        return None

    def _hold(self) -> None:
        """Have the arm hold where it was measured: its last reference may be far from that."""
        position = self._measured(self._names)
        if position is None or not np.isfinite(position).all():
            return  # the controller holds the arm as its settings have it
        still = np.zeros((1, len(self._names)))
        plan = messages.plan_message(self._names, np.array([HOLD_S]), position[None], still, still)
        goal = FollowJointTrajectory.Goal(trajectory=plan)
        self._holding = self._controller.send(goal, new_goal_id())
        self._holding.add_done_callback(self._on_held)
        self.held = dict(zip(self._names, position.tolist(), strict=True))
        self._on_news()

    def _on_held(self, answer: Future) -> None:
        if answer.exception() is not None or not answer.result().accepted:
            self.held, self._is_not_held = {}, True
            self._node.get_logger().error(self.doubt.removeprefix('; '))
            self._on_news()

    def _now_s(self) -> float:
        return 1e-9 * float(self._node.get_clock().now().nanoseconds)
