"""
From raw joint samples to a data set, and which of its samples a fit gets.

Each segment of a cleaned recording is brought to uniform steps, low-passed, differentiated, cut at
its edges and decimated; every sample left out is counted in the provenance.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.joint_types import REVOLUTE
from lip_id_ros.preprocessing.segment import per_joint, Segment
from lip_id_ros.preprocessing.segments import segments_of
from lip_id_ros.preprocessing.smoothing import (
    DERIVATIVES,
    edge_length,
    grid_size,
    is_filtered,
    is_long_enough,
    low_pass,
    Window,
    windows,
)
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.joint_samples import content_digest
from lip_id_ros.recording.sketch import content_sketch, SKETCH
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

STALE = 'sample stale'
SPIKE = 'effort far from all others'
SHORT_SEGMENT = 'segment too short'
EDGE = 'edge of a segment'
DECIMATED = 'decimated'

SAMPLES_PER_PERIOD = 4
LEAST_LEFT = 0.25

MIN_VELOCITY = {'articulated': 0.0}
OTHER_MIN_VELOCITY = 0.05
"""By the kernel of the fit, where `min_velocity` is negative."""


def preprocess(
    samples: JointSamples | Sequence[JointSamples],
    settings: PreprocessingSettings | None = None,
    recording: RecordingSettings | None = None,
) -> Dataset:
    """
    Make a data set of one or several recordings of the same joints.

    Its provenance lists, for each source, the settings and how many samples were dropped for which
    reason. SourceError if no effort was recorded; ConfigError if a setting per joint has another
    length than there are joints; DataError if too little is left, or the joints differ.
    """
    settings = settings or PreprocessingSettings()
    recording = recording or RecordingSettings()
    recordings = [samples] if isinstance(samples, JointSamples) else samples
    data = concatenate([_recording(each, settings, recording) for each in recordings])
    return at_most(data, settings)


def _recording(
    samples: JointSamples, settings: PreprocessingSettings, recording: RecordingSettings
) -> Dataset:
    segments, report = segments_of(samples, settings, recording)
    dropped = Counter(samples.counts)
    left_out = samples.n_samples - sum(segment.n_samples for segment in segments)
    dropped[SPIKE] = report['spikes']
    dropped[STALE] = left_out - report['spikes']
    motions = _motions(segments, settings, dropped)
    if not motions:
        raise DataError(_too_short(samples.source, segments, settings))
    rate = segments[0].rate_hz
    source = {
        'source': samples.source,
        'topic': samples.topic,
        'clock': samples.clock,
        'notes': list(samples.notes),
        'start_s': samples.start_s,
        'samples': samples.n_samples,
        'content': content_digest(samples.joint_names, samples.position, samples.effort),
        SKETCH: content_sketch(samples.joint_names, samples.position, samples.effort),
        'dropped': {str(reason): count for reason, count in dropped.items() if count},
        'filtered': is_filtered(rate, settings.cutoff),
        'kept_every': stride(rate, settings),
        'segments': len(motions),
        **report,
        'preprocessing': asdict(settings),
        'recording': asdict(recording),
    }
    return Dataset(
        **{name: np.concatenate([motion[name] for motion in motions]) for name in motions[0]},
        joint_names=samples.joint_names,
        joint_types=per_joint(samples, 'joint_types', recording.joint_types, REVOLUTE),
        segment=np.repeat(np.arange(len(motions)), [motion['t'].size for motion in motions]),
        gravity_compensated=recording.gravity_compensated,
        provenance={'sources': [source]},
    )


def _motions(
    segments: Sequence[Segment], settings: PreprocessingSettings, dropped: Counter[str]
) -> list[dict[str, Array]]:
    motions = []
    for segment in segments:
        rate, delay = segment.rate_hz, segment.largest_delay_s
        if not is_long_enough(segment.t, rate, settings, delay):
            dropped[SHORT_SEGMENT] += segment.n_samples
            continue
        edge = edge_length(rate, settings.cutoff, settings.edge_periods, delay)
        kept = range(edge, grid_size(segment.t, rate) - edge, stride(rate, settings))
        parts = [
            _part(segment, window, settings, kept)
            for window in windows(segment.t, rate, settings.cutoff, delay, segment.longest_hold)
        ]
        motions.append({name: np.concatenate([part[name] for part in parts]) for name in parts[0]})
        dropped[EDGE] += 2 * edge
        dropped[DECIMATED] += kept.stop - kept.start - len(kept)
    return motions


def _part(
    segment: Segment, window: Window, settings: PreprocessingSettings, kept: range
) -> dict[str, Array]:
    uniform = segment.rows(window.rows).uniform(window.times)
    q, dq, ddq, tau = smooth(uniform, settings)
    segment.release()
    before = max(0, -((kept.start - window.start) // kept.step))
    numbers = range(kept.start + before * kept.step, min(kept.stop, window.stop), kept.step)
    rows = np.array(numbers, np.intp) - window.first
    sign = low_pass(np.sign(dq), segment.rate_hz, settings.cutoff)
    motion = {'t': uniform.t, 'q': q, 'dq': dq, 'ddq': ddq, 'tau': tau, 'low_passed_sign': sign}
    return {name: values[rows] for name, values in motion.items()}


def smooth(segment: Segment, settings: PreprocessingSettings) -> tuple[Array, Array, Array, Array]:
    """
    Low-pass a segment at uniform times, and differentiate it, each shape (N, n).

    The same low-pass goes over positions, velocities and torques, so that none of them lags or
    loses content against the others; the acceleration is the derivative of the smooth velocity,
    and that of the smooth position where there is none.
    """
    rate, derivative = segment.rate_hz, DERIVATIVES[settings.derivative]
    q = low_pass(segment.position, rate, settings.cutoff)
    if segment.velocity is None:
        dq = derivative(q, rate)
    else:
        dq = low_pass(segment.velocity, rate, settings.cutoff)
    return q, dq, derivative(dq, rate), low_pass(segment.effort, rate, settings.cutoff)


def _too_short(source: str, segments: Sequence[Segment], settings: PreprocessingSettings) -> str:
    longest = max(segment.duration_s for segment in segments)
    rate, delay = segments[0].rate_hz, segments[0].largest_delay_s
    edge = edge_length(rate, settings.cutoff, settings.edge_periods, delay)
    needed = max(settings.min_segment_s, 2 * edge / rate if rate else 0.0)
    return (
        f'{source} must hold a motion of {needed:g} s without a gap, but the longest of '
        f'{len(segments)} lasts {longest:.3g} s; record for longer, or raise '
        'preprocessing.max_gap_s or lower preprocessing.min_segment_s.'
    )


def stride(rate_hz: float, settings: PreprocessingSettings) -> int:
    """
    Return k where every k-th sample of a recording is kept.

    Errors of low-passed samples are correlated: kept at the full rate, they would pass for many
    independent measurements, and the fit would trust them too much.
    """
    if settings.decimate > 0:
        return settings.decimate
    if not is_filtered(rate_hz, settings.cutoff):
        return 1
    return max(1, int(rate_hz / (SAMPLES_PER_PERIOD * settings.cutoff)))


def for_training(data: Dataset, settings: PreprocessingSettings, kernel: str) -> Dataset:
    """
    Leave out the samples at which a joint is nearly at rest; noted in the provenance.

    Near rest friction is anything between its two signs, and the sign of a small velocity is that
    of its noise. A model is judged there all the same, so that this is for training only. Where
    `min_velocity` would leave less than a quarter of the samples, as where joints are moved one
    after another, all are kept. The noise of an arm (`fit.kernel`) grows near rest, so that none
    need be left out for it.
    """
    share = settings.min_velocity
    if share < 0.0:
        share = MIN_VELOCITY.get(kernel, OTHER_MIN_VELOCITY)
    rows = moving(data.dq, share)
    left = int(rows.sum())
    if left == data.n_samples or left < LEAST_LEFT * data.n_samples:
        return data
    note = {'moving': {'samples': left, 'of': data.n_samples}}
    return replace(data.select(rows), provenance={**data.provenance, **note})


def moving(dq: Array, min_velocity: float) -> BoolArray:
    """
    Mark samples (N,) at which no joint is below a share of its root mean square velocity.

    One that never moves is not asked.
    """
    threshold = min_velocity * np.sqrt(np.mean(np.square(dq), axis=0))
    fast: BoolArray = (np.abs(dq) >= threshold).all(axis=1)
    return fast


def at_most(data: Dataset, settings: PreprocessingSettings) -> Dataset:
    """Return at most `max_samples` samples, chosen by `selection`; noted in the provenance."""
    count = settings.max_samples
    if not 0 < count < data.n_samples:
        return data
    chosen = data.select(SELECTIONS[settings.selection](data, count))
    note = {'selected': {'samples': chosen.n_samples, 'of': data.n_samples}}
    return replace(chosen, provenance={**data.provenance, **note})


def evenly_in_time(data: Dataset, count: int) -> IndexArray:
    """Return row numbers at even distances, the first and the last among them."""
    return np.linspace(0, data.n_samples - 1, count).round().astype(np.intp)


SELECTIONS: Mapping[str, Callable[[Dataset, int], IndexArray]] = {
    'coverage': Dataset.covering,
    'time': evenly_in_time,
}
"""By the name that `preprocessing.selection` has for them."""
