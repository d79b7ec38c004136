"""
From raw joint samples to a data set.

Stale samples removed, efforts scaled to torques, cut at gaps, stamps mended where stale samples
made them late, each segment brought to uniform steps, low-passed, differentiated, cut at its edges
and decimated; every sample left out is counted in the provenance.

"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.preprocessing.cleaning import (
    content_digest,
    per_joint,
    quantum,
    repeated,
    stale,
    torque,
)
from lip_id_ros.preprocessing.selection import at_most, stride
from lip_id_ros.preprocessing.smoothing import (
    cut,
    DERIVATIVES,
    edge_length,
    evenly_timed,
    grid_size,
    is_filtered,
    is_long_enough,
    low_pass,
    resample,
    resample_early,
    Window,
    windows,
)
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.spill import release
from lip_id_ros.recording.timing import GAP_STEPS, median_step, MOST_STEPS, some_steps
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

STALE = 'sample stale'
SHORT_SEGMENT = 'segment too short'
EDGE = 'edge of a segment'
DECIMATED = 'decimated'

MOST_RATE = 2.0
"""Samples are brought to a rate of at most so many times their mean rate."""


def preprocess(
    samples: JointSamples | Sequence[JointSamples],
    settings: PreprocessingSettings | None = None,
    recording: RecordingSettings | None = None,
) -> Dataset:
    """
    Make a data set of one or several recordings.

    Parameters
    ----------
    samples : JointSamples or sequence of them
        Recordings of the same joints.
    settings : PreprocessingSettings
        Filter, gaps, decimation.
    recording : RecordingSettings
        Joint types, effort scale and offset, gravity compensation.

    Returns
    -------
    Dataset
        Its provenance lists, for each source, the settings and how many samples were dropped
        for which reason.

    Raises
    ------
    SourceError
        If no effort was recorded.
    ConfigError
        If a setting per joint has another length than there are joints.
    DataError
        If too little is left, or the recordings have different joints.

    """
    settings = settings or PreprocessingSettings()
    recording = recording or RecordingSettings()
    recordings = [samples] if isinstance(samples, JointSamples) else samples
    data = concatenate([_recording(each, settings, recording) for each in recordings])
    return at_most(data, settings)


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
    stale : int
        Samples left out.
    retimed : bool
        Whether stamps were mended.

    """

    fresh: JointSamples
    segments: tuple[JointSamples, ...]
    rate_hz: float
    delays_s: tuple[float, ...]
    stale: int
    retimed: bool

    @property
    def largest_delay_s(self) -> float:
        """The largest delay of an effort, in either direction."""
        return max(map(abs, self.delays_s))


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
    given = cut(fresh.t, settings.max_gap_s or GAP_STEPS * median_step(fresh.t))
    repeats, step = samples.t[is_stale], median_step(samples.t)
    recorded = [fresh.rows(rows) for rows in given]
    segments = tuple(_retimed(segment, repeats, step) for segment in recorded)
    return Segments(
        fresh,
        segments,
        _rate(segments),
        per_joint(samples, 'effort_delay_s', recording.effort_delay_s, 0.0),
        int(is_stale.sum()),
        any(one is not other for one, other in zip(segments, recorded, strict=True)),
    )


def _recording(
    samples: JointSamples, settings: PreprocessingSettings, recording: RecordingSettings
) -> Dataset:
    raw = segments_of(samples, settings, recording)
    dropped = Counter(samples.counts)
    dropped[STALE] = raw.stale
    motions = _motions(raw, settings, dropped)
    if not motions:
        raise DataError(_too_short(samples.source, raw, settings))
    provenance = _provenance(samples, raw.rate_hz, settings, dropped)
    provenance['repeated'] = _repetition(raw.fresh)
    provenance['segments'] = len(motions)
    provenance['retimed'] = raw.retimed
    provenance['recording'] = asdict(recording)
    return Dataset(
        **{name: np.concatenate([motion[name] for motion in motions]) for name in motions[0]},
        joint_names=samples.joint_names,
        joint_types=per_joint(samples, 'joint_types', recording.joint_types, 'revolute'),
        segment=np.repeat(np.arange(len(motions)), [motion['t'].size for motion in motions]),
        gravity_compensated=recording.gravity_compensated,
        provenance={'sources': [provenance]},
    )


def uses_velocity(samples: JointSamples, settings: PreprocessingSettings) -> bool:
    """Whether recorded velocities are used."""
    return samples.has_velocity and settings.velocity == 'recorded'


def _retimed(segment: JointSamples, repeats: Array, step: float) -> JointSamples:
    """Mend the stamps of a segment within which samples were repeated."""
    first = np.searchsorted(repeats, segment.t[0], side='right')
    if first == np.searchsorted(repeats, segment.t[-1]):
        return segment
    t = evenly_timed(segment.t, step)
    return segment if t is segment.t else replace(segment, t=t)


def _rate(segments: Sequence[JointSamples]) -> float:
    """Return the rate of most steps [Hz]; no more than twice the mean, as messages in bursts."""
    count = sum(segment.n_samples - 1 for segment in segments)
    if not count:
        return 0.0
    total = sum(float(segment.t[-1] - segment.t[0]) for segment in segments)
    share = min(1.0, MOST_STEPS / count)
    steps = [some_steps(segment.t, round(share * segment.n_samples)) for segment in segments]
    return min(1.0 / float(np.median(np.concatenate(steps))), MOST_RATE * count / total)


def _motions(
    raw: Segments, settings: PreprocessingSettings, dropped: Counter[str]
) -> list[dict[str, Array]]:
    rate, delay = raw.rate_hz, raw.largest_delay_s
    edge = edge_length(rate, settings.cutoff, settings.edge_periods, delay)
    every = stride(rate, settings)
    motions = []
    for segment in raw.segments:
        if not is_long_enough(segment.t, rate, settings, delay):
            dropped[SHORT_SEGMENT] += segment.n_samples
            continue
        kept = range(edge, grid_size(segment.t, rate) - edge, every)
        parts = [
            _smooth(segment, window, raw, settings, kept)
            for window in windows(segment.t, rate, settings.cutoff, delay)
        ]
        motions.append({name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
        dropped[EDGE] += 2 * edge
        dropped[DECIMATED] += kept.stop - kept.start - len(kept)
    return motions


def _smooth(
    segment: JointSamples,
    window: Window,
    raw: Segments,
    settings: PreprocessingSettings,
    kept: range,
) -> dict[str, Array]:
    """Bring a window to uniform steps, low-pass all signals alike and differentiate."""
    samples = segment.rows(window.rows)
    recorded = uses_velocity(segment, settings)
    q, dq, ddq = smooth_motion(
        resample(samples.t, samples.position, window.times),
        resample(samples.t, samples.velocity, window.times) if recorded else None,
        raw.rate_hz,
        settings,
    )
    effort = resample_early(samples.t, samples.effort, window.times, raw.delays_s)
    tau = low_pass(effort, raw.rate_hz, settings.cutoff)
    motion = {'t': window.times, 'q': q, 'dq': dq, 'ddq': ddq, 'tau': tau}
    release(segment.position, segment.velocity, segment.effort)
    before = max(0, -((kept.start - window.start) // kept.step))
    numbers = range(kept.start + before * kept.step, min(kept.stop, window.stop), kept.step)
    rows = np.array(numbers, np.intp) - window.first
    return {name: values[rows] for name, values in motion.items()}


def smooth_motion(
    position: Array, velocity: Array | None, rate_hz: float, settings: PreprocessingSettings
) -> tuple[Array, Array, Array]:
    """
    Low-pass uniform samples and differentiate them.

    The same low-pass goes over positions, velocities and torques, so that none of them lags or
    loses content against the others; the acceleration is the derivative of the smooth velocity.

    Parameters
    ----------
    position : ndarray, shape (N, n)
    velocity : ndarray, shape (N, n), optional
        Without one, the derivative of the smooth position.
    rate_hz : float
    settings : PreprocessingSettings

    Returns
    -------
    q, dq, ddq : ndarrays, shape (N, n)

    """
    derivative = DERIVATIVES[settings.derivative]
    q = low_pass(position, rate_hz, settings.cutoff)
    if velocity is None:
        dq = derivative(q, rate_hz)
    else:
        dq = low_pass(velocity, rate_hz, settings.cutoff)
    return q, dq, derivative(dq, rate_hz)


def _repetition(fresh: JointSamples) -> dict[str, Any]:
    """Return which positions repeat although other signals do not, and come in steps."""
    steps = {}
    for joint, name in enumerate(fresh.joint_names):
        steps[name] = quantum(fresh.position[:, joint])
        release(fresh.position)
    return {
        'positions': int(repeated(fresh.position).sum()),
        'position_steps': {name: step for name, step in steps.items() if step > 0.0},
    }


def _provenance(
    samples: JointSamples, rate: float, settings: PreprocessingSettings, dropped: Counter[str]
) -> dict[str, Any]:
    return {
        'source': samples.source,
        'topic': samples.topic,
        'clock': samples.clock,
        'notes': list(samples.notes),
        'start_s': samples.start_s,
        'samples': samples.n_samples,
        'content': content_digest(samples.joint_names, samples.position, samples.effort),
        'dropped': {str(reason): count for reason, count in dropped.items() if count},
        'rate_hz': rate,
        'filtered': is_filtered(rate, settings.cutoff),
        'velocity': 'recorded'
        if uses_velocity(samples, settings)
        else 'differentiated from position',
        'kept_every': stride(rate, settings),
        'preprocessing': asdict(settings),
    }


def _too_short(source: str, raw: Segments, settings: PreprocessingSettings) -> str:
    longest = max(float(segment.t[-1] - segment.t[0]) for segment in raw.segments)
    rate, periods = raw.rate_hz, settings.edge_periods
    edge = edge_length(rate, settings.cutoff, periods, raw.largest_delay_s)
    needed = max(settings.min_segment_s, 2 * edge / rate if rate else 0.0)
    return (
        f'{source} must hold a motion of {needed:g} s without a gap, but the longest of '
        f'{len(raw.segments)} lasts {longest:.3g} s; record for longer, or raise '
        'preprocessing.max_gap_s or lower preprocessing.min_segment_s.'
    )
