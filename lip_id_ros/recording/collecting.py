"""Collect the usable messages of topics in arrays that grow, on disk once they are large."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import tempfile
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from lip_id_ros.arrays import BoolArray, IndexArray
from lip_id_ros.recording import spill
from lip_id_ros.recording.joint_messages import MessageBlock, PUBLISHER, Publisher
from lip_id_ros.recording.joint_samples import (
    columns_of,
    not_finite,
    not_finite_note,
    Reason,
    usable,
)
from lip_id_ros.recording.timing import LATEST_NS

_MOST_BLOCKS = 64
_MOST_SEEN = 4096
_MOST_PUBLISHERS = 16
_FIRST_ROWS = 1024
_SMALLEST = np.finfo(np.float64).tiny

Piece = tuple[IndexArray, MessageBlock]
"""Messages, and their numbers among those that were read with them."""

_Key = tuple[tuple[str, ...], bool]
"""Joints of a block, and whether it has positions."""


class SampleCollector:
    """
    Collects the usable messages of a topic by the joints that come together; counts the others.

    `joints`: to keep; those of the first positions that can be used, where none are given. `seen`:
    joints of all messages. `notes`: what else is to be known, a phrase each, as keys.
    """

    def __init__(self, joints: Sequence[str] = (), source: str = '', topic: str = '') -> None:
        self.joints = tuple(joints)
        self.source, self.topic = source, topic
        self.counts: Counter[str] = Counter()
        self.seen: dict[str, None] = {}
        self.notes: dict[str, None] = {}
        self._denormal = 0
        self._not_finite: dict[str, None] = {}
        self._growing: dict[_Key, _GrowingBlock] = {}

    def add(self, pieces: Sequence[Piece]) -> None:
        """Take messages that follow those before in the file, or drop and count them."""
        taken: dict[_Key, list[Piece]] = {}
        for rows, block in sorted(pieces, key=lambda piece: int(piece[0][0])):
            if len(self.seen) < _MOST_SEEN:
                self.seen.update(dict.fromkeys(block.joints))
            columns = columns_of(block.joints, self.joints or block.joints)
            if not columns.size:
                self.counts[Reason.FOREIGN_JOINTS] += rows.size
                continue
            keep, block = self._usable(block, columns)
            if not keep.any():
                continue
            key = block.joints, block.has_position
            if block.has_position:
                self.joints = self.joints or block.joints
            if len(self._growing) == _MOST_BLOCKS and key not in self._growing:
                self.counts[Reason.MISSING_JOINT] += len(block.numbers)
                continue
            self._growing.setdefault(key, _GrowingBlock(block.joints))
            taken.setdefault(key, []).append((rows[keep], block))
        for key, some in taken.items():
            self._growing[key].extend(some)

    @property
    def collected_joints(self) -> set[str]:
        """Those of the joints to keep whose positions came."""
        return {joint for joints, placed in self._growing if placed for joint in joints}

    def blocks(self) -> list[MessageBlock]:
        """Return what was collected; nothing may be added any more."""
        if self._not_finite:
            self.notes[not_finite_note(self._not_finite)] = None
        if self._denormal:
            self.notes[
                f'{self._denormal} denormal values (memory never filled in) were read as 0'
            ] = None
        return [growing.block() for growing in self._growing.values()]

    def _usable(self, block: MessageBlock, columns: IndexArray) -> tuple[BoolArray, MessageBlock]:
        """Mark the messages that can be used, and return them with the joints to keep."""
        joints = tuple(block.joints[column] for column in columns)
        values = block.values if joints == block.joints else block.values[:, :, columns]
        keep = usable(values, self.counts)
        self._not_finite |= dict.fromkeys(not_finite(joints, values))
        denormal = (np.abs(values) < _SMALLEST) & (values != 0.0)
        self._denormal += int(denormal.sum())
        values[denormal] = 0.0
        return keep, MessageBlock(joints, block.publishers, block.numbers[keep], values[keep])


class _GrowingBlock:
    """Messages of the same joints, in the order of the file; grows at its end."""

    def __init__(self, joints: tuple[str, ...]) -> None:
        self._joints = joints
        self._numbers = RowStore(3, dtype=np.int64)
        self._values = RowStore(3, len(joints))
        self._publishers: dict[Publisher, int] = {}

    def extend(self, pieces: Sequence[Piece]) -> None:
        """Append messages that follow those before."""
        for _, block in pieces:
            (publisher,) = block.publishers
            if len(self._publishers) <= _MOST_PUBLISHERS:
                self._publishers.setdefault(publisher, len(self._publishers))
            block.numbers[:, PUBLISHER] = self._publishers.get(publisher, 0)
        order = np.argsort(np.concatenate([rows for rows, _ in pieces]))
        numbers = np.concatenate([block.numbers for _, block in pieces])[order]
        self._numbers.extend(np.clip(numbers, -1, LATEST_NS))
        self._values.extend(np.concatenate([block.values for _, block in pieces])[order])

    def block(self) -> MessageBlock:
        """Return what was appended; nothing may be appended any more."""
        too_many = len(self._publishers) > _MOST_PUBLISHERS
        publishers = tuple(self._publishers)[: 1 if too_many else None]
        return MessageBlock(
            self._joints, publishers, self._numbers.values(), self._values.values()
        )


class RowStore:
    """Rows that grow at their end, in a temporary file once they are many."""

    def __init__(self, *shape: int, dtype: DTypeLike = np.float64) -> None:
        self._array = np.empty((_FIRST_ROWS, *shape), dtype)
        self._size = 0
        self._file: Any = None

    def extend(self, rows: NDArray[Any]) -> None:
        """Append rows; OSError if the temporary folder has no room for them."""
        needed = self._size + len(rows)
        if self._file is None and needed * self._array[0].nbytes > spill.LARGE_BYTES:
            self._file = tempfile.TemporaryFile(prefix='lip_id_')  # noqa: SIM115  values() closes
            self._array[: self._size].tofile(self._file)
            self._array = self._array[:1].copy()
        if self._file is not None:
            rows.astype(self._array.dtype).tofile(self._file)
        else:
            self._make_room(needed)
            self._array[self._size : needed] = rows
        self._size = needed

    def values(self) -> NDArray[Any]:
        """Return the rows, without a copy; nothing may be appended any more."""
        if self._file is None:
            return self._array[: self._size]
        shape = (self._size, *self._array.shape[1:])
        with self._file as file:
            file.flush()
            return np.memmap(file, self._array.dtype, 'r', shape=shape)

    def _make_room(self, needed: int) -> None:
        if needed > len(self._array):
            capacity = max(needed, 3 * len(self._array) // 2)
            # no view of it exists
            self._array.resize((capacity, *self._array.shape[1:]), refcheck=False)
