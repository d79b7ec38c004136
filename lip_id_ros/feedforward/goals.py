"""
Goals of the action FollowJointTrajectory on their way through `serve`, without ROS.

A goal is refused by `serve`, or handed to the controller; then it ends as the controller ends it,
or as lost.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, StrEnum
from typing import Any


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


@dataclass(frozen=True)
class Outcome:
    """What the client of a goal gets."""

    ending: Ending
    code: int
    sentence: str


def lost(action: str, what: str) -> Outcome:
    """Return the outcome of a goal whose controller `what`, as in "is gone"."""
    sentence = (
        f'serve: the controller of {action} {what}; whether it still moves the arm is unknown. It '
        'is asked to cancel the goal until it answers. Stop the arm, look at the controller, then '
        'send another goal.'
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
        f'serve: the controller of {action} has accepted to cancel the goal and not ended it, as '
        'where the goal was just reached.'
    )
    return Outcome(Ending.CANCELED, ErrorCode.SUCCESSFUL, sentence)


def released() -> Outcome:
    """Return the outcome of a goal that goes on while `serve` is disabled, deactivated or ends."""
    sentence = (
        'serve: the node was disabled, deactivated or ended, and has asked the controller to '
        'cancel the goal.'
    )
    return Outcome(Ending.ABORTED, ErrorCode.INVALID_GOAL, sentence)


class GoalCounts:
    """Counts of goals: received is running, and every ending, refusals by their reasons."""

    def __init__(self) -> None:
        self.received = 0
        self.ended = Counter({ending.value: 0 for ending in Ending})
        self.refused: Counter[str] = Counter()

    def end(self, outcome: Outcome) -> None:
        """Count a goal that has ended."""
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
