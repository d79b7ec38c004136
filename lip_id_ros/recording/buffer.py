"""A buffer of joint messages, as a live node receives them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, IndexArray, IntArray
from lip_id_ros.recording.joint_samples import (
    columns_of,
    complete,
    counted,
    JointSamples,
    LARGEST,
    length_reason,
    MOST_JOINTS,
    name_reason,
    Reason,
)

_FIRST_ROWS = 1024
_KNOWN_ORDERS = 64
LATEST_NS = 2**63
"""Stamps are counted in 64 bits."""


class SampleBuffer:
    """
    Collects joint messages into arrays, by joint name, message by message.

    A message is taken whole or dropped with a reason; nothing is filled in. Empty velocities or
    efforts are taken, for recordings that have none at all; where only some messages lack them,
    these messages are left out of `samples`.

    `joint_names`: joints to keep, in this order; empty for those of the first message that can be
    taken. `max_rows`: most messages kept; later ones are dropped and counted. `expected_rows`:
    room made at the beginning.
    """

    def __init__(
        self,
        joint_names: Sequence[str] = (),
        max_rows: int | None = None,
        expected_rows: int = _FIRST_ROWS,
    ) -> None:
        self._wanted = tuple(joint_names)
        self._max_rows = max_rows
        self._first_rows = max(
            1, expected_rows if max_rows is None else min(expected_rows, max_rows)
        )
        self.clear()

    def clear(self) -> None:
        """Forget all messages, counts and, unless they were given, the joints."""
        self.joint_names = self._wanted
        self.counts: Counter[str] = Counter()
        self._orders: dict[tuple[str, ...], IndexArray | Reason] = {}
        self._size = 0
        self._last_stamp = -1
        self._stamps = np.empty(self._first_rows, np.int64)
        self._rows = np.empty((self._first_rows, 3, len(self._wanted)))

    def __len__(self) -> int:
        return self._size

    @property
    def last_stamp_ns(self) -> int:
        """Stamp of the last message taken [ns]; -1 before the first."""
        return self._last_stamp

    @property
    def seen_joints(self) -> tuple[str, ...]:
        """Joints of all messages, also of those dropped; not of an endless variety."""
        return tuple(dict.fromkeys(name for names in self._orders for name in names))

    def add(
        self,
        stamp_ns: int,
        names: Sequence[str],
        position: Sequence[float] | Array,
        velocity: Sequence[float] | Array,
        effort: Sequence[float] | Array,
    ) -> Reason | None:
        """Take one message, stamped in ns, or return why it was dropped."""
        reason = self._take(stamp_ns, names, position, velocity, effort)
        if reason is not None:
            self.counts[reason] += 1
        return reason

    def reject(self, reason: Reason) -> None:
        """Count a message that could not even be read."""
        self.counts[reason] += 1

    def samples(self, source: str = 'the recording', topic: str = '') -> JointSamples:
        """Return copies of the messages taken so far; the buffer goes on."""
        taken = self.all_samples(source, topic)
        counts = Counter(self.counts)
        no_velocity, no_effort = np.isnan(self._rows[: self._size, 1:, :1]).any(axis=2).T
        keep = complete(no_velocity, no_effort, counts)
        kept = taken.select(keep)
        stamps = self._stamps[: self._size][keep]
        return replace(kept, **_times(stamps), counts=counted(counts))

    def all_samples(self, source: str = 'the recording', topic: str = '') -> JointSamples:
        """Return copies of all that was taken; NaN where a message has no velocity or effort."""
        stamps, rows = self._stamps[: self._size], self._rows[: self._size]
        position, velocity, effort = (rows[:, part].copy() for part in range(3))
        return JointSamples(
            **_times(stamps),
            position=position,
            velocity=velocity,
            effort=effort,
            joint_names=self.joint_names,
            counts=counted(self.counts),
            source=source,
            topic=topic,
            seen_joints=self.seen_joints,
        )

    def _take(
        self, stamp: int, names: Sequence[str], position: Any, velocity: Any, effort: Any
    ) -> Reason | None:
        key = tuple(names)
        if key and not self.joint_names:
            trial = SampleBuffer(key, expected_rows=1)
            if (flaw := trial._take(stamp, key, position, velocity, effort)) is not None:
                return flaw
            self.joint_names = key
            self._rows = np.empty((len(self._stamps), 3, len(key)))
        order = self._orders.get(key)
        if order is None:
            order = self._remember_order(key)
        if isinstance(order, Reason):
            return order
        reason = length_reason(len(key), len(position), len(velocity), len(effort))
        if reason is None:
            reason = self._stamp_reason(stamp)
        if reason is not None:
            return reason
        if self._size == self._max_rows:
            return Reason.BUFFER_FULL
        if self._size == len(self._stamps):
            self._make_room()
        return self._store(stamp, order, (position, velocity, effort))

    def _store(self, stamp: int, order: IndexArray, parts: tuple[Any, Any, Any]) -> Reason | None:
        row = self._rows[self._size]
        absent = np.array([not len(values) for values in parts])
        for part, values in enumerate(parts):
            row[part] = 0.0 if absent[part] else np.asarray(values)[order]
        if not (np.abs(row) <= LARGEST).all():
            absent[1:] |= ~np.isfinite(row[1:]).any(axis=1)  # see joint_samples.usable
            row[absent] = 0.0
            if not (np.abs(row) <= LARGEST).all():
                return Reason.ABSURD if np.isfinite(row).all() else Reason.NOT_FINITE
        row[absent] = np.nan
        self._stamps[self._size] = self._last_stamp = stamp
        self._size += 1
        return None

    def _make_room(self) -> None:
        capacity = 2 * len(self._stamps)
        if self._max_rows is not None:
            capacity = min(capacity, self._max_rows)
        stamps = np.empty(capacity, np.int64)
        rows = np.empty((capacity, *self._rows.shape[1:]))
        stamps[: self._size], rows[: self._size] = self._stamps, self._rows
        self._stamps, self._rows = stamps, rows

    def _remember_order(self, names: tuple[str, ...]) -> IndexArray | Reason:
        order = self._order(names)
        if len(self._orders) < _KNOWN_ORDERS and len(names) <= MOST_JOINTS:
            self._orders[names] = order
        return order

    def _order(self, names: tuple[str, ...]) -> IndexArray | Reason:
        reason = name_reason(names)
        if reason is not None:
            return reason
        present = [name in names for name in self.joint_names]
        if not any(present):
            return Reason.FOREIGN_JOINTS
        if not all(present):
            return Reason.MISSING_JOINT
        return columns_of(names, self.joint_names)

    def _stamp_reason(self, stamp: int) -> Reason | None:
        if not 0 <= stamp < LATEST_NS:
            return Reason.BAD_STAMP
        if stamp > self._last_stamp:
            return None
        if stamp == 0:
            return Reason.ZERO_STAMP
        return Reason.REPEATED_STAMP if stamp == self._last_stamp else Reason.BACKWARD_STAMP


def _times(stamps: IntArray) -> dict[str, Any]:
    """Return the fields of `JointSamples` that have the times of stamps [ns]."""
    start = int(stamps[0]) if stamps.size else 0
    return {'t': (stamps - start) / 1e9, 'start_ns': start}
