"""
Goals of the action FollowJointTrajectory on their way through `serve`, without ROS.

A goal is refused by `serve`, or handed to the controller; then it ends as the controller ends it,
or as lost. It ends once, whatever arrives afterwards.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, StrEnum
import math
from typing import Any

from lip_id_ros.signals.joints import Refusal

LONGEST_SILENCE_S = 5.0
"""A controller accepts or refuses a goal sooner; after a discovery that was cut short, never."""

LONGEST_CANCEL_S = 5.0
"""
A goal that was cancelled ends sooner, or never: joint_trajectory_controller 4.42.1 forgets one
that is cancelled in the 50 ms after it was reached.
"""

LONGEST_STEP_S = 0.2
"""The watch looks more often, unless the node is held up."""

ASK_AGAIN_S = 2.0
"""A result that has not come so long after its goal ended was lost: ask the controller again."""


class ErrorCode(IntEnum):
    """As in the result of control_msgs/FollowJointTrajectory."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


class Ending(StrEnum):
    """How a goal ends: the key that it is counted under."""

    SUCCEEDED = 'succeeded'
    ABORTED = 'aborted'
    CANCELED = 'canceled'
    REFUSED = 'refused'


@dataclass(frozen=True)
class Outcome:
    """
    What the client of a goal gets.

    `refusal`: reason that a refused goal is counted under. It is aborted, since the action has no
    words for one that was never accepted.
    """

    ending: Ending
    code: int
    sentence: str
    refusal: str = ''


_OF_JOINTS = frozenset({
    *(Refusal.MISSING_JOINT, Refusal.FOREIGN_JOINT, Refusal.REPEATED_NAME),
    Refusal.TOO_MANY_NAMES,
})  # fmt: skip


def refused(reason: Refusal, sentence: str) -> Outcome:
    """Return the outcome of a plan that cannot be filled."""
    code = ErrorCode.INVALID_JOINTS if reason in _OF_JOINTS else ErrorCode.INVALID_GOAL
    return Outcome(Ending.REFUSED, code, f'serve: {sentence}', reason.value)


def lost(action: str, what: str) -> Outcome:
    """Return the outcome of a goal whose controller `what`, as in "has ended"."""
    sentence = (
        f'serve: the controller of {action} {what}; whether it still moves the arm is unknown. '
        'Stop the arm, look at the controller, then send another goal.'
    )
    return Outcome(Ending.ABORTED, ErrorCode.INVALID_GOAL, sentence)


def without_controller(action: str) -> Outcome:
    """Return the outcome of a goal that no controller takes."""
    sentence = (
        f'serve: no controller offers the action {action}; activate it, or correct the parameter '
        'controller_action.'
    )
    return Outcome(Ending.ABORTED, ErrorCode.INVALID_GOAL, sentence)


def rejected(action: str) -> Outcome:
    """Return the outcome of a goal that the controller has not accepted; it gives no reason."""
    sentence = (
        f'serve: the controller of {action} has rejected the plan, for the reason in its own log.'
    )
    return Outcome(Ending.ABORTED, ErrorCode.INVALID_GOAL, sentence)


def forgotten(action: str) -> Outcome:
    """Return the outcome of a goal that was cancelled, and that the controller has not ended."""
    sentence = (
        f'serve: the controller of {action} was asked to cancel the goal {LONGEST_CANCEL_S:g} s '
        'ago and has not ended it, as where the goal was just reached.'
    )
    return Outcome(Ending.CANCELED, ErrorCode.SUCCESSFUL, sentence)


def cancelled_early() -> Outcome:
    """Return the outcome of a goal that was cancelled while its efforts were computed."""
    sentence = 'serve: the goal was cancelled before the controller had it.'
    return Outcome(Ending.CANCELED, ErrorCode.SUCCESSFUL, sentence)


def released() -> Outcome:
    """Return the outcome of a goal that goes on while `serve` is disabled, deactivated or ends."""
    sentence = (
        'serve: the node was disabled, deactivated or ended, and has asked the controller to '
        'cancel the goal.'
    )
    return Outcome(Ending.ABORTED, ErrorCode.INVALID_GOAL, sentence)


def failed(error: Exception) -> Outcome:
    """Return the outcome of a goal at which an error of this node arose."""
    sentence = f'serve: failed with {type(error).__name__}: {error}; see its log.'
    return Outcome(Ending.ABORTED, ErrorCode.INVALID_GOAL, sentence)


class WatchedTime:
    """Seconds `now` that were watched: while the node stood still, answers waited in its queue."""

    def __init__(self) -> None:
        self.now = 0.0
        self._last = math.inf

    def advance(self, steady: float) -> None:
        """Let the time go on to that of a steady clock; of a pause little counts."""
        self.now += max(0.0, min(steady - self._last, LONGEST_STEP_S))
        self._last = steady


class Relayed:
    """
    A goal that was handed to the controller.

    Times `now` are in seconds on any steady clock. `accepted`: whether the controller has it.
    `cancelled`: whether the client wants it no more. `outcome`: how it ended, None before.
    """

    def __init__(self, now: float) -> None:
        self.accepted = self.cancelled = False
        self._cancelled_at = now
        self.outcome: Outcome | None = None
        self._sent_at = now
        self._over_at: float | None = None

    def accept(self, now: float) -> bool:
        """Note that the controller has it; return whether nobody wants it any more."""
        self.accepted, self._cancelled_at = True, now
        return self.cancelled or self.outcome is not None

    def cancel(self, now: float) -> bool:
        """Take the client's wish; return whether the controller can be asked already."""
        self.cancelled, self._cancelled_at = True, now
        return self.accepted and self.outcome is None

    def end(self, outcome: Outcome) -> bool:
        """End the goal; return whether it had not ended before."""
        if self.outcome is not None:
            return False
        self.outcome = outcome
        return True

    def is_silent(self, now: float) -> bool:
        """Whether the controller should have answered by now."""
        return not self.accepted and now - self._sent_at > LONGEST_SILENCE_S

    def is_forgotten(self, now: float) -> bool:
        """Whether the controller should have ended what it was asked to cancel."""
        asked = self.accepted and self.cancelled
        return asked and now - self._cancelled_at > LONGEST_CANCEL_S

    def lacks_result(self, over: bool, now: float) -> bool:
        """Whether to ask for the result again; `over`: the controller says that it has ended."""
        if not over:
            return False
        if self._over_at is None:
            self._over_at = now
        if now - self._over_at <= ASK_AGAIN_S:
            return False
        self._over_at = now
        return True


class GoalCounts:
    """Counts of goals: received is running, and every ending, refusals by their reasons."""

    def __init__(self) -> None:
        self.received = 0
        self.ended = Counter({ending.value: 0 for ending in Ending if ending != Ending.REFUSED})
        self.refused: Counter[str] = Counter()

    def end(self, outcome: Outcome) -> None:
        """Count a goal that has ended."""
        if outcome.ending is Ending.REFUSED:
            self.refused[outcome.refusal] += 1
        else:
            self.ended[outcome.ending.value] += 1

    def values(self) -> Mapping[str, Any]:
        """Return all counts, JSON-able."""
        running = self.received - self.ended.total() - self.refused.total()
        return {
            'received': self.received,
            'running': running,
            **self.ended,
            'refused': dict(self.refused),
        }
