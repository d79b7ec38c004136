"""Quantised signals, copies of recordings, and the meaning of recorded efforts."""

from __future__ import annotations

from collections.abc import Sequence
import hashlib
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import ConfigError, SourceError
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import mapped, release, row_blocks, thinned
from lip_id_ros.settings import RecordingSettings

Value = TypeVar('Value')
Hashes = NDArray[np.uint64]

LEAST_REPETITION = 4
ON_GRID = 0.9
MOST_VALUES = 50_000
WINDOW = 20
"""Consecutive samples that two recordings share only where one repeats the other."""
MOVING = 5
"""Steps of a window at which something changes, at least: at rest, any recordings are alike."""


def quantum(values: Array) -> float:
    """Return the step of a quantised signal, shape (N,); 0 where there is none to be seen."""
    values = thinned(values, MOST_VALUES)
    levels = np.unique(values)
    if levels.size < 2 or LEAST_REPETITION * levels.size > values.size:
        return 0.0
    steps = np.diff(levels)
    step = float(np.median(steps[steps <= 1.5 * np.percentile(steps, 20)]))
    multiples = steps / step
    on_grid = np.abs(multiples - np.round(multiples)) < 0.1
    return step if on_grid.mean() > ON_GRID else 0.0


def torque(samples: JointSamples, recording: RecordingSettings) -> Array:
    """
    Return recorded efforts as torques or forces [N m or N], scaled and offset per joint.

    Raises
    ------
    SourceError
        If no effort was recorded.
    ConfigError
        If scale or offset are not given for each joint.

    """
    if not samples.has_effort:
        raise SourceError(
            f'{samples.topic or "joint states"} in {samples.source} must have effort, but every '
            'message leaves it empty; record it with a driver that measures torque or current.'
        )
    scale = np.array(per_joint(samples, 'effort_scale', recording.effort_scale, 1.0))
    offset = np.array(per_joint(samples, 'effort_offset', recording.effort_offset, 0.0))
    if (scale == 1.0).all() and (offset == 0.0).all():
        return samples.effort
    return mapped(lambda effort: effort * scale + offset, samples.effort)


def per_joint(
    samples: JointSamples, name: str, values: tuple[Value, ...], default: Value
) -> tuple[Value, ...]:
    """
    Return one value for each joint: those given, or the default for all.

    Raises
    ------
    ConfigError
        If there are more or fewer than joints.

    """
    if not values:
        return (default,) * samples.n_joints
    if len(values) != samples.n_joints:
        raise ConfigError(
            f'recording.{name} must have one value for each of {", ".join(samples.joint_names)}, '
            f'not {len(values)}; give {samples.n_joints}.'
        )
    return values


class RepeatedSamples:
    """
    Finds the samples of each recording that an earlier one has too, by their contents.

    A copy of a recording would be in the training data and in the held-out data, and count twice.
    Names and start times prove little: files are renamed, and logs begin at zero.

    """

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
        rows = mapped(lambda *some: _row_hashes(joint_names, some), *signals)
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
        digest.update(_row_hashes(joint_names, [signal[block] for signal in signals]).tobytes())
        release(*signals)
    return digest.hexdigest()[:16]


def _row_hashes(joint_names: Sequence[str], signals: Sequence[Array]) -> Hashes:
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
