"""What is collected of a topic: for each set of joints that come together, arrays that grow."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.recording.blocks import Block
from lip_id_ros.recording.mapping import columns_of, LARGEST, length_reason, name_reason, Reason
from lip_id_ros.recording.timing import LATEST_NS

_FIRST_ROWS = 1024
_MOST_PARTS = 64
_SMALLEST = np.finfo(np.float64).tiny


class Growing:
    """An array that takes rows at its end; larger by half when it is full, without a copy."""

    def __init__(self, width: int, kind: type, rows: int) -> None:
        self._array: NDArray[np.generic] = np.empty((rows, width), kind)
        self._size = 0

    def extend(self, rows: NDArray[np.generic]) -> None:
        """Append rows."""
        needed = self._size + len(rows)
        if needed > len(self._array):
            capacity = max(needed, 3 * len(self._array) // 2)
            # no view of it exists here
            self._array.resize((capacity, self._array.shape[1]), refcheck=False)
        self._array[self._size : needed] = rows
        self._size = needed

    def values(self) -> NDArray[np.generic]:
        """Return the rows, without a copy; nothing may be appended any more."""
        return self._array[: self._size]


class Part(NamedTuple):
    """
    The messages of one topic that have the same of the wanted joints, in the order of recording.

    Attributes
    ----------
    joints : tuple of str
    header_ns, receive_ns : ndarray of int, shape (N,)
        Both clocks [ns].
    position, velocity, effort : ndarray, shape (N, n)
        NaN where a message has none.

    """

    joints: tuple[str, ...]
    header_ns: IntArray
    receive_ns: IntArray
    position: Array
    velocity: Array
    effort: Array


class Collector:
    """
    Sorts blocks of messages into parts; what cannot be used is counted.

    Parameters
    ----------
    joints : sequence of str
        Joints to keep; empty for those of the first message that can be used.
    expected : int
        Room made at the beginning [messages]; more is made when needed.

    Attributes
    ----------
    joints : tuple of str
        Joints to keep.
    counts : Counter
        Messages dropped, by reason.
    seen : dict
        Joints of all messages, in the order of their first appearance.
    denormal : int
        How many values were so small that they are noise in memory; 0 was put in their place.

    """

    def __init__(self, joints: Sequence[str] = (), expected: int = _FIRST_ROWS) -> None:
        self.joints = tuple(joints)
        self.counts: Counter[str] = Counter()
        self.seen: dict[str, None] = {}
        self.denormal = 0
        self._expected = max(1, expected)
        self._arrays: dict[tuple[str, ...], list[Growing]] = {}

    def add(self, block: Block, receive_ns: IntArray) -> None:
        """Take the messages of a block, or drop and count them."""
        reason = name_reason(block.names) or length_reason(
            len(block.names), *(values.shape[1] for values in block[3:])
        )
        if reason is None:
            reason = self._take(block, receive_ns)
        if reason is not None:
            self.counts[reason] += block.rows.size

    def parts(self) -> list[Part]:
        """Return what was collected; nothing may be added any more."""
        return [
            Part(joints, *(array.values()[:, 0] for array in arrays[:2]),  # type: ignore[arg-type]
                 *(array.values() for array in arrays[2:]))
            for joints, arrays in self._arrays.items()
        ]  # fmt: skip

    def _take(self, block: Block, receive_ns: IntArray) -> Reason | None:
        if len(self.seen) < 64 * _MOST_PARTS:
            self.seen.update(dict.fromkeys(block.names))
        columns = columns_of(block.names, self.joints or block.names)
        if not columns.size:
            return Reason.FOREIGN_JOINTS
        present = tuple(block.names[column] for column in columns)
        values = [part[:, columns] for part in block[3:] if part.shape[1]]
        keep = self._usable(values)
        if not keep.any():
            return None
        self.joints = self.joints or block.names
        arrays = self._part(present)
        if arrays is None:
            self.counts[Reason.MISSING_JOINT] += int(keep.sum())
            return None
        nothing = np.full((block.rows.size, columns.size), np.nan)
        filled = iter(values)
        values = [next(filled) if part.shape[1] else nothing for part in block[3:]]
        stamps = (np.clip(clock, -1, LATEST_NS) for clock in (block.stamp_ns, receive_ns))
        for array, stamp in zip(arrays[:2], stamps, strict=True):
            array.extend(stamp[keep, np.newaxis])
        for array, part in zip(arrays[2:], values, strict=True):
            array.extend(part[keep])
        return None

    def _part(self, present: tuple[str, ...]) -> list[Growing] | None:
        if present not in self._arrays:
            if len(self._arrays) == _MOST_PARTS:
                return None
            rows = self._expected if present == self.joints else _FIRST_ROWS
            self._arrays[present] = [
                *(Growing(1, np.int64, rows) for _ in range(2)),
                *(Growing(len(present), np.float64, rows) for _ in range(3)),
            ]
        return self._arrays[present]

    def _usable(self, values: list[Array]) -> BoolArray:
        """Mark messages of sensible numbers, count the others, put 0 for denormal ones."""
        sizes = [np.abs(part) for part in values]
        finite = np.logical_and.reduce([np.isfinite(size).all(axis=1) for size in sizes])
        small = np.logical_and.reduce([(size <= LARGEST).all(axis=1) for size in sizes])
        self.counts[Reason.NOT_FINITE] += int((~finite).sum())
        self.counts[Reason.ABSURD] += int((finite & ~small).sum())
        for part, size in zip(values, sizes, strict=True):
            denormal = (size < _SMALLEST) & (part != 0.0)
            self.denormal += int(denormal.sum())
            part[denormal] = 0.0
        usable: BoolArray = finite & small
        return usable
