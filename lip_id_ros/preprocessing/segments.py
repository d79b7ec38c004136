"""One uninterrupted piece of motion: smoothed, differentiated, its edges cut off."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.preprocessing.derivatives import DERIVATIVES, MIN_SAMPLES
from lip_id_ros.preprocessing.filters import edge_length, low_pass
from lip_id_ros.preprocessing.resampling import resample, uniform_times
from lip_id_ros.recording.timing import gap_starts
from lip_id_ros.settings import PreprocessingSettings


@dataclass(frozen=True, eq=False)
class Piece:
    """Raw samples between two gaps; velocity is None where it was not recorded."""

    t: Array
    position: Array
    velocity: Array | None
    torque: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """Smooth uniform samples of one segment, each array with N rows."""

    t: Array
    q: Array
    dq: Array
    ddq: Array
    tau: Array

    def rows(self, chosen: slice) -> Motion:
        """Return some of the samples."""
        return Motion(
            self.t[chosen], self.q[chosen], self.dq[chosen], self.ddq[chosen], self.tau[chosen]
        )


def cut(whole: Piece, max_gap_s: float) -> list[Piece]:
    """Cut samples at every step longer than `max_gap_s` [s]."""
    ends = [*(gap_starts(whole.t, max_gap_s) + 1), whole.t.size]
    starts = [0, *ends[:-1]]
    return [_part(whole, slice(start, end)) for start, end in zip(starts, ends, strict=True)]


def evenly_timed(piece: Piece, longest_shift_s: float) -> Piece:
    """
    Replace the stamps of samples whose source has an even clock of its own.

    Where a publisher repeats the newest state at a rate above that of its source, a sample is up
    to one publishing step older than its stamp says, by a different amount each time, and where
    repeated samples were removed the stamps have holes that the motion does not have. If stamps
    at even steps (least squares) lie so close to the given ones, they are the truer ones.

    Parameters
    ----------
    piece : Piece
        Without its repeated samples.
    longest_shift_s : float
        The publishing step [s]; where a stamp would have to move further, all stay as they are.

    """
    numbers = np.arange(piece.t.size)
    step, start = np.polyfit(numbers, piece.t, 1) if piece.t.size > 1 else (0.0, piece.t[0])
    even: Array = start + step * numbers
    if np.abs(even - piece.t).max() > longest_shift_s:
        return piece
    return replace(piece, t=even)


def is_long_enough(piece: Piece, rate_hz: float, settings: PreprocessingSettings) -> bool:
    """Whether a piece lasts as long as the settings ask, and leaves samples between its edges."""
    if piece.t.size < 2:
        return False
    duration = float(piece.t[-1] - piece.t[0])
    edges = 2 * edge_length(rate_hz, settings.cutoff_hz, settings.edge_periods)
    return duration >= settings.min_segment_s and duration * rate_hz >= max(edges, MIN_SAMPLES)


def smooth(piece: Piece, rate_hz: float, settings: PreprocessingSettings) -> Motion:
    """
    Bring a piece to uniform steps, low-pass all signals alike and differentiate.

    The same low-pass goes over positions, velocities and torques, so that none of them lags or
    loses content against the others; the acceleration is the derivative of the smooth velocity.

    """
    times = uniform_times(piece.t, rate_hz)

    def smoothed(values: Array) -> Array:
        return low_pass(resample(piece.t, values, times), rate_hz, settings.cutoff_hz)

    derivative = DERIVATIVES[settings.derivative]
    q = smoothed(piece.position)
    dq = derivative(q, rate_hz) if piece.velocity is None else smoothed(piece.velocity)
    return Motion(times, q, dq, derivative(dq, rate_hz), smoothed(piece.torque))


def joined(motions: list[Motion]) -> Motion:
    """Return the samples of several segments one after another."""
    return Motion(
        *(np.concatenate([getattr(motion, name) for motion in motions]) for name in _FIELDS)
    )


_FIELDS = ('t', 'q', 'dq', 'ddq', 'tau')


def _part(whole: Piece, rows: slice) -> Piece:
    velocity = None if whole.velocity is None else whole.velocity[rows]
    return Piece(whole.t[rows], whole.position[rows], velocity, whole.torque[rows])
