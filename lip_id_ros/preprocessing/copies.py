"""
Recordings that repeat each other, recognised by their contents.

A copy of a recording would be in the training data and in the held-out data, and count twice.
Names and start times prove little: files are renamed, and logs begin at zero.

"""

from __future__ import annotations

from collections.abc import Sequence
import hashlib

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.recording.spill import release, row_blocks

WINDOW = 20
"""Consecutive samples that two recordings share only where one repeats the other."""
MOVING = 5
"""Steps of a window at which something changes, at least: at rest, any recordings are alike."""

Hashes = NDArray[np.uint64]


class RepeatedSamples:
    """Finds the samples of each recording that an earlier one has too."""

    def __init__(self) -> None:
        self._known: Hashes = np.zeros(0, dtype=np.uint64)

    def repeated(self, joint_names: Sequence[str], *signals: Array) -> BoolArray:
        """
        Return which samples belong to a window of an earlier recording.

        Parameters
        ----------
        joint_names : sequence of str, n of them
            Their order is of no importance.
        signals : ndarrays, shape (N, n)
            Such as positions and efforts, compared bit by bit.

        Returns
        -------
        ndarray of bool, shape (N,)

        """
        windows, usable = _windows(_all_row_hashes(joint_names, signals))
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
        digest.update(_row_hashes(joint_names, [signal[block] for signal in signals]).tobytes())
    return digest.hexdigest()[:16]


def _all_row_hashes(joint_names: Sequence[str], signals: Sequence[Array]) -> Hashes:
    hashes = np.empty(len(signals[0]), dtype=np.uint64)
    for block in row_blocks(len(hashes)):
        hashes[block] = _row_hashes(joint_names, [signal[block] for signal in signals])
    return hashes


def _row_hashes(joint_names: Sequence[str], signals: Sequence[Array]) -> Hashes:
    """Return one hash per row, shape (N,): a sum of its bits' numbers with random weights."""
    order = np.argsort(np.array(joint_names, dtype=object))
    weights = _weights(len(signals) * len(order))
    total = np.zeros(len(signals[0]), dtype=np.uint64)
    columns = (signal[:, joint] for signal in signals for joint in order)
    for weight, column in zip(weights, columns, strict=True):
        bits = np.ascontiguousarray(column, dtype=np.float64).view(np.uint64)
        total += (bits ^ (bits >> np.uint64(29))) * weight
    release(*signals)
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
