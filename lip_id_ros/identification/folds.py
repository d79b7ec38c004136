"""
Folds of samples for cross-validation: a motion is left out together with its repetitions.

Exciting trajectories are periodic, and pick and place comes back. A block of time that is left out
would be seen in the rest of the recording, and whatever memorises would be selected (Roberts and
others, Ecography 2017). So each sample is traced to the first pass of its motion, and folds are
contiguous blocks of first passes.

"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.sample_selection import evenly

NEAR = 0.1
"""
Largest distance of a state to that of an earlier pass, in standard deviations of positions and
velocities times the root of their number.
"""

STILL = 0.05
"""A joint that moves less, as a share of the one that moves most, distinguishes no states."""

PAST_S = 0.5
"""Time that a motion must be away for to come back [s]."""

AT_REST = 0.01
"""An arm rests below this share of the root mean square of its speed."""

MOST_TRACED, MOST_PATH, BETWEEN = 1000, 3000, 4
"""Samples that are traced; those of the path they are compared with, and points for each."""


def recurrent_folds(dataset: Dataset, count: int) -> IndexArray:
    """Return the fold of every sample, shape (N,): at most `count`, each with as much new."""
    if count == 1:
        return np.zeros(dataset.n_samples, dtype=np.intp)
    rows = evenly(dataset.n_samples, MOST_TRACED)
    first = first_passes(dataset, rows)
    new = np.unique(first)
    fold = np.searchsorted(new, first) * min(count, new.size) // new.size
    return np.asarray(fold[_nearest(rows, np.arange(dataset.n_samples))], dtype=np.intp)


def first_passes(dataset: Dataset, rows: IndexArray) -> IndexArray:
    """
    Return the number of the row that each of some rows repeats, shape (M,); its own if none.

    Of several passes that of the first. Passes are sampled at different places, so that states are
    compared with points between samples.

    """
    at = _path_rows(dataset, rows)
    states = _states(dataset)
    path, t = (_interpolated(values, at) for values in (states, dataset.t))
    recording = dataset.recording[np.floor(at).astype(np.intp)]
    number = _nearest(rows, at)
    rests = _rests(dataset)[rows]
    near = cKDTree(path).query_ball_point(states[rows], NEAR, return_sorted=True)
    first = np.arange(rows.size)
    for i, (row, points) in enumerate(zip(rows, near, strict=True)):
        earlier = np.asarray(points)[: np.searchsorted(points, np.searchsorted(at, row))]
        gone = np.diff(t[earlier], append=dataset.t[row]) > PAST_S
        gone |= np.diff(recording[earlier], append=dataset.recording[row]) != 0
        past = earlier[: int(np.flatnonzero(gone)[-1]) + 1 if gone.any() else 0]
        past = past[number[past] < i]
        if past.size:
            distances = np.square(path[past] - states[row]).sum(axis=1)
            first[i] = first[number[past[np.argmin(distances)]]]
        elif i and rests[i] and rests[i - 1]:
            first[i] = first[i - 1]
    return first


def _rests(dataset: Dataset) -> BoolArray:
    """Mark the samples of an arm that stands, shape (N,)."""
    speed = np.linalg.norm(dataset.dq, axis=1)
    return np.asarray(speed < AT_REST * np.sqrt(np.mean(speed**2)))


def _states(dataset: Dataset) -> Array:
    """Return positions and velocities in standard deviations times the root of 2 n, (N, 2 n)."""
    parts = []
    for values in (dataset.q, dataset.dq):
        std = values.std(axis=0)
        parts.append(values / np.maximum(np.maximum(std, STILL * std.max()), 1e-12))
    return np.asarray(np.hstack(parts) / np.sqrt(2 * dataset.n_joints))


def _path_rows(dataset: Dataset, rows: IndexArray) -> Array:
    """Return fractional numbers of the rows of a path, with points between those of a motion."""
    known = np.union1d(rows, evenly(dataset.n_samples, MOST_PATH))
    steps = np.linspace(0.0, 1.0, BETWEEN, endpoint=False)
    between = known[:-1, None] + np.diff(known)[:, None] * steps
    joined = dataset.segment[known[1:]] == dataset.segment[known[:-1]]
    joined &= np.diff(dataset.t[known]) < PAST_S
    between[~joined] = known[:-1, None][~joined]
    return np.append(between.ravel(), known[-1])


def _interpolated(values: Array, at: Array) -> Array:
    low = np.floor(at).astype(np.intp)
    high = np.minimum(low + 1, len(values) - 1)
    share = (at - low).reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray((1.0 - share) * values[low] + share * values[high])


def _nearest(rows: IndexArray, at: Array | IndexArray) -> IndexArray:
    """Return the number of the row that is nearest to each place."""
    return np.searchsorted(0.5 * (rows[1:] + rows[:-1]), at)
