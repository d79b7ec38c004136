"""
Samples that repeat earlier ones under new stamps, and signals that are held between samples.

A publisher at a rate above that of its source repeats the newest state. Where all signals repeat
so, the sample holds nothing new; where one signal does, it is a staircase whose steps are late by
half their length on average. Both are mended by interpolation between the samples that are new.
An arm at rest repeats its samples too: these stay, but for those of a publisher that is known,
from the motion, to repeat.

"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import marked, release, row_blocks

LEAST_NEW = 20
"""Fewer new samples show no period of a source."""

MOST_MARKS, BLOCKS = 2**20, 16
"""Samples that a period is the median of, and the blocks that they are taken from."""

LONGEST_HOLD = 1.5
"""A value is a held one for so many periods of its source; it stays the same after that."""

MOVING = 0.4
"""Least displacement over a repetition, in the mean of those of equal times around it."""


def repeated(values: Array) -> BoolArray:
    """Mark rows that are equal to the one before."""
    same = np.zeros(len(values), bool)
    for block in row_blocks(len(values)):
        first = max(0, block.start - 1)
        some = values[first : block.stop]
        same[first + 1 : block.stop] = (some[1:] == some[:-1]).all(axis=1)
        release(values)
    return same


def stale(samples: JointSamples) -> BoolArray:
    """
    Mark samples that repeat the one before under a new stamp, shape (N,).

    A sample is stale if position and velocity of all joints are exactly those of the sample
    before although a velocity is not zero. A sample whose effort is repeated too is stale if its
    source is slower than the publisher, as the samples of the moving arm show, or, without
    recorded velocities, if the arm has moved on when the repetition ends. Other repetitions are
    those of an arm at rest.

    """
    moved = ~repeated(samples.position)
    motion = ~moved
    marks = np.zeros(samples.n_samples, bool)
    if samples.has_velocity:
        motion &= repeated(samples.velocity)
        marks = motion & marked(lambda rows: (rows != 0.0).any(axis=1), samples.velocity)
    same = motion & repeated(samples.effort) if samples.has_effort else motion
    rows = np.flatnonzero(same)
    if rows.size:
        period = source_period(~same, moved)
        marks[rows] |= _is_held(_numbers(rows), period)
        if not samples.has_velocity:
            marks[rows] |= _moves_on(samples.position, rows)
    return marks


def source_period(new: BoolArray, moved: BoolArray) -> int:
    """Return how many samples of a moving arm the source of a signal takes for a new one."""
    new, moved = _some(new), _some(moved)
    rows = np.flatnonzero(new)
    moves = np.diff(np.cumsum(moved)[rows]) > 0
    steps = np.diff(rows)[moves]
    return int(np.median(steps)) if steps.size >= LEAST_NEW else 1


def source_periods(samples: JointSamples, is_stale: BoolArray | None = None) -> dict[str, int]:
    """
    Return how many samples each signal takes for a new value, by the median; 1 if each is new.

    Parameters
    ----------
    samples : JointSamples
    is_stale : ndarray of bool, shape (N,), optional
        Samples that do not count.

    """
    count = slice(None) if is_stale is None else ~is_stale
    moved = ~repeated(samples.position)[count]
    news = {'position': moved}
    if samples.has_velocity:
        news['velocity'] = ~repeated(samples.velocity)[count]
    if samples.has_effort:
        news['effort'] = ~repeated(samples.effort)[count]
    return {name: source_period(new, moved) for name, new in news.items()}


def supports(values: Array, period: int) -> BoolArray:
    """
    Mark the rows of a signal that are to be interpolated, shape (N,).

    Parameters
    ----------
    values : ndarray, shape (N, n)
    period : int
        Samples that the source of the signal takes for a new value.

    """
    keep = np.ones(len(values), bool)
    if period > 1:
        rows = np.flatnonzero(repeated(values))
        keep[rows] = ~_is_held(_numbers(rows), period)
        keep[-1:] = True
    return keep


def supported(samples: JointSamples, name: str, periods: Mapping[str, int]) -> tuple[Array, Array]:
    """Return times and values of a signal where it is new, to be interpolated between."""
    values = getattr(samples, name)
    rows = supports(values, periods.get(name, 1))
    return samples.t[rows], values[rows]


def _some(marks: BoolArray) -> BoolArray:
    """Return all marks, or of very many some blocks from the beginning to the end."""
    if marks.size <= MOST_MARKS:
        return marks
    length = MOST_MARKS // BLOCKS
    starts = np.linspace(0, marks.size - length, BLOCKS).astype(int).tolist()
    return np.concatenate([marks[start : start + length] for start in starts])


def _is_held(numbers: IndexArray, period: int) -> BoolArray:
    held: BoolArray = numbers % int(LONGEST_HOLD * period) != 0
    return held


def _numbers(rows: IndexArray) -> IndexArray:
    """Return the place of each repeated row in its repetition, from 1 on."""
    index = np.arange(rows.size)
    begins = np.diff(rows, prepend=-2) > 1
    numbers: IndexArray = index - np.maximum.accumulate(np.where(begins, index, 0)) + 1
    return numbers


def _moves_on(position: Array, rows: IndexArray) -> BoolArray:
    """Mark the rows of repetitions during which the arm has moved about as before and after."""
    begins = np.flatnonzero(np.diff(rows, prepend=-2) > 1)
    ends = np.append(begins[1:], rows.size) - 1
    last, following = rows[begins] - 1, np.minimum(rows[ends] + 1, len(position) - 1)
    length = following - last
    before = np.maximum(last - length, 0)
    after = np.minimum(following + length, len(position) - 1)

    def way(start: IndexArray, stop: IndexArray) -> Array:
        return np.asarray(np.linalg.norm(position[stop] - position[start], axis=1))

    within, around = way(last, following), way(before, last) + way(following, after)
    moves = (within > 0.0) & (within >= 0.5 * MOVING * around)
    return np.repeat(moves, ends - begins + 1)
