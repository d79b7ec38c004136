"""
From raw joint samples to a data set.

Each segment of a cleaned recording is brought to uniform steps, low-passed, differentiated, cut at
its edges and decimated; every sample left out is counted in the provenance.

"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.preprocessing.cleaning import content_digest, per_joint, quantum
from lip_id_ros.preprocessing.repetition import repeated, supported
from lip_id_ros.preprocessing.segments import Segments, segments_of
from lip_id_ros.preprocessing.selection import at_most, stride
from lip_id_ros.preprocessing.smoothing import (
    DERIVATIVES,
    edge_length,
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
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

STALE = 'sample stale'
SHORT_SEGMENT = 'segment too short'
EDGE = 'edge of a segment'
DECIMATED = 'decimated'


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
    provenance['source_periods'] = {name: k for name, k in raw.periods.items() if k > 1}
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
            for window in windows(segment.t, rate, settings.cutoff, delay, raw.longest_hold)
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
        resample(*supported(samples, 'position', raw.periods), window.times),
        resample(*supported(samples, 'velocity', raw.periods), window.times) if recorded else None,
        raw.rate_hz,
        settings,
    )
    late = supported(samples, 'effort', raw.periods)
    effort = resample_early(*late, window.times, raw.delays_s)
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
