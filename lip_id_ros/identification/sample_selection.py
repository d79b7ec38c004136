"""Samples that are left out, by quantiles (Huber, Robust Statistics, 1981), or that cover all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, runs
from lip_id_ros.dataset import Dataset
from lip_id_ros.dataset.subsets import GUARD
from lip_id_ros.friction.dahl import begins_of_times, dahl_states, Steps
from lip_id_ros.joint_types import is_prismatic

QUANTILE = 0.9
FARTHEST_MOTION, FARTHEST_TORQUE = 20.0, 6.0
"""
Largest velocities and accelerations, and torques about their median, in their 90 % quantiles.
"""

AT_REST, FAST_QUANTILE = 0.01, 0.99
"""An arm whose speed is below a share of that quantile of its speeds rests."""

OF_ONE_REST = 0.25
"""Samples of one rest over those of the motion, at most."""

ZERO, ZERO_S, LEAST_ZEROS = 1e-3, 1.0, 10
"""
Torques that are zero, in their 90 % quantiles; for so long, and in so many samples, they are not
measured.
"""

FARTHEST_RESIDUAL = 12.0
"""Largest residual, in standard deviations as the median residual gives them."""

MOST = 0.15
"""Share of the samples beyond which they are no outliers."""

MOST_COVERED = 10_000
"""Samples among which those are chosen that cover the rest."""

NORMAL_MEDIAN = 0.6745
"""Median absolute value of a standard normal variable."""


def without_long_rests(dataset: Dataset) -> IndexArray:
    """
    Return the rows of the moving arm, and of its rests no more than a few.

    A rest is one measurement, repeated: with all of its samples, those of the motion would be the
    exception, and be left out as absurd. Of each rest at most a quarter as many samples are kept,
    at even distances, as there are of the motion, and of all together as many.
    """
    speed = np.linalg.norm(dataset.dq, axis=1)
    is_rest = speed < AT_REST * np.quantile(speed, FAST_QUANTILE)
    moving = int(np.count_nonzero(~is_rest))
    most = max(1, int(OF_ONE_REST * moving))
    rests = [start + evenly(end - start, most) for start, end in zip(*runs(is_rest), strict=True)]
    rest = np.concatenate([np.empty(0, np.intp), *rests])
    return np.union1d(np.flatnonzero(~is_rest), rest[evenly(rest.size, max(1, moving))])


def measured(dataset: Dataset) -> BoolArray:
    """
    Mark the samples whose torques are measured, shape (N,).

    Not the zeros of drives that are off. There the torques of all of several joints are zero for
    more than a second. The samples beside them, which the low-pass has mixed with zeros, are not
    marked either.
    """
    size = np.abs(dataset.tau)
    is_zero = (size <= ZERO * np.quantile(size, QUANTILE, axis=0)).all(axis=1)
    kept = np.ones_like(is_zero)
    if dataset.n_joints == 1 or is_zero.all():
        return kept
    for first, end in zip(*runs(is_zero), strict=True):
        if end - first >= LEAST_ZEROS and dataset.t[end - 1] - dataset.t[first] > ZERO_S:
            kept[max(0, first - GUARD) : end + GUARD] = False
    return kept


def remembering(dataset: Dataset) -> Dataset:
    """Return samples with the states of Dahl's friction, while none of them are left out."""
    if dataset.dahl_states is not None:
        return dataset
    begins = begins_of_times(dataset.t, dataset.segment)
    steps = Steps.of(dataset.q, dataset.dq, begins, ~is_prismatic(dataset.joint_types))
    return replace(dataset, dahl_states=dahl_states(steps))


def moving(dataset: Dataset) -> Dataset:
    """Return the samples without most of long rests, and without those of drives that are off."""
    awake = dataset.select(without_long_rests(dataset))
    return awake.select(np.flatnonzero(measured(awake)))


def plausible(dataset: Dataset) -> BoolArray:
    """Mark the samples whose motions and torques are of the size of the others', shape (N,)."""
    centred = dataset.tau - np.median(dataset.tau, axis=0)
    kept = _within(centred, FARTHEST_TORQUE)
    for rates in (dataset.dq, dataset.ddq):
        kept &= _within(rates, FARTHEST_MOTION)
    return _if_few(kept)


def explained(residual: Array) -> BoolArray:
    """Mark the samples whose residuals, shape (N, n), are of the size of the others', (N,)."""
    size = np.abs(residual)
    std = np.median(size, axis=0) / NORMAL_MEDIAN
    return _if_few((size <= FARTHEST_RESIDUAL * np.where(std > 0.0, std, np.inf)).all(axis=1))


def _within(values: Array, farthest: float) -> BoolArray:
    size = np.abs(values)
    scale = np.quantile(size, QUANTILE, axis=0)
    return np.asarray((size <= farthest * np.where(scale > 0.0, scale, np.inf)).all(axis=1))


def _if_few(kept: BoolArray) -> BoolArray:
    return kept if np.mean(kept) >= 1.0 - MOST else np.ones_like(kept)


def evenly(count: int, most: int) -> IndexArray:
    """Return row numbers at even distances, at most so many."""
    return np.unique(np.linspace(0, count - 1, min(most, count)).astype(np.intp))


def covering(dataset: Dataset, count: int) -> IndexArray:
    """Return rows that cover positions, velocities and accelerations, in the order of time."""
    if dataset.n_samples > MOST_COVERED:
        rows = evenly(dataset.n_samples, MOST_COVERED)
        return np.asarray(rows[covering(dataset.select(rows), count)])
    return dataset.covering(count)
