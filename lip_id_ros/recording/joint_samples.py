"""Raw joint samples as recorded, reasons to drop messages, and copies of earlier samples."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.recording.spill import gathered, mapped, marked, release, row_blocks

Hashes = NDArray[np.uint64]

LARGEST = 1e9
"""No joint has a position, velocity or effort beyond this in any unit; it is noise in memory."""
MOST_JOINTS = 1000
"""No arm has more joints; what claims to is no joint message."""
SIGNALS = ('position', 'velocity', 'effort')

WINDOW = 20
"""Consecutive samples that two recordings share only where one repeats the other."""
MOVING = 5
"""Steps of a window at which something changes, at least: at rest, any recordings are alike."""


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

    `t`, shape (N,): time since the first sample [s], strictly increasing. `position`, `velocity`,
    `effort`, shape (N, n): as recorded [rad or m, rad/s or m/s, any unit]; velocity or effort is
    NaN throughout where the recording has none. Large arrays lie in temporary files (`spill`).
    `start_ns`: stamp of the first sample: in seconds of today it has steps of 238 ns. `counts`:
    messages that were dropped, by reason. `seen_joints`: joints of all messages, also of those
    dropped. `clock`: of the headers or of reception. `notes`: damage of the files, what was put in
    order, a phrase each.
    """

    t: Array
    position: Array
    velocity: Array
    effort: Array
    joint_names: tuple[str, ...]
    start_ns: int = 0
    counts: Mapping[str, int] = field(default_factory=dict)
    source: str = 'the recording'
    topic: str = ''
    seen_joints: tuple[str, ...] = ()
    clock: str = 'header'
    notes: tuple[str, ...] = ()

    @property
    def start_s(self) -> float:
        """Stamp of the first sample [s]."""
        return self.start_ns / 1_000_000_000

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

    def with_joints(self, joint_names: Sequence[str]) -> JointSamples:
        """Return the samples with these of their joints; without a copy where all are so."""
        if tuple(joint_names) == self.joint_names:
            return self
        columns = [self.joint_names.index(name) for name in joint_names]
        signals: dict[str, Any] = {name: getattr(self, name)[:, columns] for name in SIGNALS}
        return replace(self, joint_names=tuple(joint_names), **signals)

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


def stacked(*signals: Array) -> Array:
    """
    Return position, velocity and effort of N samples as one array, shape (N, 3, n).

    NaN for a signal without columns, and infinity for values that are not a number.
    """
    n_joints = max(signal.shape[1] for signal in signals)
    values = np.full((len(signals[0]), len(signals), n_joints), np.nan)
    for number, signal in enumerate(signals):
        if signal.shape[1]:
            values[:, number] = np.where(np.isnan(signal), np.inf, signal)
    return values


def usable(values: Array, counts: Counter[str]) -> BoolArray:
    """
    Mark samples of sensible numbers, given as by `stacked`; count the others.

    A velocity or effort that is finite for no joint becomes NaN, as one that was not recorded:
    ros2_control publishes such values for interfaces that the joints do not have.
    """
    values[:, 1:][np.isinf(values[:, 1:]).all(axis=2)] = np.nan
    largest = np.fmax.reduce(np.abs(values), axis=(1, 2))
    infinite = int(np.isinf(largest).sum())
    keep: BoolArray = largest <= LARGEST
    counts[Reason.NOT_FINITE] += infinite
    counts[Reason.ABSURD] += int((~keep).sum()) - infinite
    return keep


def complete(no_velocity: BoolArray, no_effort: BoolArray, counts: Counter[str]) -> BoolArray:
    """Mark messages that have velocity and effort, unless none has; count the others once."""
    keep = np.ones(no_velocity.size, bool)
    for absent, reason in ((no_velocity, Reason.NO_VELOCITY), (no_effort, Reason.NO_EFFORT)):
        if not absent.all():
            counts[reason] += int((keep & absent).sum())
            keep &= ~absent
    return keep


def not_finite(joints: Sequence[str], values: Array) -> list[str]:
    """Return the joints with values, as `usable` left them, that are not finite."""
    is_bad = np.isinf(values).any(axis=(0, 1))
    return [joint for joint, bad in zip(joints, is_bad, strict=True) if bad]


def not_finite_note(joints: Iterable[str]) -> str:
    """Return the note on joints with values that are not finite."""
    return f'some values of {", ".join(joints)} are not finite'


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


class RepeatedSamples:
    """
    Finds the samples of each recording that an earlier one has too, by their contents.

    A copy would be in the training data and in the held-out data. Names and start times prove
    little: files are renamed, and logs begin at zero.
    """

    def __init__(self) -> None:
        self._known: Hashes = np.zeros(0, dtype=np.uint64)

    def repeated(self, joint_names: Sequence[str], *signals: Array) -> BoolArray:
        """
        Return which samples (N,) belong to a window of an earlier recording.

        `signals`, shape (N, n), are compared bit by bit; the order of the joints is of no
        importance.
        """
        rows = mapped(lambda *some: row_hashes(joint_names, some), *signals)
        windows, usable = _windows(rows)
        found = usable & np.isin(windows, self._known)
        self._known = np.union1d(self._known, windows[usable])
        if not found.any():
            return np.zeros(len(signals[0]), dtype=bool)
        marks = np.zeros(len(signals[0]) + 1, dtype=np.int64)
        np.add.at(marks, np.flatnonzero(found), 1)
        np.add.at(marks, np.flatnonzero(found) + WINDOW, -1)
        return np.cumsum(marks[:-1]) > 0


def content_digest(joint_names: Sequence[str], *signals: Array) -> str:
    """Return a text that identifies the contents of a recording; see `RepeatedSamples`."""
    digest = hashlib.sha256()
    for block in row_blocks(len(signals[0])):
        digest.update(row_hashes(joint_names, [signal[block] for signal in signals]).tobytes())
        release(*signals)
    return digest.hexdigest()[:16]


def row_hashes(joint_names: Sequence[str], signals: Sequence[Array]) -> Hashes:
    """Return one hash per row, shape (N,): a sum of its bits' numbers with random weights."""
    order = np.argsort(np.array(joint_names, dtype=object))
    weights = _weights(len(signals) * len(order))
    total = np.zeros(len(signals[0]), dtype=np.uint64)
    columns = (signal[:, joint] for signal in signals for joint in order)
    for weight, column in zip(weights, columns, strict=True):
        bits = np.ascontiguousarray(column, dtype=np.float64).view(np.uint64)
        total += (bits ^ (bits >> np.uint64(29))) * weight
    return total ^ (total >> np.uint64(32))


def _windows(rows: Hashes) -> tuple[Hashes, BoolArray]:
    """Return a hash of every window, and whether enough changes in it, shape (N - W + 1,)."""
    count = max(0, len(rows) - WINDOW + 1)
    total = np.zeros(count, dtype=np.uint64)
    moving = np.zeros(count, dtype=np.int8)
    changes = np.diff(rows) != 0
    for offset, weight in enumerate(_weights(WINDOW)):
        total += rows[offset : offset + count] * weight
        if offset < WINDOW - 1:
            moving += changes[offset : offset + count]
    return total, moving >= MOVING


def _weights(count: int) -> Hashes:
    random = np.random.default_rng(0).integers(2**63, size=count, dtype=np.uint64)
    return 2 * random + np.uint64(1)
