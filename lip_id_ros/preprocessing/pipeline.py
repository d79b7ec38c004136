"""
From raw joint samples to a data set.

Stale samples removed, efforts scaled to torques, cut at gaps, stamps mended where stale samples
made them late, each segment brought to uniform steps, low-passed, differentiated, cut at its edges
and decimated; every sample left out is counted in the provenance.

"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
import dataclasses
from typing import Any

import numpy as np

from lip_id_ros.arrays import BoolArray
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.preprocessing.cleaning import chosen, per_joint, stale, torque
from lip_id_ros.preprocessing.filters import edge_length, is_filtered
from lip_id_ros.preprocessing.segments import (
    cut,
    evenly_timed,
    is_long_enough,
    joined,
    Motion,
    Piece,
    smooth,
)
from lip_id_ros.preprocessing.selection import at_most, stride
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.timing import GAP_STEPS, median_step
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
    repeated = stale(samples)
    fresh = chosen(samples, ~repeated)
    given = _pieces(fresh, settings, recording)
    pieces = [_retimed(piece, samples, repeated) for piece in given]
    rate = _rate(pieces)
    dropped = Counter(samples.counts)
    dropped[STALE] = int(repeated.sum())
    motions = _motions(pieces, rate, settings, dropped)
    if not motions:
        raise DataError(_too_short(samples.source, pieces, rate, settings))
    provenance = _provenance(samples, rate, settings, dropped)
    provenance['segments'] = len(motions)
    provenance['retimed'] = any(new is not old for new, old in zip(pieces, given, strict=True))
    provenance['recording'] = dataclasses.asdict(recording)
    return _dataset(motions, fresh, recording, provenance)


def _pieces(
    fresh: JointSamples, settings: PreprocessingSettings, recording: RecordingSettings
) -> list[Piece]:
    if fresh.n_samples < 2:
        raise DataError(
            f'{fresh.source} must hold at least two different samples, but has '
            f'{fresh.n_samples}; record while the arm moves.'
        )
    velocity = fresh.velocity if _uses_velocity(fresh, settings) else None
    whole = Piece(fresh.t, fresh.position, velocity, torque(fresh, recording))
    return cut(whole, settings.max_gap_s or GAP_STEPS * median_step(fresh.t))


def _uses_velocity(samples: JointSamples, settings: PreprocessingSettings) -> bool:
    return samples.has_velocity and settings.velocity == 'recorded'


def _retimed(piece: Piece, samples: JointSamples, repeated: BoolArray) -> Piece:
    times = samples.t[repeated]
    inside = (times > piece.t[0]) & (times < piece.t[-1])
    return evenly_timed(piece, median_step(samples.t)) if inside.any() else piece


def _rate(pieces: list[Piece]) -> float:
    steps = np.concatenate([np.diff(piece.t) for piece in pieces])
    return 1.0 / float(np.median(steps)) if steps.size else 0.0


def _motions(
    pieces: list[Piece], rate: float, settings: PreprocessingSettings, dropped: Counter[str]
) -> list[Motion]:
    edge = edge_length(rate, settings.cutoff_hz, settings.edge_periods)
    motions = []
    for piece in pieces:
        if not is_long_enough(piece, rate, settings):
            dropped[SHORT_SEGMENT] += piece.t.size
            continue
        motion = smooth(piece, rate, settings).rows(slice(edge, -edge))
        dropped[EDGE] += 2 * edge
        motions.append(motion.rows(slice(None, None, stride(rate, settings))))
        dropped[DECIMATED] += motion.t.size - motions[-1].t.size
    return motions


def _dataset(
    motions: list[Motion],
    samples: JointSamples,
    recording: RecordingSettings,
    provenance: dict[str, Any],
) -> Dataset:
    return Dataset(
        **vars(joined(motions)),
        joint_names=samples.joint_names,
        joint_types=per_joint(samples, 'joint_types', recording.joint_types, 'revolute'),
        segment=np.repeat(np.arange(len(motions)), [motion.t.size for motion in motions]),
        gravity_compensated=recording.gravity_compensated,
        provenance={'sources': [provenance]},
    )


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
        'dropped': {str(reason): count for reason, count in dropped.items() if count},
        'rate_hz': rate,
        'filtered': is_filtered(rate, settings.cutoff_hz),
        'velocity': 'recorded'
        if _uses_velocity(samples, settings)
        else 'differentiated from position',
        'kept_every': stride(rate, settings),
        'preprocessing': dataclasses.asdict(settings),
    }


def _too_short(
    source: str, pieces: list[Piece], rate: float, settings: PreprocessingSettings
) -> str:
    longest = max(float(piece.t[-1] - piece.t[0]) for piece in pieces)
    edges = (
        2 * edge_length(rate, settings.cutoff_hz, settings.edge_periods) / rate if rate else 0.0
    )
    needed = max(settings.min_segment_s, edges)
    return (
        f'{source} must hold a motion of {needed:g} s without a gap, but the longest of '
        f'{len(pieces)} lasts {longest:.3g} s; record for longer, or raise '
        'preprocessing.max_gap_s or lower preprocessing.min_segment_s.'
    )
