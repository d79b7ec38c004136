"""Joint samples from bags: which topic, which clock, which joints."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import itemgetter
import os

import numpy as np

from lip_id_ros.errors import SourceError
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording.assembling import clock_of, covering, joined
from lip_id_ros.recording.bags import Bag, Topic
from lip_id_ros.recording.blocks import blocks
from lip_id_ros.recording.joint_samples import JointSamples
from lip_id_ros.recording.mapping import Reason
from lip_id_ros.recording.parts import Collector, Part
from lip_id_ros.recording.storage import Channel
from lip_id_ros.recording.timing import LATEST_NS, SECOND, seconds
from lip_id_ros.recording.topics import choose_topics
from lip_id_ros.settings import RecordingSettings

_BATCH = 1024
_BATCH_BYTES = 4 * 2**20
_MOST_EXPECTED = 1_000_000  # a count that a file claims reserves no more than this

PathLike = str | os.PathLike[str]
Batch = tuple[Channel, list[int], list[bytes]]


@dataclass(frozen=True, eq=False)
class Stream:
    """What was read of one topic of one bag, not yet in the order of time."""

    parts: list[Part]
    joints: tuple[str, ...]
    counts: Counter[str]
    seen: dict[str, None]
    notes: dict[str, None]
    source: str
    topic: str


def read_sources(
    paths: Sequence[PathLike], settings: RecordingSettings, progress: Progress = silent
) -> Iterator[JointSamples]:
    """
    Read several bags, see `read_bag`; one recording each, one after the other.

    Bags that have only some of the joints that the settings name were recorded side by side: they
    are merged into one recording, which comes last.

    """
    partial: list[Stream] = []
    for path in paths:
        streams = _streams(path, settings, progress)
        if _is_partial(streams, settings.joints):
            partial += streams
        else:
            yield _checked(streams, settings)
    if partial:
        yield _checked(partial, settings)


def read_bag(
    path: PathLike, settings: RecordingSettings | None = None, progress: Progress = silent
) -> JointSamples:
    """
    Read the joint samples of a bag.

    The topics are those that the settings name, else as `topics.choose_topics` finds. Times are
    those of the message headers where these advance (see `timing.header_stamps_usable`), else
    those of reception, unless the settings say. Messages are put in the order of time (see
    `timing.arrange`). Joints that come in messages of their own are merged (see
    `assembling.merged`) where the settings name the joints.

    Memory: 3 n + 2 numbers for each message of n joints, n more while late ones are put in order
    (half as many again where more than a million came, or than the file announced), and one block
    of the file; independent of everything else in the bag.

    Parameters
    ----------
    path : path
        A rosbag2 folder, .mcap, .db3 or ROS 1 .bag.
    settings : RecordingSettings
        Topics, joints and clock; scales and types are not applied here.
    progress : callable
        Told how many messages are read.

    Returns
    -------
    JointSamples
        At least one sample; velocity or effort may be absent.

    Raises
    ------
    SourceError
        If the bag cannot be read, has no such topic, or none of its messages can be used.
    OSError
        If it does not exist or cannot be opened.

    """
    settings = settings or RecordingSettings()
    return _checked(_streams(path, settings, progress), settings)


def read_topic(
    bag: Bag, topic: Topic, joints: Sequence[str] = (), progress: Progress = silent
) -> JointSamples:
    """
    Read the joint samples of one topic, be they few or none.

    Raises
    ------
    SourceError
        If the bag defines the message type in a way that cannot be read.

    """
    return _assembled([_stream(bag, topic, joints, progress)], RecordingSettings().clock)


def _streams(path: PathLike, settings: RecordingSettings, progress: Progress) -> list[Stream]:
    with Bag(path) as bag:
        topics = choose_topics(bag, settings.topic)
        return [_stream(bag, topic, settings.joints, progress) for topic in topics]


def _stream(bag: Bag, topic: Topic, joints: Sequence[str], progress: Progress) -> Stream:
    collector = Collector(joints, expected=min(topic.count, _MOST_EXPECTED))
    stage, done = f'reading {bag.path.name}', 0
    progress(stage, 0, topic.count)
    for channel, times, messages in _batches(bag, topic):
        receive_ns = np.array(times, np.int64)
        is_ros1 = channel.encoding == 'ros1'
        found, unreadable = blocks(messages, channel.type, is_ros1, bag.decoder(channel))
        for block in found:
            collector.add(block, receive_ns[block.rows])
        collector.counts[Reason.UNREADABLE] += unreadable
        done += len(messages)
        progress(stage, min(done, topic.count), topic.count)
    progress(stage, topic.count, topic.count)
    collector.counts[Reason.LOST] += bag.lost(topic.name)
    notes = dict.fromkeys(bag.notes)
    if collector.denormal:
        notes[f'{collector.denormal} denormal values (memory never filled in) were read as 0'] = (
            None
        )
    return Stream(
        parts=collector.parts(),
        joints=collector.joints,
        counts=collector.counts,
        seen=collector.seen,
        notes=notes,
        source=os.fspath(bag.path),
        topic=topic.name,
    )


def _batches(bag: Bag, topic: Topic) -> Iterator[Batch]:
    """Yield messages of one form, some at a time; of no more bytes than need be."""
    for channel, stored in groupby(bag.stored(topic.name, topic.type), itemgetter(0)):
        times: list[int] = []
        messages: list[bytes] = []
        size = 0
        for _, receive_ns, data in stored:
            times.append(min(receive_ns, LATEST_NS))
            messages.append(data or b'')  # what cannot be decompressed is as unreadable as that
            size += len(messages[-1])
            if len(messages) == _BATCH or size > _BATCH_BYTES:
                yield channel, times, messages
                times, messages, size = [], [], 0
        if messages:
            yield channel, times, messages


def _is_partial(streams: Sequence[Stream], joints: Sequence[str]) -> bool:
    have = {joint for stream in streams for part in stream.parts for joint in part.joints}
    return bool(have) and not have >= set(joints)


def _assembled(streams: Sequence[Stream], wanted_clock: str) -> JointSamples:
    counts = sum((stream.counts for stream in streams), Counter[str]())
    notes = {note: None for stream in streams for note in stream.notes}
    joints = next((stream.joints for stream in streams if stream.joints), ())
    parts = [part for stream in streams for part in stream.parts]
    chosen = covering(parts, joints)
    unused = [part for part in parts if not any(part is one for one, _ in chosen)]
    counts[Reason.MISSING_JOINT] += sum(part.header_ns.size for part in unused)
    clock = clock_of([part for part, _ in chosen], wanted_clock)
    if len(chosen) > 1:
        notes[f'joints of {len(chosen)} publishers were merged in time'] = None
    motion = joined(chosen, joints, clock, counts, notes)
    start_ns = int(motion.stamps_ns[0]) if motion.stamps_ns.size else 0
    return JointSamples(
        t=seconds(motion.stamps_ns - start_ns),
        position=motion.position,
        velocity=motion.velocity,
        effort=motion.effort,
        joint_names=joints,
        start_s=start_ns / SECOND,
        counts={str(reason): count for reason, count in counts.items() if count},
        source=', '.join(dict.fromkeys(stream.source for stream in streams)),
        topic=', '.join(dict.fromkeys(stream.topic for stream in streams)),
        seen_joints=tuple(dict.fromkeys(name for stream in streams for name in stream.seen)),
        clock=clock,
        notes=tuple(notes),
    )


def _checked(streams: Sequence[Stream], settings: RecordingSettings) -> JointSamples:
    samples = _assembled(streams, settings.clock)
    _check_any(samples)
    if not settings.joints:
        _check_joints(samples)
    return samples


def _check_any(samples: JointSamples) -> None:
    if samples.n_samples:
        return
    where = f'{samples.topic} in {samples.source}'
    if not samples.counts:
        notes = f' ({"; ".join(samples.notes)})' if samples.notes else ''
        raise SourceError(
            f'{where} must hold messages, but is empty{notes}; record while the arm moves.'
        )
    absent = [name for name in samples.joint_names if name not in samples.seen_joints]
    if absent:
        raise SourceError(
            f'recording.joints must be joints of {where}, but {", ".join(absent)} is not among '
            f'{", ".join(samples.seen_joints) or "none"}; correct the names.'
        )
    raise SourceError(
        f'no message of {where} can be used ({_counted(samples)}); record position, velocity and '
        'effort of every joint, or choose other joints with recording.joints.'
    )


def _check_joints(samples: JointSamples) -> None:
    strange = (Reason.FOREIGN_JOINTS, Reason.MISSING_JOINT)
    dropped = sum(samples.counts.get(reason, 0) for reason in strange)
    if dropped > samples.n_samples:
        raise SourceError(
            f'most messages of {samples.topic} in {samples.source} lack joints of the first one, '
            f'{", ".join(samples.joint_names)} ({_counted(samples)}); name the joints to use '
            'with recording.joints.'
        )


def _counted(samples: JointSamples) -> str:
    return ', '.join(f'{count} {reason}' for reason, count in samples.counts.items())
