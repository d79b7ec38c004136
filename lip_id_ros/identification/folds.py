"""
Folds for cross-validation, which leave out a motion together with its repetitions.

A block of time would be seen in the rest of a periodic recording (Roberts and others, Ecography
2017), so folds are blocks of first passes, to which each sample is traced.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.numba_jit import jit

NEAR = 0.1
"""
Largest distance of a state to that of an earlier pass, in standard deviations of positions and
velocities times the root of their number.
"""

STEP, FARTHEST = 0.5 * NEAR, 5.0 * NEAR
"""
Distance of states that are traced, where samples are closer; samples are farther apart at low
rates, by at most so much from the middle of two of them to a state that may be between.
"""

STILL = 0.05
"""A joint that moves less, as a share of the one that moves most, distinguishes no states."""

PAST_S, GONE = 0.5, 5
"""Time, and number of traced states, that a motion must be away for to come back [s]."""

AT_REST, SURE = 0.01, 0.1
"""
An arm rests below this share of the root mean square of its speed while it surely moves, which is
above that share of the one of all samples: of those long rests are most.
"""

LONGEST_STEP = 3.0
"""
Of samples from one to the next, in usual steps, that is motion throughout; longer than `PAST_S`,
others have been left out between, as near rest.
"""

MOST_TRACED = 100_000
"""States that are traced; of more, so many evenly chosen."""


def recurrent_folds(dataset: Dataset, count: int) -> IndexArray:
    """Return the fold of every sample, shape (N,): at most `count`, each with as much new."""
    if count == 1:
        return np.zeros(dataset.n_samples, dtype=np.intp)
    first = first_passes(dataset)
    new = np.unique(first)
    number = np.searchsorted(new, first)
    return np.asarray(number * min(count, new.size) // new.size, dtype=np.intp)


def motion_s(dataset: Dataset) -> tuple[float, float]:
    """Return for how long an arm moves, and for how long it does what it did not before [s]."""
    lasts, is_first = _moves(dataset)
    return float(lasts.sum()), float(lasts[is_first].sum())


def motion_of_samples_s(dataset: Dataset, whole: Sequence[tuple[float, float]]) -> Array:
    """
    Return `motion_s` of recordings of which a data set has some samples, shape (2,) [s].

    `whole`: of each recording alone, with all its samples. Few samples do not show that a
    recording repeats itself, but whether it repeats others.
    """
    lasts, is_first = _moves(dataset)
    out = np.zeros(2)
    for number, alone in enumerate(whole):
        own = dataset.recording == number
        _, own_new = motion_s(dataset.select(own))
        share = lasts[own & is_first].sum() / own_new if own_new > 0.0 else 0.0
        out += alone[0], alone[1] * min(share, 1.0)
    return out


def new_motion_s(known: Dataset, other: Dataset) -> float:
    """Return for how long an arm moves in a data set as it does not in one that is known [s]."""
    lasts, is_first = _moves(concatenate([known, other]))
    is_first[: known.n_samples] = False
    return float(lasts[is_first].sum())


def _moves(dataset: Dataset) -> tuple[Array, BoolArray]:
    """Return how long an arm moves at each sample [s], and which repeat nothing, both (N,)."""
    is_first = first_passes(dataset) == np.arange(dataset.n_samples)
    steps = np.where(np.diff(dataset.segment) == 0, np.diff(dataset.t), 0.0)
    usual = np.median(steps[steps > 0.0]) if steps.any() else 0.0
    half = 0.5 * np.minimum(steps, max(LONGEST_STEP * usual, PAST_S))
    lasts = np.append(half, 0.0) + np.append(0.0, half)
    return np.where(at_rest(dataset), 0.0, lasts), is_first


def first_passes(dataset: Dataset) -> IndexArray:
    """
    Return the numbers (N,) of the samples of first passes that samples repeat, or their own.

    Passes are sampled at different places, so states are compared with lines between those of a
    path.
    """
    path = _Path(dataset)
    origin = path.origins()
    own = np.arange(dataset.n_samples)
    number = path.number(own)
    repeats = origin[number] != path.rows[number]
    first = np.where(repeats, origin[number], own)
    rests = at_rest(dataset)
    follows = rests & np.concatenate([[False], rests[:-1]]) & ~repeats
    # a rest is one sample, repeated
    first[follows] = first[np.maximum.accumulate(np.where(follows, 0, own))[follows]]
    return np.asarray(first[first])


class _Path:
    """States along the samples, no closer than `STEP`."""

    def __init__(self, dataset: Dataset) -> None:
        states = _states(dataset)
        rows = np.flatnonzero(_apart(states, dataset.segment, STEP))
        self.rows = rows = rows[evenly(rows.size, MOST_TRACED)]
        self._states, self._t, self._recording = (
            states[rows],
            dataset.t[rows],
            dataset.recording[rows],
        )
        steps = np.linalg.norm(np.diff(self._states, axis=0), axis=1)
        joined = (np.diff(dataset.segment[rows]) == 0) & (steps < 2.0 * FARTHEST)
        self._joined = np.concatenate([[False], joined, [False]])
        half = 0.5 * np.quantile(steps[joined], 0.95) if joined.any() else 0.0
        self._reach = float(np.hypot(NEAR, min(half, FARTHEST)))

    def origins(self) -> IndexArray:
        """Return the sample that each state repeats, shape (P,); its own if none."""
        self._origin, self._new = self.rows.copy(), np.ones(self.rows.size, dtype=np.bool_)
        self._trace(0, self.rows.size)
        return self._origin

    def _trace(self, start: int, end: int) -> None:
        """Trace some states among themselves: the later half to what is new in the first."""
        if end - start <= GONE:
            return
        middle = (start + end) // 2
        self._trace(start, middle)
        earlier = start + np.flatnonzero(self._new[start:middle])
        later = middle + np.flatnonzero(self._new[middle:end])
        if later.size:
            tree = cKDTree(self._states[earlier], balanced_tree=False, compact_nodes=False)
            distance, nearest = tree.query(self._states[later], distance_upper_bound=self._reach)
            found = np.isfinite(distance)
            self._assign(later[found], earlier[nearest[found]])
            self._trace(middle, end)

    def _assign(self, later: IndexArray, earlier: IndexArray) -> None:
        """Give states the origin that is nearest, if it is near and the motion has been away."""
        away = (self._t[later] - self._t[earlier] > PAST_S) & (later - earlier >= GONE)
        away |= self._recording[later] != self._recording[earlier]
        later, earlier = later[away], earlier[away]
        states = self._states[later]
        before, after = (self._from_line(states, earlier + k) for k in (-1, 0))
        distance, origin = np.where(before[0] < after[0], before, after)
        near = distance < NEAR
        later, earlier, origin = later[near], earlier[near], origin[near].astype(np.intp)
        is_new = self._new[self.number(origin)]
        self._origin[later] = np.where(is_new, origin, self.rows[earlier])
        self._new[later] = False

    def _from_line(self, states: Array, first: IndexArray) -> Array:
        """Return distances of states, (M, d), from lines to the next; nearest samples: (2, M)."""
        joined = self._joined[first + 1]
        low = np.maximum(first, 0)
        high = np.where(joined, low + 1, low)
        along = self._states[high] - self._states[low]
        square = np.maximum(np.sum(along**2, axis=1), 1e-300)
        share = np.sum((states - self._states[low]) * along, axis=1) / square
        share = np.clip(share, 0.0, 1.0)
        distance = np.linalg.norm(states - self._states[low] - share[:, None] * along, axis=1)
        sample = np.round(self.rows[low] + share * (self.rows[high] - self.rows[low]))
        return np.array([np.where(first >= 0, distance, np.inf), sample])

    def number(self, samples: IndexArray) -> IndexArray:
        """Return the number of the state that stands for samples."""
        return np.searchsorted(self.rows, samples, side='right') - 1


@jit
def _apart(states: Array, segment: IntArray, least: float) -> BoolArray:
    """Mark the states that begin a segment, or are so far from the one marked before, (N,)."""
    out, last = np.zeros(len(states), dtype=np.bool_), 0
    for i in range(len(states)):
        square = 0.0
        for k in range(states.shape[1]):
            square += (states[i, k] - states[last, k]) ** 2
        if i == 0 or segment[i] != segment[i - 1] or square >= least * least:
            out[i], last = True, i
    return out


def at_rest(dataset: Dataset) -> BoolArray:
    """Mark the samples of an arm that stands, shape (N,)."""
    speed = np.linalg.norm(dataset.dq, axis=1)
    moving = speed[speed >= SURE * np.sqrt(np.mean(speed**2))]
    return np.asarray(speed < AT_REST * np.sqrt(np.mean(moving**2)))


def largest_alike(values: Array, prismatic: BoolArray) -> Array:
    """Return the largest value of joints of the same type for each joint, shape (..., n)."""
    largest = np.zeros_like(values)
    for alike in (prismatic, ~prismatic):
        largest[..., alike] = values[..., alike].max(axis=-1, keepdims=True, initial=0.0)
    return largest


def _states(dataset: Dataset) -> Array:
    """Return positions and velocities in standard deviations times the root of 2 n, (N, 2 n)."""
    parts = []
    for values in (dataset.q, dataset.dq):
        std = values.std(axis=0)
        parts.append(values / np.maximum(np.maximum(std, STILL * std.max()), 1e-12))
    return np.ascontiguousarray(np.hstack(parts) / np.sqrt(2 * dataset.n_joints))
