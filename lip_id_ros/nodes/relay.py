"""A goal of `serve` that its controller executes."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.task import Future

from lip_id_ros.feedforward import goals
from lip_id_ros.feedforward.goals import Ending, Outcome
from lip_id_ros.nodes.controller import Controller, LONGEST_ANSWER_S

ENDINGS = {
    GoalStatus.STATUS_SUCCEEDED: Ending.SUCCEEDED,
    GoalStatus.STATUS_CANCELED: Ending.CANCELED,
    GoalStatus.STATUS_ABORTED: Ending.ABORTED,
}

LONGEST_WATCH_STEP_S = 0.2
"""The watch looks more often, unless the node is held up."""

ASK_AGAIN_S = 2.0
"""A result that has not come so long after its goal ended was lost: ask the controller again."""


class WatchedTime:
    """Seconds `now` that were watched: while the node stood still, answers waited in its queue."""

    def __init__(self) -> None:
        self.now = 0.0
        self._last = math.inf

    def advance(self, steady: float) -> None:
        """Let the time go on to that of a steady clock; of a pause little counts."""
        self.now += max(0.0, min(steady - self._last, LONGEST_WATCH_STEP_S))
        self._last = steady


class Relay:
    """
    One goal at the controller: `handle` is the client's, `finish` takes its end.

    `speed`: the factor on the time of plans that its efforts are for.

    It ends once. Where the controller is lost or silent, the client hears of that, and the
    controller is asked to cancel the goal until it answers.
    """

    def __init__(
        self,
        controller: Controller,
        time: WatchedTime,
        handle: Any,
        speed: float,
        finish: Callable[[Relay, Outcome, Any], None],
    ) -> None:
        self.handle, self.speed = handle, speed
        self._controller, self._time, self._finish = controller, time, finish
        self._theirs: Any = None
        self._sent_at, self._cancelled_at, self._over_at = time.now, math.inf, math.inf
        self._has_ended = False

    def send(self) -> None:
        """Hand the goal to the controller."""
        asked = self._controller.send(self.handle.request, self.handle.goal_id, self._on_feedback)
        asked.add_done_callback(self._on_answer)

    def cancel(self) -> None:
        """Have the controller cancel the goal."""
        self._controller.cancel(self.handle.goal_id).add_done_callback(self._on_cancelled)

    def release(self) -> None:
        """End the goal here, and have the controller cancel it."""
        self._give_up(goals.released())

    def watch(self) -> None:
        """End the goal where the controller is lost or silent; ask again for a lost result."""
        controller, now = self._controller, self._time.now
        if not controller.is_offered:
            self._give_up(goals.lost(controller.action, 'is gone'))
        elif self._theirs is None:
            if now - self._sent_at > LONGEST_ANSWER_S:
                self._give_up(goals.lost(controller.action, 'has not answered'))
        elif now - self._cancelled_at > LONGEST_ANSWER_S:
            self._end(goals.forgotten(controller.action))
        elif self._theirs.status in ENDINGS:
            self._over_at = min(self._over_at, now)
            if now - self._over_at > ASK_AGAIN_S:
                self._over_at = now
                self._ask_for_result()

    def _give_up(self, outcome: Outcome) -> None:
        self._end(outcome)
        self.cancel()

    def _on_feedback(self, message: Any) -> None:
        if not self._has_ended:
            self.handle.publish_feedback(message.feedback)

    def _on_answer(self, asked: Future) -> None:
        theirs = asked.result()
        if not theirs.accepted:
            self._end(goals.rejected(self._controller.action))
        elif not self._has_ended:
            self._theirs = theirs
            self._ask_for_result()

    def _on_cancelled(self, answered: Future) -> None:
        if self._has_ended:
            return
        self._cancelled_at = self._time.now

    def _ask_for_result(self) -> None:
        self._theirs.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, answered: Future) -> None:
        status, result = answered.result().status, answered.result().result
        if status in ENDINGS:
            self._end(Outcome(ENDINGS[status], result.error_code, result.error_string), result)
        else:  # another controller of this name has never had the goal
            self._end(goals.lost(self._controller.action, 'has forgotten the goal'))

    def _end(self, outcome: Outcome, result: Any = None) -> None:
        if not self._has_ended:
            self._has_ended = True
            self._finish(self, outcome, result)
