"""What is in a recording or data set, in words that JSON knows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import os
from pathlib import Path
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.csv_table import CSV_SUFFIX
from lip_id_ros.dataset import Dataset, DATASET_SUFFIX
from lip_id_ros.errors import SourceError
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import Bag, JointSamples
from lip_id_ros.recording.joint_samples import SIGNALS
from lip_id_ros.recording.reading import joint_topics, read_log, read_topic
from lip_id_ros.recording.spill import extent
from lip_id_ros.recording.timing import gap_starts, GAP_STEPS, median_step, some_steps

Assess = Callable[[JointSamples], Mapping[str, Any]]

_MOST_GAPS = 20
_MOST_TOPICS = 32


def describe(
    path: str | os.PathLike[str],
    progress: Progress = silent,
    assess: Assess = lambda samples: {},
) -> dict[str, Any]:
    """
    Describe a bag, a log or a data set, JSON-able.

    `file`, `kind`, for a bag `topics`, `recordings` (one for each topic with joint samples) and
    `notes` on what is in none of them, for a data set `joints`, `timing`, `ranges` and its
    provenance. `assess` gets the samples of each recording, and returns more keys for its
    description. SourceError if it is no bag, or a damaged one; DataError if it is no data set, or
    contradicts itself.
    """
    if Path(path).suffix == DATASET_SUFFIX:
        return _dataset(path, Dataset.load(path))
    if Path(path).suffix == CSV_SUFFIX:
        recordings = [_recording(read_log(path), assess)]
        return {'file': os.fspath(path), 'kind': 'CSV log', 'recordings': recordings}
    with Bag(path) as bag:
        recordings, notes = _recordings(bag, progress, assess)
        return {
            'file': os.fspath(path),
            'kind': bag.kind,
            'topics': [
                {'name': topic.name, 'type': topic.type, 'messages': topic.count}
                for topic in bag.topics
            ],
            'notes': notes,
            'recordings': recordings,
        }


def _recordings(
    bag: Bag, progress: Progress, assess: Assess
) -> tuple[list[dict[str, Any]], list[str]]:
    """Describe the topics with joint samples; list those that cannot be read, else notes."""
    recordings, unreadable = [], []
    topics = sorted(joint_topics(bag), key=lambda topic: -topic.count)
    if len(topics) > _MOST_TOPICS:
        unreadable.append(
            f'of {len(topics)} topics with joint samples the {_MOST_TOPICS} with most messages '
            'were read.'
        )
        topics = topics[:_MOST_TOPICS]
    for topic in sorted(topics, key=lambda topic: topic.name):
        try:
            samples = read_topic(bag, topic, progress=progress)
        except SourceError as error:
            unreadable.append(str(error))
        else:
            recordings.append(_recording(samples, assess))
    return recordings, unreadable if recordings else [*unreadable, *bag.notes]


def _recording(samples: JointSamples, assess: Assess) -> dict[str, Any]:
    arrays = {name: getattr(samples, name) for name in SIGNALS}
    return {
        'topic': samples.topic,
        'joints': list(samples.joint_names),
        'other_joints': [name for name in samples.seen_joints if name not in samples.joint_names],
        'samples': samples.n_samples,
        'dropped': dict(samples.counts),
        'notes': list(samples.notes),
        'clock': samples.clock,
        'start_s': samples.start_s,
        'timing': _timing(samples.t),
        'ranges': _ranges(samples.joint_names, arrays),
        **assess(samples),
    }


def _dataset(path: str | os.PathLike[str], data: Dataset) -> dict[str, Any]:
    arrays = {name: getattr(data, name) for name in ('q', 'dq', 'ddq', 'tau')}
    segments = [data.t[data.segment == number] for number in np.unique(data.segment)]
    return {
        'file': os.fspath(path),
        'kind': 'data set',
        'joints': list(data.joint_names),
        'joint_types': list(data.joint_types),
        'samples': data.n_samples,
        'segments': [_timing(t) for t in segments],
        'ranges': _ranges(data.joint_names, arrays),
        'gravity_compensated': data.gravity_compensated,
        'has_true_torques': data.tau_noiseless is not None,
        'has_energies': data.kinetic is not None,
        'provenance': dict(data.provenance),
    }


def _timing(t: Array) -> dict[str, Any]:
    if t.size < 2:
        unknown = {'rate_hz': None, 'jitter_s': None}
        return {'duration_s': 0.0, **unknown, 'gaps': 0, 'longest_gaps': []}
    typical = median_step(t)
    starts = gap_starts(t, GAP_STEPS * typical)
    lengths = t[starts + 1] - t[starts]
    longest = np.argsort(-lengths, kind='stable')[:_MOST_GAPS].tolist()
    some = some_steps(t)
    return {
        'duration_s': float(t[-1] - t[0]),
        'rate_hz': 1.0 / typical if typical > 0 else None,
        'jitter_s': round(float(np.std(some[some <= GAP_STEPS * typical])), 9),
        'gaps': int(starts.size),
        'longest_gaps': [
            {'at_s': float(t[starts[gap]]), 'length_s': float(lengths[gap])} for gap in longest
        ],
    }


def _ranges(
    joint_names: tuple[str, ...], arrays: dict[str, Array]
) -> dict[str, dict[str, list[float] | None]]:
    ranges = {name: _range(values) for name, values in arrays.items()}
    return {
        joint: {name: ends[column] for name, ends in ranges.items()}
        for column, joint in enumerate(joint_names)
    }


def _range(values: Array) -> list[list[float] | None]:
    if not len(values):
        return [None] * values.shape[1]
    ends = np.transpose(extent(values))
    return [each.tolist() if np.isfinite(each).all() else None for each in ends]
