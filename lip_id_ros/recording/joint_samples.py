"""Raw joint samples as recorded, and the reasons for which messages are dropped."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.recording.spill import gathered, marked

LARGEST = 1e9
"""No joint has a position, velocity or effort beyond this in any unit; it is noise in memory."""
MOST_JOINTS = 1000
"""No arm has more joints; what claims to is no joint message."""
SIGNALS = ('position', 'velocity', 'effort')


class Reason(StrEnum):
    """Why a message was dropped."""

    NO_NAMES = 'no joint names'
    TOO_MANY_NAMES = f'more than {MOST_JOINTS} joint names'
    REPEATED_NAME = 'joint name repeated'
    FOREIGN_JOINTS = 'only foreign joints'
    MISSING_JOINT = 'joint missing'
    OTHER_PUBLISHER = 'from another publisher of the same joints'
    NO_POSITION = 'position empty'
    POSITION_LENGTH = 'position not as long as names'
    VELOCITY_LENGTH = 'velocity not as long as names'
    EFFORT_LENGTH = 'effort not as long as names'
    NOT_FINITE = 'value not finite'
    ABSURD = 'value absurdly large'
    BAD_STAMP = 'stamp negative or not finite'
    ZERO_STAMP = 'stamp zero'
    BACKWARD_STAMP = 'stamp went back'
    FAR_STAMP = 'stamp far ahead'
    STRAY_STAMP = 'stamp far from its neighbours'
    REPEATED_STAMP = 'stamp repeated'
    BUFFER_FULL = 'buffer full'
    NO_VELOCITY = 'velocity empty where others have it'
    NO_EFFORT = 'effort empty where others have it'
    OTHER_JOINTS_AWAY = 'other joints not known at that time'
    UNREADABLE = 'message unreadable'
    LOST = 'in a damaged part of the file'


@dataclass(frozen=True, eq=False)
class JointSamples:
    """
    Samples of one recording in the order of time, N samples of n joints, nothing invented.

    Large arrays lie in temporary files (`lip_id_ros.recording.spill`).

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time since the first sample [s], strictly increasing.
    position, velocity, effort : ndarray, shape (N, n)
        As recorded [rad or m, rad/s or m/s, any unit]; velocity or effort is NaN throughout where
        the recording has none.
    joint_names : tuple of str
        Names of the n columns.
    start_s : float
        Stamp of the first sample [s].
    counts : mapping
        Messages that were dropped, by reason.
    source, topic : str
        Where the samples come from.
    seen_joints : tuple of str
        Joints of all messages, also of those dropped.
    clock : str
        Whether the times are those of the message headers or of reception.
    notes : tuple of str
        What else is to be known, a phrase each: damage of the files, what was put in order.

    """

    t: Array
    position: Array
    velocity: Array
    effort: Array
    joint_names: tuple[str, ...]
    start_s: float = 0.0
    counts: Mapping[str, int] = field(default_factory=dict)
    source: str = 'the recording'
    topic: str = ''
    seen_joints: tuple[str, ...] = ()
    clock: str = 'header'
    notes: tuple[str, ...] = ()

    @property
    def n_samples(self) -> int:
        """Number of samples N."""
        return int(self.t.size)

    @property
    def n_joints(self) -> int:
        """Number of joints n."""
        return len(self.joint_names)

    @cached_property
    def has_velocity(self) -> bool:
        """Whether velocities were recorded."""
        return not marked(_is_empty, self.velocity).any()

    @cached_property
    def has_effort(self) -> bool:
        """Whether efforts were recorded."""
        return not marked(_is_empty, self.effort).any()

    def rows(self, chosen: slice) -> JointSamples:
        """Return views of some samples."""
        return replace(
            self,
            t=self.t[chosen],
            position=self.position[chosen],
            velocity=self.velocity[chosen],
            effort=self.effort[chosen],
        )

    def select(self, keep: BoolArray) -> JointSamples:
        """Return some of the samples; all of them without a copy."""
        if keep.all():
            return self
        rows = np.flatnonzero(keep)
        values: dict[str, Any] = {
            name: gathered(getattr(self, name), rows) for name in ('t', *SIGNALS)
        }
        return replace(self, **values)


def _is_empty(values: Array) -> BoolArray:
    empty: BoolArray = np.isnan(values).any(axis=1)
    return empty


def counted(counts: Mapping[str, int]) -> dict[str, int]:
    """Return the reasons that came up, with their numbers."""
    return {str(reason): count for reason, count in counts.items() if count}


def complete(no_velocity: BoolArray, no_effort: BoolArray, counts: Counter[str]) -> BoolArray:
    """Mark messages that have velocity and effort, unless none has; count the others once."""
    keep = np.ones(no_velocity.size, bool)
    for absent, reason in ((no_velocity, Reason.NO_VELOCITY), (no_effort, Reason.NO_EFFORT)):
        if not absent.all():
            counts[reason] += int((keep & absent).sum())
            keep &= ~absent
    return keep


def name_reason(names: Sequence[str]) -> Reason | None:
    """Return what is wrong with the names of a message, whatever joints are wanted."""
    if not names:
        return Reason.NO_NAMES
    if len(names) > MOST_JOINTS:
        return Reason.TOO_MANY_NAMES
    return Reason.REPEATED_NAME if len(set(names)) != len(names) else None


def length_reason(names: int, position: int, velocity: int, effort: int) -> Reason | None:
    """Return what is wrong with the lengths of a message's arrays."""
    if position == names and velocity in (0, names) and effort in (0, names):
        return None
    if position == 0:
        return Reason.NO_POSITION
    if position != names:
        return Reason.POSITION_LENGTH
    return Reason.VELOCITY_LENGTH if velocity not in (0, names) else Reason.EFFORT_LENGTH


def columns_of(names: Sequence[str], joints: Sequence[str]) -> IndexArray:
    """Return where in a message the joints are that it has, in the order of `joints`."""
    place = {name: column for column, name in enumerate(names)}
    return np.array([place[joint] for joint in joints if joint in place], np.intp)
