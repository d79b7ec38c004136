"""
What passes read of a recording: a survey with samples that cover its motion, and statistics.

The first share of many recordings is learned from, the rest is held out.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from lip_id_ros.arrays import IndexArray
from lip_id_ros.csv_table import CSV_SUFFIX
from lip_id_ros.dataset import concatenate, Dataset, DATASET_SUFFIX
from lip_id_ros.dataset.formats import FINDINGS
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation.cautions import data_remarks
from lip_id_ros.fleet.results import ARM, SIGNALS, Survey
from lip_id_ros.identification.folds import motion_s
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.posterior import ranges_of
from lip_id_ros.identification.sample_selection import (
    covering,
    evenly,
    explained,
    moving,
    plausible,
    remembering,
)
from lip_id_ros.identification.total import gather, RecordingFactors
from lip_id_ros.loading import load_dataset
from lip_id_ros.loading.examined import findings_of
from lip_id_ros.preprocessing import for_training
from lip_id_ros.recording import JointSamples
from lip_id_ros.recording.bags import Bag
from lip_id_ros.recording.joint_samples import content_digest
from lip_id_ros.settings import Config

NUMBERS_PER_JOINT = 10
"""Of a sample in a reservoir."""

RESERVOIR_BYTES = 170_000
MOST_RESERVOIR = 600
"""Samples of one recording that are kept, as far as `RESERVOIR_BYTES` allow."""

MOST_MERGED = 20_000
"""Samples of all recordings together that placements are identified with."""

TEMPERATURE = 'sensor_msgs/msg/Temperature'

MOST_TEXT = 20_000
"""Characters of a provenance that is kept."""


def first_shares(counts: Mapping[int, int], share: float) -> dict[int, float]:
    """
    Return the first share of each recording that is among the first samples of all.

    One recording at most is cut; of those after it the share is 0. DataError if nothing would be
    left on one side.
    """
    total = sum(counts.values())
    rest = round(share * total)
    if not 0 < rest < total:
        raise DataError(
            f'a share {share:g} of {total} samples leaves nothing to learn from, or to hold out; '
            'choose another, or record longer.'
        )
    shares = {}
    for number in sorted(counts):
        shares[number] = min(rest / counts[number], 1.0) if counts[number] else 0.0
        rest -= round(shares[number] * counts[number])
    return shares


def _to_learn_from(data: Dataset, config: Config, share: float) -> Dataset:
    """Return the first samples of a recording, all of them where the share is 1, as a fit does."""
    first = data if share >= 1.0 else data.split(share)[0]
    return for_training(first, config.preprocessing, config.fit.kernel)


def last_part(data: Dataset, share: float) -> Dataset:
    """Return the samples after the first share, all of them where it is 0."""
    return data if share <= 0.0 else data.split(share)[1]


def gathered_from(
    path: str | os.PathLike[str],
    around: Linearisation,
    blocks: int,
    config: Config,
    share: float = 1.0,
) -> RecordingFactors:
    """
    Read the first share of a recording and gather its statistics, in blocks kept apart.

    Raises what `load_dataset` raises.
    """
    data = load_dataset(path, config).with_joints(around.joint_names)
    return gather_kept(_to_learn_from(data, config, share), around, blocks)


def gather_kept(dataset: Dataset, around: Linearisation, blocks: int = 1) -> RecordingFactors:
    """Gather the statistics of the samples that are plausible and that the arm explains."""
    dataset = moving(remembering(dataset))
    kept = plausible(dataset) & explained(around.residual(dataset))
    return gather(dataset, around, blocks, kept)


def survey(
    path: str | os.PathLike[str], name: str, group: str, config: Config, share: float = 1.0
) -> Survey:
    """
    Read the first share of a recording and keep what finding the placements needs.

    Raises what `load_dataset` raises.
    """
    examined, contents = findings_of(config.recording), list[str]()

    def assess(samples: JointSamples) -> Mapping[str, Any]:
        contents.append(_content(samples.rows(slice(0, round(share * samples.n_samples)))))
        return examined(samples)

    data = load_dataset(path, config, assess=assess)
    found = survey_of(_to_learn_from(data, config, share), name, group)
    if contents:  # of what was read: processors round differently what is computed
        found = replace(found, key='-'.join(contents))
    return replace(found, temperature=mean_temperature(path)) if _is_bag(path) else found


def mean_temperature(path: str | os.PathLike[str]) -> float:
    """
    Return the mean of all sensor_msgs/Temperature messages of a bag [degrees Celsius].

    Not a number where there are none.
    """
    total, count = 0.0, 0
    with Bag(path) as bag:
        for topic in bag.topics:
            if topic.type == TEMPERATURE:
                for _, message in bag.messages(topic.name):
                    if message is not None and np.isfinite(message.temperature):
                        total, count = total + message.temperature, count + 1
    return total / count if count else np.nan


def survey_of(dataset: Dataset, name: str, group: str) -> Survey:
    """Return the survey of samples that have been preprocessed."""
    low, high = ranges_of(dataset)
    source = _source(dataset)
    used = moving(remembering(dataset))
    some = used.select(reservoir(used))
    return Survey(
        key=dataset.with_joints(sorted(dataset.joint_names)).digest(),
        name=name,
        group=group,
        **{name: getattr(some, name) for name in (*ARM, *SIGNALS)},
        n_samples=dataset.n_samples,
        rate_hz=float(source.get('rate_hz', 0.0)),
        seconds=_seconds(dataset),
        motion_s=motion_s(used),
        start_s=float(source.get('start_s', np.nan)),
        health=tuple(data_remarks(dataset.provenance)),
        low=low,
        high=high,
        largest_torque=np.abs(dataset.tau).max(axis=0),
        mean_q=dataset.q.mean(axis=0),
        provenance=_shortened(source),
    )


def reservoir(dataset: Dataset) -> IndexArray:
    """
    Return the rows that are kept: half of them cover the motion, half are even in time.

    The first identify placements best; the others have friction and noise in their usual shares.
    """
    count = min(
        MOST_RESERVOIR, RESERVOIR_BYTES // (8 * (NUMBERS_PER_JOINT * dataset.n_joints + 2))
    )
    if dataset.n_samples <= count:
        return np.arange(dataset.n_samples)
    half = covering(dataset, count // 2)
    return np.union1d(half, evenly(dataset.n_samples, count - count // 2))


def merged(surveys: Sequence[Survey], joint_names: Sequence[str]) -> Dataset:
    """
    Join the reservoirs of recordings of one arm, `MOST_MERGED` samples at most.

    `surveys`: in the order of their keys, so that the order of the sources plays no role.
    """
    most = max(MOST_MERGED // len(surveys), 1)
    return concatenate([reservoir_data(each, joint_names, most) for each in surveys])


def reservoir_data(
    survey: Survey, joint_names: Sequence[str], most: int = MOST_RESERVOIR
) -> Dataset:
    """Return the reservoir of a recording, at most so many of its samples."""
    data = Dataset(
        **{name: getattr(survey, name) for name in (*ARM, *SIGNALS)},
        provenance={'sources': [json.loads(survey.provenance)]},
    )
    return data.with_joints(joint_names).select(evenly(len(survey.t), most))


def joint_order(surveys: Sequence[Survey]) -> tuple[str, ...]:
    """Return the joints in the order that most recordings have them in."""
    orders = Counter(each.joint_names for each in surveys)
    return max(sorted(orders), key=lambda names: orders[names])


def sorted_of_one_arm(surveys: Sequence[Survey]) -> tuple[list[int], dict[int, str]]:
    """
    Sort surveys by key, without copies and those with other joints than most.

    Returns numbers of those kept, and the reason of each of the others by its number.
    """
    kinds = Counter(map(_kind, surveys))
    most = max(sorted(kinds), key=lambda kind: kinds[kind])
    kept, left_out = dict[str, int](), dict[int, str]()
    for k in sorted(range(len(surveys)), key=lambda k: (surveys[k].key, surveys[k].name)):
        each = surveys[k]
        if _kind(each) != most:
            left_out[k] = (
                f'has joints {", ".join(each.joint_names)} of types {", ".join(each.joint_types)} '
                'and not those of most recordings'
            )
        elif each.key in kept:
            left_out[k] = f'is a copy of {surveys[kept[each.key]].name}'
        else:
            kept[each.key] = k
    return list(kept.values()), left_out


def _content(samples: JointSamples) -> str:
    times = np.broadcast_to(samples.t[:, np.newaxis], samples.position.shape)
    signals = samples.position, samples.velocity, samples.effort, times
    return content_digest(samples.joint_names, *signals)


def _is_bag(path: str | os.PathLike[str]) -> bool:
    return Path(path).suffix not in (DATASET_SUFFIX, CSV_SUFFIX)


def _kind(survey: Survey) -> tuple[Any, ...]:
    joints = sorted(zip(survey.joint_names, survey.joint_types, strict=True))
    return tuple(joints), survey.gravity_compensated


def _source(dataset: Dataset) -> dict[str, Any]:
    sources = [each for each in dataset.provenance.get('sources', []) if isinstance(each, dict)]
    return dict(sources[0]) if sources else {}


def _shortened(source: dict[str, Any]) -> str:
    """Return a provenance as text; of one that is too long, what the model needs of it."""
    text = json.dumps(source)
    if len(text) <= MOST_TEXT:
        return text
    settings = 'recording', 'preprocessing', 'filtered'
    needed = 'content', 'samples', 'rate_hz', 'start_s', *settings, FINDINGS
    return json.dumps({name: source[name] for name in needed if name in source})


def _seconds(dataset: Dataset) -> float:
    """Return how long all segments last together [s]."""
    same = np.diff(dataset.segment) == 0
    return float(np.diff(dataset.t)[same].sum())
