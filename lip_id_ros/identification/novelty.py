"""Training states that a model keeps, so that it can say how far others are from them."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.dataset.subsets import covering_points
from lip_id_ros.identification.folds import (
    at_rest,
    largest_alike,
    motion_s,
    recurrent_folds,
    STILL,
)
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.model.known_states import KnownStates, nearest, stored_states

BLOCKS = 6
"""Parts of the new motion, of which each is left out once."""

MOST_CONSIDERED, MOST_KEPT = 3000, 600
"""States that are covered, and states that cover them, at most."""

TOLERANCE = 0.1
"""Distance of a training state to the nearest that is kept, in those of left-out ones."""

LEAST_SHARE = 0.01
"""
Least deviation of a position or rate, as a share of its largest value: states are kept to a
thousandth of theirs, and the deviation of a slide that rests is rounding.
"""

LEAST_DISTANCE = 1e-6
"""Of left-out states, where all states are one."""


def motion_report(dataset: Dataset) -> dict[str, float]:
    """Return how long an arm moves, and how long of that is no repetition, for a summary."""
    return motion_entries(*motion_s(dataset))


def motion_entries(every: float, new: float) -> dict[str, float]:
    """Return what `motion_s` found, as entries of a summary."""
    return {'motion_s': round(every, 3), 'new_motion_s': round(new, 3)}


def known_states(dataset: Dataset) -> KnownStates:
    """Return few states of a data set that cover it, with the distance of left-out motion."""
    some = dataset.select(evenly(dataset.n_samples, MOST_CONSIDERED))
    scale = _scale(some)
    states = np.hstack([some.q, some.dq, some.ddq]) / scale
    fold = recurrent_folds(some, BLOCKS)
    moves = ~at_rest(some)
    every = np.ones(some.n_samples, dtype=np.bool_)
    near = TOLERANCE * _left_out(states, fold, moves, every)
    rows = covering_points(states - states.mean(axis=0), MOST_KEPT, near)
    kept = np.zeros_like(every)
    kept[rows] = True
    states[rows] = stored_states(states[rows])
    return KnownStates(states[rows], scale, _left_out(states, fold, moves, kept))


def _scale(dataset: Dataset) -> Array:
    """
    Return standard deviations of q, dq, ddq times the root of their number, shape (3 n,).

    At least a share of the largest of joints of the same type: what hardly moves is noise.
    """
    states = np.stack([dataset.q, dataset.dq, dataset.ddq])
    scale = np.maximum(states.std(axis=1), LEAST_SHARE * np.abs(states).max(axis=1))
    scale = np.maximum(scale, STILL * largest_alike(scale, dataset.prismatic))
    scale[scale == 0.0] = 1.0
    return np.asarray(scale.ravel() * np.sqrt(scale.size))


def _left_out(states: Array, fold: IndexArray, moves: BoolArray, kept: BoolArray) -> float:
    """Return the median distance of left-out states in motion to those kept of other folds."""
    found = [
        nearest(states[(fold == k) & moves], states[(fold != k) & kept])
        for k in np.unique(fold)
        if ((fold != k) & kept).any()
    ]
    distances = np.concatenate([np.empty(0), *found])
    return max(float(np.median(distances)), LEAST_DISTANCE) if distances.size else LEAST_DISTANCE
