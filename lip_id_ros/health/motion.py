"""The smooth motion behind a recording, and how recorded velocities follow it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.preprocessing.sample_times import source_periods, without_stale
from lip_id_ros.preprocessing.segment import segment_of
from lip_id_ros.preprocessing.segments import uninterrupted
from lip_id_ros.preprocessing.smoothing import (
    DERIVATIVES,
    is_long_enough,
    longest_step,
    low_pass,
    uniform_times,
)
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.joint_samples import SIGNALS
from lip_id_ros.recording.spill import release, some_blocks
from lip_id_ros.recording.timing import median_step
from lip_id_ros.settings import PreprocessingSettings

HIGHEST_RATE_HZ = 100.0
MOST_SAMPLES = 60_000
BLOCKS = 6
LARGEST = 1e100
LONGEST_LAG_S = 0.1

_SETTINGS = PreprocessingSettings()


@dataclass(frozen=True, eq=False)
class SmoothSegment:
    """
    Low-passed samples without a gap, each (N, n); velocity and acceleration from positions.

    `recorded_velocity` and `effort` are 0 where they were not recorded.
    """

    position: Array
    velocity: Array
    acceleration: Array
    recorded_velocity: Array
    effort: Array


@dataclass(frozen=True, eq=False)
class SmoothMotion:
    """Segments of motion on one sampling rate [Hz]; none where a recording is too short."""

    rate_hz: float
    segments: tuple[SmoothSegment, ...]

    def joined(self, name: str) -> Array:
        """Return a signal of all segments one after another."""
        return np.concatenate([getattr(segment, name) for segment in self.segments])


def motion_of(samples: JointSamples) -> SmoothMotion:
    """
    Smooth a recording as a fit would, at 100 Hz or less.

    Of more than `MOST_SAMPLES` samples, blocks from the beginning to the end are looked at.
    Blocks with numbers too large to be calculated with are left out.
    """
    rate, every, segments = 0.0, 1, []
    step = median_step(samples.t)
    if step > 0.0:
        rate = 1.0 / step
        every = max(1, int(rate / HIGHEST_RATE_HZ))
        for rows in some_blocks(samples.n_samples, MOST_SAMPLES, BLOCKS):
            block = samples.rows(rows)
            if _is_finite(block):
                segments += list(_smooth_segments(block, rate, every))
    return SmoothMotion(rate / every, tuple(segments))


def _is_finite(samples: JointSamples) -> bool:
    signals = (samples.position, _or_zero(samples.velocity), _or_zero(samples.effort))
    return all(bool((np.abs(signal) < LARGEST).all()) for signal in signals)


def _smooth_segments(samples: JointSamples, rate: float, every: int) -> Iterator[SmoothSegment]:
    fresh, changes, _ = without_stale(samples)
    derivative = DERIVATIVES[_SETTINGS.derivative]
    periods = source_periods(changes)
    fresh = replace(fresh, velocity=_or_zero(fresh.velocity), effort=_or_zero(fresh.effort))
    longest_s = longest_step(fresh.t, _SETTINGS.cutoff)
    for rows in uninterrupted(fresh, changes, periods, longest_s)[0]:
        if not is_long_enough(fresh.t[rows], rate, _SETTINGS):
            continue
        segment = segment_of(fresh, rows, changes, periods, rate)
        segment = segment.uniform(uniform_times(segment.t, rate))
        position, recorded, effort = (
            low_pass(getattr(segment, name), rate, _SETTINGS.cutoff) for name in SIGNALS
        )
        velocity = derivative(position, rate)
        yield SmoothSegment(
            *(
                values[::every]
                for values in (position, velocity, derivative(velocity, rate), recorded, effort)
            )
        )
    release(*(getattr(samples, name) for name in SIGNALS))


def _or_zero(values: Array) -> Array:
    return np.zeros_like(values) if np.isnan(values).any() else values


def shifted(segments: Sequence[SmoothSegment], name: str, reach: int, lag: int) -> Array:
    """Return a signal `lag` samples later, without the first and last `reach` of each segment."""
    parts = [getattr(segment, name) for segment in segments]
    return np.concatenate([part[reach + lag : len(part) - reach + lag] for part in parts])


def peak(values: Array, rate_hz: float) -> float:
    """Return the lag [s] of the largest of 2 reach + 1 values, by a parabola; nan if at an end."""
    at = int(np.argmax(values))
    if not 0 < at < len(values) - 1:
        return float('nan')
    left, top, right = values[at - 1 : at + 2]
    bend = left - 2.0 * top + right
    between = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return float((at + between - len(values) // 2) / rate_hz)


@dataclass(frozen=True, eq=False)
class VelocityAgreement:
    """
    How recorded velocities follow the derivative of the positions, per joint (n,).

    `scale` is recorded over differentiated velocity, nan for joints that do not move;
    `correlation` is that at no delay; `lag_s` is by how much the recorded velocity comes late [s].
    """

    scale: Array
    correlation: Array
    lag_s: Array


def velocity_agreement(motion: SmoothMotion) -> VelocityAgreement:
    """Compare recorded and differentiated velocities."""
    truth, recorded = motion.joined('velocity'), motion.joined('recorded_velocity')
    scale = (truth * recorded).sum(axis=0) / np.square(truth).sum(axis=0)
    correlation = _correlation(truth, recorded)
    return VelocityAgreement(scale, correlation, _lag(motion))


def _correlation(first: Array, second: Array) -> Array:
    first, second = first - first.mean(axis=0), second - second.mean(axis=0)
    norms = np.sqrt(np.square(first).sum(axis=0) * np.square(second).sum(axis=0))
    cosine: Array = (first * second).sum(axis=0) / norms
    return cosine


def _lag(motion: SmoothMotion) -> Array:
    reach = max(1, round(LONGEST_LAG_S * motion.rate_hz))
    pieces = [piece for piece in motion.segments if len(piece.velocity) > 3 * reach]
    if not pieces:
        return np.full(motion.segments[0].velocity.shape[1], np.nan)
    truth = np.concatenate([piece.velocity[reach:-reach] for piece in pieces])
    alike = np.array(
        [
            np.abs(_correlation(truth, shifted(pieces, 'recorded_velocity', reach, lag)))
            for lag in range(-reach, reach + 1)
        ]
    )
    return np.array([peak(column, motion.rate_hz) for column in alike.T])
