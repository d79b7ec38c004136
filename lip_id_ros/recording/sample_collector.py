"""What is collected of a topic: for each set of joints that come together, arrays that grow."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording.decoding import MessageBlock
from lip_id_ros.recording.joint_samples import (
    columns_of,
    LARGEST,
    length_reason,
    name_reason,
    Reason,
)
from lip_id_ros.recording.spill import grown, RowStore
from lip_id_ros.recording.timing import LATEST_NS

_FIRST_ROWS = 1024
_MOST_PARTS = 64
_MOST_PUBLISHERS = 16
_SMALLEST = np.finfo(np.float64).tiny

Publisher = tuple[frozenset[str], str]


class Part(NamedTuple):
    """
    The messages of one topic that have the same of the wanted joints, in the order of the file.

    Attributes
    ----------
    joints : tuple of str
    header_ns, receive_ns : ndarray of int, shape (N,)
        Both clocks [ns].
    publisher : ndarray of int, shape (N,)
        Messages with other joints beside these, or another frame, have another number; 0 for all
        where there are too many to be publishers.
    publishers : tuple
        Joints and frame of each number.
    position, velocity, effort : ndarray, shape (N, n)
        NaN where a message has none.

    """

    joints: tuple[str, ...]
    header_ns: IntArray
    receive_ns: IntArray
    publisher: NDArray[np.int8]
    publishers: tuple[Publisher, ...]
    position: Array
    velocity: Array
    effort: Array


class _Growing:
    """A part that takes messages at its end."""

    def __init__(self, joints: tuple[str, ...]) -> None:
        self._joints = joints
        self._size = 0
        self._clocks = [np.empty(_FIRST_ROWS, np.int64) for _ in range(2)]
        self._publisher = np.empty(_FIRST_ROWS, np.int8)
        self._stores = [RowStore(len(joints)) for _ in range(3)]
        self._publishers: dict[Publisher, int] = {}

    def number_of(self, publisher: Publisher) -> int:
        """Return the number of a publisher; of publishers that are too many, any."""
        if len(self._publishers) > _MOST_PUBLISHERS:
            return self._publishers.get(publisher, 0)
        return self._publishers.setdefault(publisher, len(self._publishers))

    def extend(self, messages: _Messages) -> None:
        """Append messages."""
        needed = self._size + messages.rows.size
        if needed > len(self._publisher):
            self._clocks = [grown(clock, needed) for clock in self._clocks]
            self._publisher = grown(self._publisher, needed)
        for clock, stamps in zip(self._clocks, messages.clocks, strict=True):
            clock[self._size : needed] = stamps
        self._publisher[self._size : needed] = messages.publisher
        self._size = needed
        for store, values in zip(self._stores, messages.values, strict=True):
            store.extend(values)

    def part(self) -> Part:
        """Return what was appended; nothing may be appended any more."""
        known = len(self._publishers) <= _MOST_PUBLISHERS
        publisher = self._publisher[: self._size]
        header_ns, receive_ns = (clock[: self._size] for clock in self._clocks)
        position, velocity, effort = (store.values() for store in self._stores)
        return Part(
            self._joints,
            header_ns,
            receive_ns,
            publisher if known else np.zeros_like(publisher),
            tuple(self._publishers)[: None if known else 1],
            position,
            velocity,
            effort,
        )


class _Messages(NamedTuple):
    """Usable messages of a batch, all of the same joints."""

    rows: IndexArray
    clocks: Sequence[IntArray]
    publisher: NDArray[np.int8]
    values: Sequence[Array]

    def in_order(self) -> _Messages:
        """Return them in the order of the file: several forms lie between each other."""
        order = np.argsort(self.rows)
        return _Messages(
            self.rows[order],
            [clock[order] for clock in self.clocks],
            self.publisher[order],
            [values[order] for values in self.values],
        )


class SampleCollector:
    """
    Sorts joint messages into parts; what cannot be used is counted.

    Parameters
    ----------
    joints : sequence of str
        Joints to keep; empty for those of the first message that can be used.
    source, topic : str
        Where the messages come from.

    Attributes
    ----------
    joints : tuple of str
        Joints to keep.
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
        self._parts: dict[tuple[str, ...], _Growing] = {}

    def add(self, blocks: Sequence[MessageBlock], receive_ns: IntArray) -> None:
        """
        Take messages that follow those before in the file, or drop and count them.

        Parameters
        ----------
        blocks : sequence of MessageBlock
            Each message in one of them at most.
        receive_ns : ndarray of int, shape (N,)
            Of all messages, also of those that are in no block [ns].

        """
        taken: dict[tuple[str, ...], list[_Messages]] = {}
        for block in sorted(blocks, key=lambda each: int(each.rows[0])):
            reason = name_reason(block.names) or length_reason(
                len(block.names), *(values.shape[1] for values in block.values)
            )
            reason = reason or self._take(block, receive_ns[block.rows], taken)
            if reason is not None:
                self.counts[reason] += block.rows.size
        for joints, pieces in taken.items():
            messages = pieces[0] if len(pieces) == 1 else _joined(pieces).in_order()
            self._parts[joints].extend(messages)

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
        self,
        block: MessageBlock,
        receive_ns: IntArray,
        taken: dict[tuple[str, ...], list[_Messages]],
    ) -> Reason | None:
        if len(self.seen) < 64 * _MOST_PARTS:
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
        growing = self._parts.setdefault(present, _Growing(present))
        publisher = growing.number_of((frozenset(block.names), block.frame_id))
        nothing = np.full((block.rows.size, columns.size), np.nan)
        filled = iter(values)
        columns_of_all = [next(filled) if part.shape[1] else nothing for part in block.values]
        clocks = [np.clip(each, -1, LATEST_NS) for each in (block.stamp_ns, receive_ns)]
        taken.setdefault(present, []).append(
            _Messages(
                block.rows[keep],
                [clock[keep] for clock in clocks],
                np.full(int(keep.sum()), publisher, np.int8),
                [column[keep] for column in columns_of_all],
            )
        )
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


def _joined(pieces: Sequence[_Messages]) -> _Messages:
    return _Messages(
        np.concatenate([piece.rows for piece in pieces]),
        [np.concatenate([piece.clocks[k] for piece in pieces]) for k in range(2)],
        np.concatenate([piece.publisher for piece in pieces]),
        [np.concatenate([piece.values[k] for piece in pieces]) for k in range(3)],
    )
