"""A recording cleaned: stale samples removed, efforts as torques, cut at gaps, stamps mended."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import DataError
from lip_id_ros.preprocessing.cleaning import per_joint, torque
from lip_id_ros.preprocessing.repetition import source_periods, stale
from lip_id_ros.preprocessing.smoothing import cut, longest_step
from lip_id_ros.preprocessing.stamps import evenly_timed, longest_silence, retimed
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.timing import GAP_STEPS, median_step, MOST_STEPS, some_steps
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

MOST_RATE = 2.0
"""Samples are brought to a rate of at most so many times their mean rate."""


@dataclass(frozen=True, eq=False)
class Segments:
    """
    A recording before it is smoothed.

    Attributes
    ----------
    fresh : JointSamples
        Without stale samples, efforts as torques.
    segments : tuple of JointSamples
        `fresh` between its gaps, stamps mended.
    rate_hz : float
        Of the uniform grid that the segments are brought to.
    delays_s : tuple of n floats
        How much later than positions the efforts of each joint were measured.
    periods : mapping
        Samples that each signal takes for a new value (`repetition.source_periods`).
    stale : int
        Samples left out.
    retimed : bool
        Whether stamps were mended.

    """

    fresh: JointSamples
    segments: tuple[JointSamples, ...]
    rate_hz: float
    delays_s: tuple[float, ...]
    periods: Mapping[str, int]
    stale: int
    retimed: bool

    @property
    def largest_delay_s(self) -> float:
        """The largest delay of an effort, in either direction."""
        return max(map(abs, self.delays_s))

    @property
    def longest_hold(self) -> int:
        """Samples over which a signal may be held."""
        return max(self.periods.values())


def segments_of(
    samples: JointSamples, settings: PreprocessingSettings, recording: RecordingSettings
) -> Segments:
    """
    Remove stale samples, scale efforts to torques, cut at gaps and mend stamps.

    Raises
    ------
    SourceError
        If no effort was recorded.
    ConfigError
        If a setting per joint has another length than there are joints.
    DataError
        If there are fewer than two different samples.

    """
    is_stale = stale(samples)
    fresh = samples.select(~is_stale)
    if fresh.n_samples < 2:
        raise DataError(
            f'{fresh.source} must hold at least two different samples, but has '
            f'{fresh.n_samples}; record while the arm moves.'
        )
    fresh = replace(fresh, effort=torque(fresh, recording))
    spread = _spread(fresh)
    given = cut(spread.t, settings.max_gap_s or longest_step(spread.t, settings.cutoff))
    recorded = [spread.rows(rows) for rows in given]
    segments = tuple(_retimed(segment, samples.t, is_stale) for segment in recorded)
    changed = any(one is not other for one, other in zip(segments, recorded, strict=True))
    return Segments(
        spread,
        segments,
        _rate(segments),
        per_joint(samples, 'effort_delay_s', recording.effort_delay_s, 0.0),
        source_periods(fresh),
        int(is_stale.sum()),
        changed or spread is not fresh,
    )


def _spread(samples: JointSamples) -> JointSamples:
    """Spread messages that came in bursts evenly, where positions bear that out."""
    silence = longest_silence(samples.t)
    if not silence:
        return samples
    parts = [samples.rows(rows) for rows in cut(samples.t, GAP_STEPS * silence)]
    t = np.concatenate([retimed(part.t, part.position) for part in parts])
    is_changed = (t != samples.t).any() and (np.diff(t) > 0.0).all()
    return replace(samples, t=t) if is_changed else samples


def _retimed(segment: JointSamples, t: Array, is_stale: BoolArray) -> JointSamples:
    """Mend the stamps of a segment, given those of all samples and which were left out."""
    first, last = np.searchsorted(t, segment.t[[0, -1]])
    even = segment.t
    if is_stale[first:last].any():
        even = evenly_timed(even, median_step(t))
    if even is segment.t:
        even = retimed(even, segment.position)
    return segment if even is segment.t else replace(segment, t=even)


def _rate(segments: Sequence[JointSamples]) -> float:
    """Return the rate of most steps [Hz]; no more than twice the mean, as messages in bursts."""
    count = sum(segment.n_samples - 1 for segment in segments)
    if not count:
        return 0.0
    total = sum(float(segment.t[-1] - segment.t[0]) for segment in segments)
    share = min(1.0, MOST_STEPS / count)
    steps = [some_steps(segment.t, round(share * segment.n_samples)) for segment in segments]
    return min(1.0 / float(np.median(np.concatenate(steps))), MOST_RATE * count / total)
