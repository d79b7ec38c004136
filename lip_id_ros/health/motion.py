"""The smooth motion behind a raw recording, in comparable pieces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.preprocessing.cleaning import chosen, stale
from lip_id_ros.preprocessing.segments import cut, is_long_enough, Piece, smooth
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.timing import GAP_STEPS, median_step
from lip_id_ros.settings import PreprocessingSettings

HIGHEST_RATE_HZ = 100.0
MOST_SAMPLES = 60_000
BLOCKS = 6
LARGEST = 1e100

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
class Motion:
    """Stretches of motion on one sampling rate [Hz]; none where a recording is too short."""

    rate_hz: float
    stretches: tuple[Stretch, ...]

    def joined(self, name: str) -> Array:
        """Return a signal of all stretches one after another."""
        return np.concatenate([getattr(stretch, name) for stretch in self.stretches])


def motion_of(samples: JointSamples) -> Motion:
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
    return Motion(rate / every, tuple(stretches))


def _blocks(samples: JointSamples) -> Iterator[JointSamples]:
    size = samples.n_samples
    if size <= MOST_SAMPLES:
        yield samples
        return
    length = MOST_SAMPLES // BLOCKS
    for start in np.linspace(0, size - length, BLOCKS).astype(int):
        rows = np.zeros(size, bool)
        rows[start : start + length] = True
        yield chosen(samples, rows)


def _is_finite(samples: JointSamples) -> bool:
    signals = (samples.position, _or_zero(samples.velocity), _or_zero(samples.effort))
    return all(bool((np.abs(signal) < LARGEST).all()) for signal in signals)


def _stretches(samples: JointSamples, rate: float, every: int) -> Iterator[Stretch]:
    fresh = chosen(samples, ~stale(samples))
    n = samples.n_joints
    signals = np.concatenate([_or_zero(fresh.velocity), _or_zero(fresh.effort)], axis=1)
    whole = Piece(fresh.t, fresh.position, None, signals)
    for piece in cut(whole, GAP_STEPS / rate):
        if not is_long_enough(piece, rate, _SETTINGS):
            continue
        moved = smooth(piece, rate, _SETTINGS).rows(slice(None, None, every))
        velocity, effort = moved.tau[:, :n], moved.tau[:, n:]
        yield Stretch(moved.q, moved.dq, moved.ddq, velocity, effort)


def _or_zero(values: Array) -> Array:
    return np.zeros_like(values) if np.isnan(values).any() else values
