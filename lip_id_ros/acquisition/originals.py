"""Recorded messages as they came: what they have beside the numbers of the joints to keep."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import errno
from functools import cached_property, lru_cache
import json
import os
from typing import Any, NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.recording.bag_writer import JointStateTrack
from lip_id_ros.recording.collecting import RowStore
from lip_id_ros.recording.joint_messages import JointMessage

MOST_BYTES = 2**30
"""A million messages of forty other joints; beyond it a stream would only fill the disk."""

_MOST_KNOWN, _LONG_TEXT = 64, 2**16

_OTHERS, _ALL = 1, 2


class _Layout(NamedTuple):
    """
    What messages have in common: their frame, and their joints in the order of the message.

    Of position, velocity and effort, `parts` says whether the message has none (0), or whether
    numbers of the other joints or all numbers are kept here.
    """

    frame_id: str
    names: Sequence[str]
    parts: Sequence[int]

    def others(self, joint_names: Sequence[str]) -> BoolArray:
        """Mark the joints that are not among those to keep."""
        return np.array([name not in joint_names for name in self.names])


class _Known(NamedTuple):
    """Begin and length of a layout's text, its other joints, and the size of their names."""

    begin: int
    length: int
    others: BoolArray
    n_bytes: int


class Originals:
    """Frames, order of names, and numbers of other joints, on disk once they are many."""

    def __init__(self) -> None:
        self._known: dict[_Layout, _Known] = {}
        self._texts, self._numbers = RowStore(dtype=np.uint8), RowStore()
        self._places = RowStore(3, dtype=np.int64)
        self._n_text = self._n_numbers = self.n_bytes = 0

    def add(self, message: JointMessage, kept: Array, joint_names: Sequence[str]) -> None:
        """
        Take a message after those before; after an OSError nothing may be added any more.

        `kept`, shape (3, n): position, velocity and effort of the joints to keep, always the same;
        NaN where it has none, or none that is finite.
        """
        came = message.position, message.velocity, message.effort
        parts = tuple(
            (_ALL if gone else _OTHERS) if len(values) else 0
            for values, gone in zip(came, np.isnan(kept[:, 0]), strict=True)
        )
        layout = _Layout(message.frame_id, tuple(message.names), parts)
        known = self._known.get(layout) or self._remember(layout, joint_names)
        self._places.extend(np.array([[known.begin, known.length, self._n_numbers]]))
        before = self._n_numbers
        for values, part in zip(came, parts, strict=True):
            if part == _ALL or (part and known.others.any()):
                numbers = np.asarray(values, np.float64)
                numbers = numbers if part == _ALL else numbers[known.others]
                self._numbers.extend(numbers)
                self._n_numbers += numbers.size
        self.n_bytes += known.n_bytes + 8 * (self._n_numbers - before)
        if 8 * self._n_numbers + self._n_text > MOST_BYTES:
            raise OSError(errno.EFBIG, os.strerror(errno.EFBIG))

    def fields(
        self, row: int, kept: Sequence[Array], joint_names: tuple[str, ...]
    ) -> tuple[_Layout, list[Array]]:
        """Return a message: its layout and three arrays. Nothing may be added any more."""
        numbers, places = self._stored
        begin, length, at = places[row].tolist()
        layout, others, columns = self._read(begin, length, joint_names)
        arrays = []
        for part, values in zip(layout.parts, kept, strict=True):
            full = np.empty(len(layout.names) if part else 0)
            where = others if part == _OTHERS else np.ones(len(full), bool)
            n_here = int(where.sum())
            if part == _OTHERS:
                full[columns] = values
            full[where] = numbers[at : at + n_here]
            at += n_here
            arrays.append(full)
        return layout, arrays

    @cached_property
    def _stored(self) -> tuple[Any, Any]:
        return self._numbers.values(), self._places.values()

    @cached_property
    def _read(self) -> Callable[[int, int, Sequence[str]], tuple[_Layout, BoolArray, list[int]]]:
        texts = self._texts.values()

        @lru_cache(_MOST_KNOWN)
        def read(
            begin: int, length: int, joint_names: Sequence[str]
        ) -> tuple[_Layout, BoolArray, list[int]]:
            layout = _Layout(*json.loads(texts[begin : begin + length].tobytes()))
            columns = [layout.names.index(name) for name in joint_names]
            return layout, layout.others(joint_names), columns

        return read

    def _remember(self, layout: _Layout, joint_names: Sequence[str]) -> _Known:
        if len(self._known) == _MOST_KNOWN:  # of an endless variety
            self._known.clear()
        text = np.frombuffer(json.dumps(layout).encode(), np.uint8)
        others = layout.others(joint_names)
        extra = [layout.frame_id, *(name for name in layout.names if name not in joint_names)]
        n_bytes = sum(8 + len(each.encode()) for each in extra)
        known = _Known(self._n_text, text.size, others, n_bytes)
        self._texts.extend(text)
        self._n_text += text.size
        if text.size <= _LONG_TEXT:
            self._known[layout] = known
        return known


@dataclass(frozen=True, kw_only=True)
class OriginalTrack(JointStateTrack):
    """Joint states as they came, the first of which is `first` among the originals."""

    originals: Originals
    first: int

    def message(self, types: Any, stamp_ns: int, row: int) -> Any:
        """Return one message."""
        message = super().message(types, stamp_ns, row)
        signals = self.position, self.velocity, self.effort
        kept = [values[row] for values in signals if values is not None]
        names = tuple(self.joint_names)
        layout, arrays = self.originals.fields(self.first + row, kept, names)
        message.header.frame_id, message.name = layout.frame_id, list(layout.names)
        message.position, message.velocity, message.effort = arrays
        return message
