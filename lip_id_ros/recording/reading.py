"""Read joint samples from bags and CSV logs: choose topics, clock and joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
import os
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.csv_table import check_columns, check_efforts, CsvTable, joints_of, read_table
from lip_id_ros.errors import DataError, missing_joints, SourceError
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording.assembling import assembled
from lip_id_ros.recording.bags import Bag, Topic
from lip_id_ros.recording.collecting import SampleCollector
from lip_id_ros.recording.joint_messages import EXTRACTORS, JOINT_STATE, message_blocks
from lip_id_ros.recording.joint_samples import (
    complete,
    counted,
    JointSamples,
    MOST_JOINTS,
    not_finite,
    not_finite_note,
    Reason,
    stacked,
    usable,
)
from lip_id_ros.recording.storage.contents import Channel
from lip_id_ros.recording.timing import arrange, LATEST_NS, SECOND
from lip_id_ros.settings import RecordingSettings

DEFAULT_TOPIC = '/joint_states'

_BATCH = 1024
_BATCH_BYTES = 4 * 2**20
_SHOWN_JOINTS = 50
_MOST_LISTED = 20
_LATEST_S = 4e9
_CSV_SIGNALS = ('q', 'dq', 'tau')

PathLike = str | os.PathLike[str]


class Batch(NamedTuple):
    """Messages with their channels and times of recording [ns], one after the other."""

    channels: tuple[Channel, ...]
    receive_ns: tuple[int, ...]
    messages: tuple[bytes, ...]


def read_sources(
    paths: Sequence[PathLike], settings: RecordingSettings, progress: Progress = silent
) -> Iterator[JointSamples]:
    """
    Read several bags, see `read_bag`; one recording each, one after the other.

    Bags that have only some of the joints that the settings name were recorded side by side: they
    are merged into one recording, which comes last.
    """
    partial: list[SampleCollector] = []
    for path in paths:
        topics = _topics(path, settings, progress)
        have = {joint for topic in topics for joint in topic.collected_joints}
        if have and not have >= set(settings.joints):
            partial += topics
        else:
            yield _checked(topics, settings)
    if partial:
        yield _checked(partial, settings)


def read_bag(
    path: PathLike, settings: RecordingSettings | None = None, progress: Progress = silent
) -> JointSamples:
    """
    Read the joint samples of a rosbag2 folder, .mcap, .db3 or ROS 1 .bag; at least one.

    The topics are those that the settings name, else as `choose_topics` finds. Times are those of
    `timing.clock_of`, in the order of `timing.arrange`. Joints and efforts that come in messages
    of their own are merged (`assembling.assembled`), joints where the settings name them. Memory
    does not grow with the number of messages, as long as their stamps are in order (`spill`).

    Velocity or effort may be absent. Scales and types are not applied. SourceError if the bag
    cannot be read, has no such topic, or none of its messages can be used.
    """
    settings = settings or RecordingSettings()
    return _checked(_topics(path, settings, progress), settings)


def read_topic(bag: Bag, topic: Topic, progress: Progress = silent) -> JointSamples:
    """Read the joint samples of one topic, be they few or none; see `Bag.decoder` for errors."""
    return assembled([_collected(bag, topic, (), progress)], RecordingSettings().clock)


def read_log(path: PathLike, joints: Sequence[str] = ()) -> JointSamples:
    """
    Read the joint samples of a CSV log; rows that cannot be used are dropped and counted.

    The columns are t [s], q_NAME, tau_NAME and optionally dq_NAME of every joint NAME. Without
    `joints` all are kept, in the order of their positions. Times may be negative, and are put in
    order as those of bags (`timing.arrange`). DataError if it is no table of numbers, or lacks a
    column; SourceError if no row can be used, or there are too many joints.
    """
    table = read_table(path)
    names = tuple(joints) or joints_of(list(table.columns))
    if len(names) > MOST_JOINTS:
        raise SourceError(
            f'{os.fspath(path)} must have at most {MOST_JOINTS} joints, not {len(names)}; choose '
            'some with recording.joints.'
        )
    check_columns(path, table, ['t', *(f'q_{name}' for name in names)])
    check_efforts(path, table, names)
    values, notes = _csv_signals(path, table, names)
    if any(name.startswith('ddq_') for name in table.columns):
        notes.append('accelerations were not read; they are computed from the positions')
    counts: Counter[str] = Counter()
    keep = usable(values, counts)
    if strange := not_finite(names, values):
        notes.append(not_finite_note(strange))
    no_velocity, no_effort = (np.isnan(values[keep, signal, 0]) for signal in (1, 2))
    keep[keep] = complete(no_velocity, no_effort, counts)
    t = table.columns['t']
    if np.median(np.abs(t)) > _LATEST_S:
        raise SourceError(
            f't in {os.fspath(path)} must be in seconds, but is {np.median(t):.4g}; divide it, by '
            '1e3 if it is in ms, by 1e9 if it is in ns.'
        )
    known = np.abs(t) <= _LATEST_S  # not where t is nan
    counts[Reason.BAD_STAMP] += int((keep & ~known).sum())
    kept = np.flatnonzero(keep & known)
    timeline = arrange(np.round(t[kept] * SECOND).astype(np.int64), is_epoch=False)
    counts.update(timeline.dropped)
    if not timeline.rows.size:
        reasons = ', '.join(f'{reason}: {count}' for reason, count in counted(counts).items())
        why = '; '.join([reasons, *notes])
        raise SourceError(
            f'no row of {os.fspath(path)} can be used ({why}); correct the log, or choose joints '
            'with recording.joints.'
        )
    rows = kept[timeline.rows]
    return JointSamples(
        timeline.t,
        values[rows, 0],
        values[rows, 1],
        values[rows, 2],
        joint_names=names,
        start_ns=timeline.start_ns,
        counts=counted(counts),
        source=os.fspath(path),
        seen_joints=names,
        notes=(*table.notes, *notes, *timeline.notes),
    )


def _csv_signals(
    path: PathLike, table: CsvTable, joints: Sequence[str]
) -> tuple[Array, list[str]]:
    """
    Return positions, velocities and efforts of a CSV log as `stacked` does, and notes.

    DataError if some joints have efforts and others have none.
    """
    signals, notes = [], []
    for signal in _CSV_SIGNALS:
        columns = [f'{signal}_{joint}' for joint in joints]
        missing = [name for name in columns if name not in table.columns]
        if signal == 'tau' and 0 < len(missing) < len(columns):
            raise DataError(
                f'{os.fspath(path)} must have an effort for every position, but {missing[0]} is '
                'missing; add it, or choose joints with recording.joints.'
            )
        if 0 < len(missing) < len(columns):
            notes.append(f'velocities were not read, since {missing[0]} is missing')
        nothing = np.empty((table.n_rows, 0))
        signals.append(nothing if missing else table.per_joint(signal, joints))
    return stacked(*signals), notes


def joint_topics(bag: Bag) -> list[Topic]:
    """Return the topics of a bag that carry joint samples."""
    return [topic for topic in bag.topics if topic.type in EXTRACTORS]


def choose_topics(bag: Bag, wanted: str) -> list[Topic]:
    """
    Return the topics to read joint samples from.

    Those named (separated by commas); else the only one with messages, else /joint_states, else
    the only one of JointState. SourceError if there is none, or several and no way to choose.
    """
    candidates = joint_topics(bag)
    names = [name.strip() for name in wanted.split(',') if name.strip()]
    if names:
        return [_named_topic(bag, candidates, name) for name in dict.fromkeys(names)]
    if not candidates:
        raise SourceError(
            f'{bag.path} must have a topic of {" or ".join(EXTRACTORS)}, but has '
            f'{_listed(bag.topics)}; record joint_states.'
        )
    filled = [topic for topic in candidates if topic.count] or candidates
    for some in (
        filled,
        [topic for topic in filled if topic.name == DEFAULT_TOPIC],
        [topic for topic in filled if topic.type == JOINT_STATE],
    ):
        if len(some) == 1:
            return some
    raise SourceError(
        f'{bag.path} has several topics with joint samples: {_listed(candidates)}; choose one, '
        'or several separated by commas, with recording.topic.'
    )


def _named_topic(bag: Bag, candidates: Sequence[Topic], wanted: str) -> Topic:
    for topic in candidates:
        if topic.name.lstrip('/') == wanted.lstrip('/'):
            return topic
    raise SourceError(
        f'recording.topic must be a topic of {bag.path} with joint samples, not {wanted!r}; '
        f'it has {_listed(bag.topics)}.'
    )


def _listed(topics: Sequence[Topic]) -> str:
    texts = [
        f'{topic.name} ({topic.type}, {topic.count} messages)' for topic in topics[:_MOST_LISTED]
    ]
    if len(topics) > _MOST_LISTED:
        texts.append(f'{len(topics) - _MOST_LISTED} more')
    return ', '.join(texts) or 'no topics'


def _topics(
    path: PathLike, settings: RecordingSettings, progress: Progress
) -> list[SampleCollector]:
    with Bag(path) as bag:
        topics = choose_topics(bag, settings.topic)
        return [_collected(bag, topic, settings.joints, progress) for topic in topics]


def _collected(
    bag: Bag, topic: Topic, joints: Sequence[str], progress: Progress
) -> SampleCollector:
    collector = SampleCollector(joints, os.fspath(bag.path), topic.name)
    stage, done = f'reading {bag.path.name}', 0
    progress(stage, 0, topic.count)
    for batch in _batches(bag, topic):
        _collect(bag, batch, collector)
        done += len(batch.messages)
        progress(stage, min(done, topic.count), topic.count)
    progress(stage, topic.count, topic.count)
    collector.counts[Reason.LOST] += bag.lost(topic.name)
    collector.notes.update(dict.fromkeys(bag.notes))
    return collector


def _collect(bag: Bag, batch: Batch, collector: SampleCollector) -> None:
    pieces = []
    for channel, rows in _by_form(batch.channels):
        found = message_blocks(
            [batch.messages[row] for row in rows],
            np.array(batch.receive_ns, np.int64)[rows],
            channel.type,
            channel.encoding == 'ros1',
            bag.decoder(channel),
            collector.counts,
        )
        pieces += [(rows[numbers], block) for numbers, block in found]
    collector.add(pieces)


def _by_form(channels: Sequence[Channel]) -> Iterator[tuple[Channel, IndexArray]]:
    """Yield the numbers of those that are read alike, with one of them."""
    numbers = np.array([*map(id, channels)])  # each file has one object for each
    forms: dict[tuple[str, ...], list[int]] = {}
    for first in sorted(np.unique(numbers, return_index=True)[1].tolist()):
        forms.setdefault(channels[first].form, []).append(first)
    for some in forms.values():
        yield channels[some[0]], np.flatnonzero(np.isin(numbers, numbers[some]))


def _batches(bag: Bag, topic: Topic) -> Iterator[Batch]:
    """Yield messages in the order of the files, some at a time; of no more bytes than need be."""
    rows: list[tuple[Channel, int, bytes]] = []
    size = 0
    for channel, receive_ns, data in bag.stored(topic.name, topic.type):
        # what cannot be decompressed is as unreadable as an empty message
        message = data or b''
        if not -1 <= receive_ns <= LATEST_NS:
            receive_ns = max(-1, min(receive_ns, LATEST_NS))
        rows.append((channel, receive_ns, message))
        size += len(message)
        if len(rows) == _BATCH or size > _BATCH_BYTES:
            yield Batch(*zip(*rows, strict=True))
            rows, size = [], 0
    if rows:
        yield Batch(*zip(*rows, strict=True))


def _checked(topics: Sequence[SampleCollector], settings: RecordingSettings) -> JointSamples:
    samples = assembled(topics, settings.clock)
    if not samples.n_samples:
        raise SourceError(_why_empty(samples))
    strange = (Reason.FOREIGN_JOINTS, Reason.MISSING_JOINT)
    dropped = sum(samples.counts.get(reason, 0) for reason in strange)
    if dropped > samples.n_samples and not settings.joints:
        raise SourceError(
            f'most messages of {samples.topic} in {samples.source} lack joints of the first one, '
            f'{", ".join(samples.joint_names)} ({_reasons(samples)}); name the joints to use '
            'with recording.joints.'
        )
    return samples


def _why_empty(samples: JointSamples) -> str:
    where = f'{samples.topic} in {samples.source}'
    if not samples.counts:
        notes = f' ({"; ".join(samples.notes)})' if samples.notes else ''
        return f'{where} must hold messages, but is empty{notes}; record while the arm moves.'
    absent = [name for name in samples.joint_names if name not in samples.seen_joints]
    if absent:
        return missing_joints(absent, where, samples.seen_joints[:_SHOWN_JOINTS])
    why = '; '.join([_reasons(samples), *samples.notes])
    return (
        f'no message of {where} can be used ({why}); record position, velocity and effort of '
        'every joint, or choose other joints with recording.joints.'
    )


def _reasons(samples: JointSamples) -> str:
    return ', '.join(f'{count} {reason}' for reason, count in samples.counts.items())
