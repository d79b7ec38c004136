"""
When the samples of a recording were taken: repeated states, held signals, and truer stamps.

A publisher at a rate above that of its source repeats the newest state. Where all signals repeat
so, the sample holds nothing new; where one signal does, it is a staircase whose steps are late by
half their length on average. Both are mended by interpolation between the samples that are new.
An arm at rest repeats its samples too: these stay, but for those of a publisher that is known,
from the motion, to repeat.

Sensors are mostly read at even steps, while stamps are those of a program that was held up, or of
a network that delivers messages in bursts. Positions decide: an arm moves smoothly, so that at
true times each sample is what its neighbours say.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
import math

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, IntArray
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.joint_samples import SIGNALS
from lip_id_ros.recording.spill import large_array, marked, release, row_blocks, steps
from lip_id_ros.recording.timing import median_step, MOST_STEPS, some_steps

Changes = Mapping[str, BoolArray]
"""Rows at which each recorded signal differs from the row before, shape (N,); the first does."""

LEAST_NEW = 20
"""Fewer new samples show no period of a source."""

MOST_MARKS, BLOCKS = 2**20, 16
"""Samples that a period is the median of, and the blocks that they are taken from."""

LONGEST_HOLD = 1.5
"""A value is a held one for so many periods of its source; it stays the same after that."""

MOVING = 0.4
"""Least displacement over a repetition, in the mean of those of equal times around it."""

LEAST_JITTER = 0.02
"""Stamps that scatter by less than this, in steps, are left as they are."""

LEAST_STEP_S = 1e-6
"""Mean step of a recording whose stamps are looked at."""

CLEARLY = 0.5
"""Positions at other stamps must be so much smoother for these to be taken."""

LARGEST_SHIFT = 2.0
"""Most that a stamp is moved, in steps or silences: another rate is smooth too, and wrong."""

BLOCK_ROWS = 2**13
"""Samples that are compared at once; over more a clock may drift."""

WINDOWS = (64, 512, 4096)
LARGEST_ERROR = 0.05
"""Of the median step as that of the clock: lost messages make it longer."""

RUN = 20
"""Messages over which the mean step of a recording that came in bursts is measured."""


def repeated(values: Array) -> BoolArray:
    """Mark rows that are equal to the one before."""
    same = np.zeros(len(values), bool)
    for block in row_blocks(len(values)):
        first = max(0, block.start - 1)
        some = values[first : block.stop]
        same[first + 1 : block.stop] = (some[1:] == some[:-1]).all(axis=1)
        release(values)
    return same


def changes_of(samples: JointSamples) -> Changes:
    """Compare every row of the signals that were recorded with the row before."""
    recorded = {'velocity': samples.has_velocity, 'effort': samples.has_effort}
    names = (name for name in SIGNALS if recorded.get(name, True))
    return {name: ~repeated(getattr(samples, name)) for name in names}


def changes_between(changes: Changes, keep: BoolArray) -> Changes:
    """Return which signals change from each of the rows that are kept to the next."""
    if keep.all():
        return changes
    rows = np.flatnonzero(keep)
    begins, end = np.append(0, rows[:-1] + 1), rows[-1] + 1
    return {name: np.logical_or.reduceat(new[:end], begins) for name, new in changes.items()}


def stale(samples: JointSamples, changes: Changes) -> BoolArray:
    """
    Mark samples that repeat the one before under a new stamp, shape (N,).

    A sample is stale if position and velocity of all joints are exactly those of the sample
    before although a velocity is not zero. A sample whose effort is repeated too is stale if its
    source is slower than the publisher, as the samples of the moving arm show, or, without
    recorded velocities, if the arm has moved on when the repetition ends. Other repetitions are
    those of an arm at rest.
    """
    same = ~changes['position']
    marks = np.zeros(samples.n_samples, bool)
    if 'velocity' in changes:
        same &= ~changes['velocity']
        marks = same & marked(lambda rows: (rows != 0.0).any(axis=1), samples.velocity)
    if 'effort' in changes:
        same &= ~changes['effort']
    rows = np.flatnonzero(same)
    if rows.size:
        period = source_period(~same, changes['position'])
        marks[rows] |= _is_held(_numbers(rows), period)
        if 'velocity' not in changes:
            marks[rows] |= _moves_on(samples.position, rows)
    return marks


def without_stale(samples: JointSamples) -> tuple[JointSamples, Changes, BoolArray]:
    """Return the samples that are not stale, their changes, and which of all were, (N,)."""
    changes = changes_of(samples)
    is_stale = stale(samples, changes)
    return samples.select(~is_stale), changes_between(changes, ~is_stale), is_stale


def source_period(new: BoolArray, moved: BoolArray) -> int:
    """Return how many samples of a moving arm the source of a signal takes for a new one."""
    new, moved = _some(new), _some(moved)
    rows = np.flatnonzero(new)
    moves = np.diff(np.cumsum(moved)[rows]) > 0
    steps = np.diff(rows)[moves]
    return int(np.median(steps)) if steps.size >= LEAST_NEW else 1


def source_periods(changes: Changes) -> dict[str, int]:
    """Return how many samples each signal takes for a new value, by the median; 1 if each is."""
    moved = changes['position']
    return {name: source_period(new, moved) for name, new in changes.items()}


def supports(new: BoolArray, period: int) -> BoolArray:
    """
    Mark the rows (N,) of a segment that a signal is to be interpolated between.

    `new`: where the signal changes. `period`: samples that its source takes for a new value.
    """
    keep = np.ones(new.size, bool)
    if period > 1:
        rows = np.flatnonzero(~new[1:]) + 1
        keep[rows] = ~_is_held(_numbers(rows), period)
    return keep


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


def evenly_timed(t: Array, longest_shift_s: float) -> Array:
    """
    Replace the stamps (N,) of samples whose source has an even clock of its own.

    Where a publisher repeats the newest state at a rate above that of its source, a sample is up
    to one publishing step older than its stamp, by a different amount each time, and where
    repeated samples were removed the stamps have holes that the motion does not have. If stamps at
    even steps (least squares) lie so close to the given ones, they are the truer ones. Where one
    would have to move further than the publishing step [s], all stay.
    """
    even = _fitted(t, np.arange(t.size))
    return even if np.abs(even - t).max() <= longest_shift_s else t


def retimed(t: Array, position: Array) -> Array:
    """
    Replace stamps by those at even steps where the positions are clearly smoother at these.

    The steps are counted with and without lost messages; what is smoothest is taken.
    """
    if t.size < RUN or not _is_uneven(t):
        return t
    ends = np.linspace(0, t.size, max(1, t.size // BLOCK_ROWS) + 1).astype(int).tolist()
    mended, is_changed = large_array(t.size), False
    for rows in (slice(*each) for each in pairwise(ends)):
        even = _retimed_block(t[rows], position[rows])
        mended[rows] = t[rows] if even is None else even
        is_changed |= even is not None
        release(t, position, mended)
    return mended if is_changed and all((step > 0.0).all() for step in steps(mended)) else t


def _retimed_block(t: Array, position: Array) -> Array | None:
    """Return stamps at even steps for a block; None where those given are good."""
    silence = longest_silence(t)
    trials = [_fitted(t, np.arange(t.size))]
    if not silence:
        trials.append(_fitted(t, _numbered(t)))
    most = LARGEST_SHIFT * (silence or median_step(t))
    trials = [each for each in trials if np.abs(each - t).max() <= most]
    if not trials:
        return None
    rough = [roughness(each, position) for each in trials]
    best = int(np.argmin(rough))
    return trials[best] if rough[best] < CLEARLY * roughness(t, position) else None


def roughness(t: Array, position: Array) -> float:
    """
    Return how far samples lie from the cubic polynomials through their four neighbours.

    The mean over samples of the sum over joints [rad or m].
    """
    around = (-2, -1, 1, 2)
    middle = slice(2, len(t) - 2)
    offset = [t[2 + k : len(t) - 2 + k] - t[middle] for k in around]
    error = position[middle].copy()
    for k, x in zip(around, offset, strict=True):
        others = [y for y in offset if y is not x]
        weight = np.prod([y / (y - x) for y in others], axis=0)
        error -= weight[:, None] * position[2 + k : len(t) - 2 + k]
    return float(np.abs(error).sum(axis=1).mean())


def longest_silence(t: Array) -> float:
    """Return the usual time between bursts of messages [s]; 0 where they do not come in bursts."""
    if t.size <= RUN:
        return 0.0
    some = t[:MOST_STEPS]
    mean = float(np.median(some[RUN:] - some[:-RUN])) / RUN
    if median_step(t) > 0.5 * mean:
        return 0.0
    some = some_steps(t)
    return float(np.median(some[some > mean]))


def _is_uneven(t: Array) -> bool:
    some = some_steps(t)
    mean = float(some.mean())
    return mean > LEAST_STEP_S and float(some.std()) > LEAST_JITTER * mean


def _numbered(t: Array) -> IntArray:
    """Count steps, those of lost messages too: increasing numbers of least squares."""
    count = np.arange(t.size)
    late = t / _clock_step(t) - count
    phase = np.angle(np.exp(2j * np.pi * late).mean()) / (2.0 * np.pi)
    lost = isotonic(late - phase)
    numbers: IntArray = count + np.round(lost).astype(np.int64)
    return numbers


def _clock_step(t: Array) -> float:
    """
    Return the step of the clock that most stamps agree with, lost messages or not.

    The frequency of the largest periodogram of the stamps, first in short windows, then in longer
    ones, which see a smaller part of the frequencies more sharply.
    """
    frequency = 1.0 / median_step(t)
    reach = LARGEST_ERROR * frequency
    for length in (*(each for each in WINDOWS if each < t.size), t.size):
        count = max(1, min(t.size, WINDOWS[-1]) // length)
        windows = t[: count * length].reshape(count, length)
        duration = float(np.median(windows[:, -1] - windows[:, 0]))
        trials = frequency + np.linspace(-reach, reach, 2 * math.ceil(4.0 * reach * duration) + 1)
        power = [np.abs(np.exp(2j * np.pi * each * windows).mean(axis=1)) for each in trials]
        frequency = float(trials[int(np.argmax([np.sum(each**2) for each in power]))])
        reach = 0.5 / duration
    return 1.0 / frequency


def _fitted(t: Array, numbers: IntArray) -> Array:
    if t.size < 2:
        return t
    centred = numbers - numbers.mean()
    step = float(centred @ (t - t.mean()) / (centred @ centred))
    even: Array = t.mean() + step * centred
    return even


def isotonic(values: Array) -> Array:
    """Return the non-decreasing values of least squares; SciPy 1.11 of Ubuntu 24.04 lacks it."""
    means: list[float] = []
    counts: list[int] = []
    for value in values.tolist():
        mean, count = value, 1
        while means and means[-1] >= mean:
            before = counts.pop()
            mean = (means.pop() * before + mean * count) / (before + count)
            count += before
        means.append(mean)
        counts.append(count)
    return np.repeat(np.array(means), counts)
