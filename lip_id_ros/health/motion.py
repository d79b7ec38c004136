"""The smooth motion behind a raw recording, and how its signals lag each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.preprocessing.cleaning import stale
from lip_id_ros.preprocessing.smoothing import (
    cut,
    DERIVATIVES,
    is_long_enough,
    low_pass,
    resample,
    uniform_times,
)
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.joint_samples import SIGNALS
from lip_id_ros.recording.spill import release
from lip_id_ros.recording.timing import GAP_STEPS, median_step
from lip_id_ros.settings import PreprocessingSettings

HIGHEST_RATE_HZ = 100.0
MOST_SAMPLES = 60_000
BLOCKS = 6
LARGEST = 1e100
LONGEST_LAG_S = 0.1

_SETTINGS = PreprocessingSettings()


@dataclass(frozen=True, eq=False)
class Stretch:
    """
    Low-passed samples without a gap, N of n joints.

    Attributes
    ----------
    position, velocity, acceleration : ndarray, shape (N, n)
        The last two are derivatives of the positions.
    recorded_velocity, effort : ndarray, shape (N, n)
        0 where they were not recorded.

    """

    position: Array
    velocity: Array
    acceleration: Array
    recorded_velocity: Array
    effort: Array


@dataclass(frozen=True, eq=False)
class SmoothMotion:
    """Stretches of motion on one sampling rate [Hz]; none where a recording is too short."""

    rate_hz: float
    stretches: tuple[Stretch, ...]

    def joined(self, name: str) -> Array:
        """Return a signal of all stretches one after another."""
        return np.concatenate([getattr(stretch, name) for stretch in self.stretches])


def motion_of(samples: JointSamples) -> SmoothMotion:
    """
    Smooth a recording as a fit would, at 100 Hz or less.

    Of more than `MOST_SAMPLES` samples, blocks from the beginning to the end are looked at.
    Blocks with numbers too large to be calculated with are left out.

    """
    rate, every, stretches = 0.0, 1, []
    step = median_step(samples.t)
    if step > 0.0:
        rate = 1.0 / step
        every = max(1, int(rate / HIGHEST_RATE_HZ))
        for block in _blocks(samples):
            if _is_finite(block):
                stretches += list(_stretches(block, rate, every))
    return SmoothMotion(rate / every, tuple(stretches))


def _blocks(samples: JointSamples) -> Iterator[JointSamples]:
    size = samples.n_samples
    if size <= MOST_SAMPLES:
        yield samples
        return
    length = MOST_SAMPLES // BLOCKS
    for start in np.linspace(0, size - length, BLOCKS).astype(int).tolist():
        yield samples.rows(slice(start, start + length))


def _is_finite(samples: JointSamples) -> bool:
    signals = (samples.position, _or_zero(samples.velocity), _or_zero(samples.effort))
    return all(bool((np.abs(signal) < LARGEST).all()) for signal in signals)


def _stretches(samples: JointSamples, rate: float, every: int) -> Iterator[Stretch]:
    fresh = samples.select(~stale(samples))
    derivative = DERIVATIVES[_SETTINGS.derivative]
    signals = (fresh.position, _or_zero(fresh.velocity), _or_zero(fresh.effort))
    for rows in cut(fresh.t, GAP_STEPS / rate):
        t = fresh.t[rows]
        if not is_long_enough(t, rate, _SETTINGS):
            continue
        times = uniform_times(t, rate)
        position, recorded, effort = (
            low_pass(resample(t, values[rows], times), rate, _SETTINGS.cutoff_hz)
            for values in signals
        )
        velocity = derivative(position, rate)
        yield Stretch(
            *(
                values[::every]
                for values in (position, velocity, derivative(velocity, rate), recorded, effort)
            )
        )
    release(*(getattr(samples, name) for name in SIGNALS))


def _or_zero(values: Array) -> Array:
    return np.zeros_like(values) if np.isnan(values).any() else values


def shifted(stretches: Sequence[Stretch], name: str, reach: int, lag: int) -> Array:
    """Return a signal `lag` samples later, without the first and last `reach` of each stretch."""
    parts = [getattr(stretch, name) for stretch in stretches]
    return np.concatenate([part[reach + lag : len(part) - reach + lag] for part in parts])


def peak(values: Array, rate_hz: float) -> float:
    """
    Return the lag of the largest of 2 reach + 1 values [s], between samples by a parabola.

    nan where the largest lies at an end, since the true one may lie beyond.

    """
    at = int(np.argmax(values))
    if not 0 < at < len(values) - 1:
        return float('nan')
    left, top, right = values[at - 1 : at + 2]
    bend = left - 2.0 * top + right
    between = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return float((at + between - len(values) // 2) / rate_hz)


@dataclass(frozen=True, eq=False)
class Agreement:
    """
    How recorded velocities follow the derivative of the positions, per joint.

    Attributes
    ----------
    scale : ndarray, shape (n,)
        Recorded over differentiated velocity; nan for joints that do not move.
    correlation : ndarray, shape (n,)
        At no delay.
    lag_s : ndarray, shape (n,)
        By how much the recorded velocity comes late [s].

    """

    scale: Array
    correlation: Array
    lag_s: Array


def velocity_agreement(motion: SmoothMotion) -> Agreement:
    """Compare recorded and differentiated velocities."""
    truth, recorded = motion.joined('velocity'), motion.joined('recorded_velocity')
    scale = (truth * recorded).sum(axis=0) / np.square(truth).sum(axis=0)
    correlation = _correlation(truth, recorded)
    return Agreement(scale, correlation, _lag(motion))


def _correlation(first: Array, second: Array) -> Array:
    first, second = first - first.mean(axis=0), second - second.mean(axis=0)
    norms = np.sqrt(np.square(first).sum(axis=0) * np.square(second).sum(axis=0))
    cosine: Array = (first * second).sum(axis=0) / norms
    return cosine


def _lag(motion: SmoothMotion) -> Array:
    reach = max(1, round(LONGEST_LAG_S * motion.rate_hz))
    pieces = [piece for piece in motion.stretches if len(piece.velocity) > 3 * reach]
    if not pieces:
        return np.full(motion.stretches[0].velocity.shape[1], np.nan)
    truth = np.concatenate([piece.velocity[reach:-reach] for piece in pieces])
    alike = np.array(
        [
            np.abs(_correlation(truth, shifted(pieces, 'recorded_velocity', reach, lag)))
            for lag in range(-reach, reach + 1)
        ]
    )
    return np.array([peak(column, motion.rate_hz) for column in alike.T])
