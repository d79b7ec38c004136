"""
Positions that jump, efforts that spike, and velocities that are not those of the positions.

A joint without stops is reported within one turn, and its position jumps by a turn where it leaves
that range: these jumps are undone. At other jumps (trials written one after another, an encoder
that misread) motion is cut. Velocities that a driver leaves at zero, or reports in another unit or
with another sign, differ from the changes of the positions when they are integrated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
import math

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray, runs
from lip_id_ros.errors import DataError
from lip_id_ros.preprocessing.sample_times import longest_silence
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import (
    extent,
    large_array,
    marked,
    release,
    row_blocks,
    some_blocks,
    thinned,
)
from lip_id_ros.recording.timing import median_step

TURN = 2.0 * math.pi
LEAST_WRAP = 0.75
"""Least jump of a position that is reported within one turn, in turns."""
MOST_REACH = 1.01
"""Range of such a position, in turns."""

MOST_TURNS = 5.0
"""Most joints of an arm never turn so far."""

LEAST_JUMP = 0.05
"""A smaller step may be that of a coarse encoder [rad or m]."""
LEAST_ACCELERATION = 300.0
LONE = 10.0
"""A jump is so many times faster than the motion before and after it."""
BESIDE = (-3, -2, 2, 3)
"""Steps that a jump is compared with: where an encoder misreads, the next one is a jump too."""

OUTLIER_PERCENT, OUTLIER_RANGES, LEAST_RANGE = 1.0, 10.0, 1e-3
MOST_VALUES = 2**18
LONGEST_SPIKE = 3

WINDOW_S = 0.25
"""Changes of position are compared over a period of the usual low-pass."""
LEAST_LENGTH = 25
"""Samples of such a period at least, since the unit of the times may be wrong."""
LEAST_WAY = 0.01
LEAST_WINDOWS = 20
ALIKE = 0.7
LEAST_SCALE, MOST_SCALE = 0.92, 1.08
PROPORTIONAL = 0.95
UNIT_TOLERANCE = 0.05
MOST_ROWS, BLOCKS = 2**16, 16

WRONG_UNITS: Mapping[float, tuple[str, str]] = {
    1e3: ('times in s', 'ms'),
    1e6: ('times in s', 'us'),
    1e9: ('times in s', 'ns'),
    math.pi / 180.0: ('positions in rad', 'degrees'),
}
"""By the velocities of all joints over the changes of their positions: expected, and what came."""


def unwrapped(samples: JointSamples, is_revolute: BoolArray, longest_s: float) -> JointSamples:
    """
    Undo the jumps by whole turns of revolute joints that are reported within one turn.

    A step of more than `longest_s` is a gap, after which positions are those recorded.
    """
    if not samples.n_samples:
        return samples
    reach = np.subtract(*extent(samples.position)[::-1])
    within = is_revolute & (reach > LEAST_WRAP * TURN) & (reach <= MOST_REACH * TURN)
    if not any(turns.any() for _, turns in _turns(samples, within, longest_s)):
        return samples
    position = large_array(*samples.position.shape)
    for rows, turns in _turns(samples, within, longest_s):
        position[rows] = samples.position[rows] - TURN * turns
        release(samples.position, position)
    return replace(samples, position=position)


def _turns(
    samples: JointSamples, within: BoolArray, longest_s: float
) -> Iterator[tuple[slice, Array]]:
    """Yield blocks of rows and the turns made since the last gap, (K, n)."""
    if not within.any():
        return
    total = np.zeros(samples.n_joints)
    for rows in row_blocks(samples.n_samples):
        before = np.maximum(np.arange(rows.start, rows.stop) - 1, 0)
        step = samples.position[rows] - samples.position[before]
        is_gap = samples.t[rows] - samples.t[before] > longest_s
        is_jump = within & ~is_gap[:, np.newaxis] & (np.abs(step) > LEAST_WRAP * TURN)
        turns = total + np.cumsum(np.where(is_jump, np.sign(step), 0.0), axis=0)
        last_gap = np.maximum.accumulate(np.where(is_gap, np.arange(is_gap.size), -1))
        turns -= np.where(last_gap[:, np.newaxis] >= 0, turns[last_gap], 0.0)
        yield rows, turns
        total = turns[-1]
        release(samples.position, samples.t)


def jumps(samples: JointSamples, new: BoolArray, period: int) -> IndexArray:
    """
    Return the rows before which a position jumps as no arm moves.

    `new`, shape (N,): where positions differ from those before. `period`: samples that they take
    for new values.
    """
    least_s = max(median_step(samples.t), longest_silence(samples.t))
    margin = 2 * BESIDE[-1] * period
    found = [np.empty(0, np.intp)]
    for block in row_blocks(samples.n_samples):
        first, last = max(0, block.start - margin), min(samples.n_samples, block.stop + margin)
        rows = first + np.flatnonzero(new[first:last])
        at = rows[1:][_is_jump(samples.t[rows], samples.position[rows], least_s)]
        found.append(at[(at >= block.start) & (at < block.stop)])
        release(samples.position, samples.t)
    return np.concatenate(found)


def _is_jump(t: Array, position: Array, least_s: float) -> BoolArray:
    """Mark steps far faster than those beside them, which no drive could accelerate to."""
    step = np.abs(np.diff(position, axis=0))
    duration = np.maximum(np.diff(t), least_s)[:, np.newaxis]
    speed = step / duration
    margin = BESIDE[-1]
    padded = np.pad(speed, ((margin, margin), (0, 0)))
    beside = np.max([padded[margin + k : margin + k + len(speed)] for k in BESIDE], axis=0)
    is_fast = (speed > LEAST_ACCELERATION * duration) & (speed > LONE * beside)
    jumping: BoolArray = (is_fast & (step > LEAST_JUMP)).any(axis=1)
    return jumping


def contradicted(samples: JointSamples) -> tuple[str, ...]:
    """Return the joints whose recorded velocities are not the changes of their positions."""
    scale, cosine = velocity_scales(samples)
    agree = (cosine >= ALIKE) & (scale >= LEAST_SCALE) & (scale <= MOST_SCALE)
    is_wrong = np.isfinite(scale) & ~agree
    return tuple(np.array(samples.joint_names, object)[is_wrong].tolist())


def refuse_absurd_ranges(samples: JointSamples) -> None:
    """Raise a DataError if most joints turn as those of no arm do."""
    reach = np.subtract(*extent(samples.position)[::-1])
    if samples.n_joints > 1 and (reach > MOST_TURNS * TURN).mean() > 0.5:
        raise DataError(
            f'{samples.source} must have positions in rad, but most joints turn by more than '
            f'{MOST_TURNS:g} turns, as if they were in degrees; convert them.'
        )


def refuse_wrong_units(samples: JointSamples) -> None:
    """Raise a DataError if velocities show that times or positions have another unit."""
    scale, cosine = velocity_scales(samples)
    known = np.isfinite(scale)
    for factor, (expected, unit) in WRONG_UNITS.items():
        alike = (np.abs(scale / factor - 1.0) < UNIT_TOLERANCE) & (cosine > PROPORTIONAL)
        if known.any() and alike[known].all():
            raise DataError(
                f'{samples.source} must have {expected}, but its velocities are {factor:.4g} '
                f'times the changes of its positions, as if these were in {unit}; convert them.'
            )


def usual_range(values: Array) -> tuple[float, float, float]:
    """Return the 1 and 99 % quantiles of values (N,), and how far beyond these lie outliers."""
    some = thinned(values, MOST_VALUES)
    low = float(np.percentile(some, OUTLIER_PERCENT, method='higher'))
    high = float(np.percentile(some, 100.0 - OUTLIER_PERCENT, method='lower'))
    return low, high, OUTLIER_RANGES * max(high - low, LEAST_RANGE)


def spikes(efforts: Array) -> BoolArray:
    """Mark the samples with outliers among efforts, shape (N, n), that last three at most."""
    ranges = [usual_range(column) for column in efforts.T]
    low, high = np.array([(least - reach, most + reach) for least, most, reach in ranges]).T
    marks = marked(lambda rows: ((rows < low) | (rows > high)).any(axis=1), efforts)
    for start, end in zip(*runs(marks), strict=True):
        marks[start:end] = end - start <= LONGEST_SPIKE
    return marks


def velocity_scales(samples: JointSamples) -> tuple[Array, Array]:
    """
    Return integrals of velocities over changes of positions, and the cosine between both, (n,).

    They are nan for joints that hardly move.
    """
    least_s = max(median_step(samples.t), longest_silence(samples.t))
    length = max(LEAST_LENGTH, round(WINDOW_S / least_s) if least_s > 0.0 else 0)
    sums = np.zeros((4, samples.n_joints))
    for rows in some_blocks(samples.n_samples, MOST_ROWS, BLOCKS):
        t, position = samples.t[rows], samples.position[rows]
        if t.size > length:
            way = position[length:] - position[:-length]
            integral = _integral(t, samples.velocity[rows])
            driven = integral[length:] - integral[:-length]
            is_whole = t[length:] - t[:-length] < 2.0 * length * least_s
            moves = is_whole[:, np.newaxis] & (np.abs(way) > LEAST_WAY)
            terms = (np.ones_like(way), way**2, way * driven, driven**2)
            sums += [np.where(moves, term, 0.0).sum(axis=0) for term in terms]
        release(samples.t, samples.position, samples.velocity)
    count, ways, both, squares = sums
    with np.errstate(divide='ignore', invalid='ignore'):
        scale = np.where(count >= LEAST_WINDOWS, both / ways, np.nan)
        cosine = both / np.sqrt(ways * squares)
    return scale, cosine


def _integral(t: Array, velocity: Array) -> Array:
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * np.diff(t)[:, np.newaxis]
    return np.concatenate([np.zeros((1, velocity.shape[1])), np.cumsum(steps, axis=0)])
