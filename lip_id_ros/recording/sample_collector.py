"""Collect the usable messages of a topic, by the set of joints that come together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording.decoding import MessageBlock
from lip_id_ros.recording.joint_samples import (
    columns_of,
    LARGEST,
    length_reason,
    name_reason,
    Reason,
)
from lip_id_ros.recording.spill import RowStore
from lip_id_ros.recording.timing import LATEST_NS

HEADER, RECEIVE, PUBLISHER = range(3)
"""Columns of `Part.numbers`."""

_MOST_PARTS = 64
_MOST_SEEN = 4096
_MOST_PUBLISHERS = 16
_SMALLEST = np.finfo(np.float64).tiny

Publisher = tuple[frozenset[str], str]
"""Joints and frame of its messages."""


class Part(NamedTuple):
    """
    The messages of one topic that have the same of the wanted joints, in the order of the file.

    Attributes
    ----------
    joints : tuple of str, n of them
    publishers : tuple
        Joints and frame of each number; one where there are too many to be publishers.
    numbers : ndarray of int, shape (N, 3)
        Stamp of the header and time of reception [ns], and number of the publisher: messages with
        other joints beside these, or another frame, are of another publisher.
    values : ndarray, shape (N, 3, n)
        Position, velocity and effort; NaN where a message has none.

    """

    joints: tuple[str, ...]
    publishers: tuple[Publisher, ...]
    numbers: IntArray
    values: Array


class _GrowingPart:
    """A part that takes messages at its end."""

    def __init__(self, joints: tuple[str, ...]) -> None:
        self._joints = joints
        self._numbers = RowStore(3, dtype=np.int64)
        self._values = RowStore(3, len(joints))
        self._publishers: dict[Publisher, int] = {}

    def number_of(self, publisher: Publisher) -> int:
        """Return the number of a publisher; 0 for a new one where there are too many."""
        if len(self._publishers) > _MOST_PUBLISHERS:
            return self._publishers.get(publisher, 0)
        return self._publishers.setdefault(publisher, len(self._publishers))

    def extend(self, pieces: Sequence[tuple[IndexArray, IntArray, Array]]) -> None:
        """Append messages (rows in the file, numbers, values) in the order of the file."""
        rows, numbers, values = (np.concatenate(each) for each in zip(*pieces, strict=True))
        order = np.argsort(rows)
        self._numbers.extend(numbers[order])
        self._values.extend(values[order])

    def part(self) -> Part:
        """Return what was appended; nothing may be appended any more."""
        too_many = len(self._publishers) > _MOST_PUBLISHERS
        publishers = tuple(self._publishers)[: 1 if too_many else None]
        return Part(self._joints, publishers, self._numbers.values(), self._values.values())


class SampleCollector:
    """
    Sorts joint messages into parts; what cannot be used is counted.

    Attributes
    ----------
    joints : tuple of str
        Joints to keep; those of the first message that can be used, where none are given.
    counts : Counter
        Messages dropped, by reason.
    seen : dict
        Joints of all messages, in the order of their first appearance.
    notes : dict
        What else is to be known, a phrase each; the values mean nothing.

    """

    def __init__(self, joints: Sequence[str] = (), source: str = '', topic: str = '') -> None:
        self.joints = tuple(joints)
        self.source, self.topic = source, topic
        self.counts: Counter[str] = Counter()
        self.seen: dict[str, None] = {}
        self.notes: dict[str, None] = {}
        self._denormal = 0
        self._parts: dict[tuple[str, ...], _GrowingPart] = {}

    def add(self, blocks: Sequence[MessageBlock], receive_ns: IntArray) -> None:
        """
        Take messages that follow those before in the file, or drop and count them.

        Each is in one of the blocks at most; `receive_ns`, shape (N,), is of all [ns].

        """
        taken: dict[tuple[str, ...], list[Any]] = {}
        for block in sorted(blocks, key=lambda each: int(each.rows[0])):
            reason = name_reason(block.names) or length_reason(
                len(block.names), *(values.shape[1] for values in block.values)
            )
            reason = reason or self._take(block, receive_ns[block.rows], taken)
            if reason is not None:
                self.counts[reason] += block.rows.size
        for joints, pieces in taken.items():
            self._parts[joints].extend(pieces)

    @property
    def collected_joints(self) -> set[str]:
        """Those of the joints to keep that came."""
        return {joint for joints in self._parts for joint in joints}

    def parts(self) -> list[Part]:
        """Return what was collected; nothing may be added any more."""
        if self._denormal:
            self.notes[
                f'{self._denormal} denormal values (memory never filled in) were read as 0'
            ] = None
        return [growing.part() for growing in self._parts.values()]

    def _take(
        self, block: MessageBlock, receive_ns: IntArray, taken: dict[tuple[str, ...], list[Any]]
    ) -> Reason | None:
        if len(self.seen) < _MOST_SEEN:
            self.seen.update(dict.fromkeys(block.names))
        columns = columns_of(block.names, self.joints or block.names)
        if not columns.size:
            return Reason.FOREIGN_JOINTS
        present = tuple(block.names[column] for column in columns)
        values = [part[:, columns] for part in block.values if part.shape[1]]
        keep = usable(values, self.counts)
        self._denormal += _cleared(values)
        if not keep.any():
            return None
        self.joints = self.joints or block.names
        if present not in self._parts and len(self._parts) == _MOST_PARTS:
            self.counts[Reason.MISSING_JOINT] += int(keep.sum())
            return None
        growing = self._parts.setdefault(present, _GrowingPart(present))
        publisher = growing.number_of((frozenset(block.names), block.frame_id))
        numbers = np.empty((block.rows.size, 3), np.int64)
        numbers[:, HEADER] = np.clip(block.stamp_ns, -1, LATEST_NS)
        numbers[:, RECEIVE] = np.clip(receive_ns, -1, LATEST_NS)
        numbers[:, PUBLISHER] = publisher
        found = np.full((block.rows.size, 3, columns.size), np.nan)
        filled = [k for k, part in enumerate(block.values) if part.shape[1]]
        found[:, filled] = np.stack(values, axis=1)
        taken.setdefault(present, []).append((block.rows[keep], numbers[keep], found[keep]))
        return None


def usable(values: Sequence[Array], counts: Counter[str]) -> BoolArray:
    """Mark messages of sensible numbers in all arrays of shape (N, n), count the others."""
    finite = np.logical_and.reduce([np.isfinite(part).all(axis=1) for part in values])
    small = np.logical_and.reduce([(np.abs(part) <= LARGEST).all(axis=1) for part in values])
    counts[Reason.NOT_FINITE] += int((~finite).sum())
    counts[Reason.ABSURD] += int((finite & ~small).sum())
    keep: BoolArray = finite & small
    return keep


def _cleared(values: Sequence[Array]) -> int:
    """Put 0 for denormal values; return how many there were."""
    cleared = 0
    for part in values:
        denormal = (np.abs(part) < _SMALLEST) & (part != 0.0)
        cleared += int(denormal.sum())
        part[denormal] = 0.0
    return cleared
