"""Joint samples from bags: which topic, which clock, which joints."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, islice
import os

from lip_id_ros.config import RecordingSettings
from lip_id_ros.errors import SourceError
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording.bags import Bag, Topic
from lip_id_ros.recording.buffer import Reason, SampleBuffer
from lip_id_ros.recording.joint_messages import EXTRACTORS, JointMessage
from lip_id_ros.recording.joint_samples import JointSamples
from lip_id_ros.recording.timing import header_stamps_usable

DEFAULT_TOPIC = '/joint_states'

_WINDOW = 1000
_REPORT_EVERY = 1000
_MOST_EXPECTED = 1_000_000  # a count that a file claims reserves no more than this

PathLike = str | os.PathLike[str]
Stamped = tuple[int, JointMessage | None]


def read_sources(
    paths: Sequence[PathLike], settings: RecordingSettings, progress: Progress = silent
) -> list[JointSamples]:
    """Read several bags, see `read_bag`; one recording each."""
    return [read_bag(path, settings, progress) for path in paths]


def read_bag(
    path: PathLike, settings: RecordingSettings | None = None, progress: Progress = silent
) -> JointSamples:
    """
    Read the joint samples of a bag.

    The topic is the one that the settings name, else the only one with joint samples, else
    /joint_states. Times are those of the message headers where these advance in the first 1000
    messages (see `timing.header_stamps_usable`), else those of reception.

    Parameters
    ----------
    path : path
        A rosbag2 folder, .mcap, .db3 or ROS 1 .bag.
    settings : RecordingSettings
        Topic and joints; scales and types are not applied here.
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
    with Bag(path) as bag:
        topic = choose_topic(bag, settings.topic)
        samples = read_topic(bag, topic, settings.joints, progress)
    _check_any(samples, topic)
    if not settings.joints:
        _check_joints(samples, topic)
    return samples


def read_topic(
    bag: Bag, topic: Topic, joints: Sequence[str] = (), progress: Progress = silent
) -> JointSamples:
    """
    Read the joint samples of one topic, be they few or none.

    Raises
    ------
    SourceError
        If the bag is damaged.

    """
    buffer = SampleBuffer(joints, expected_rows=min(topic.count, _MOST_EXPECTED))
    _fill(buffer, bag, topic, progress)
    return buffer.samples(source=os.fspath(bag.path), topic=topic.name)


def joint_topics(bag: Bag) -> list[Topic]:
    """Return the topics of a bag that carry joint samples."""
    return [topic for topic in bag.topics if topic.type in EXTRACTORS]


def choose_topic(bag: Bag, wanted: str) -> Topic:
    """
    Return the topic to read joint samples from.

    Raises
    ------
    SourceError
        If there is none, or several and no way to choose.

    """
    candidates = joint_topics(bag)
    names = [topic.name for topic in candidates]
    if wanted:
        return _named_topic(bag, candidates, wanted)
    if not candidates:
        raise SourceError(
            f'{bag.path} must have a topic of {" or ".join(EXTRACTORS)}, but has '
            f'{_listed(bag.topics)}; record joint_states.'
        )
    if len(candidates) == 1:
        return candidates[0]
    if names.count(DEFAULT_TOPIC) == 1:
        return candidates[names.index(DEFAULT_TOPIC)]
    raise SourceError(
        f'{bag.path} has several topics with joint samples ({", ".join(names)}); '
        'choose one with recording.topic.'
    )


def _named_topic(bag: Bag, candidates: Sequence[Topic], wanted: str) -> Topic:
    for topic in candidates:
        if topic.name.lstrip('/') == wanted.lstrip('/'):
            return topic
    raise SourceError(
        f'recording.topic must be a topic of {bag.path} with joint samples, not {wanted!r}; '
        f'it has {_listed(bag.topics)}.'
    )


def _fill(buffer: SampleBuffer, bag: Bag, topic: Topic, progress: Progress) -> None:
    stage = f'reading {bag.path.name}'
    progress(stage, 0, topic.count)
    for done, (stamp_ns, message) in enumerate(_on_one_clock(bag, topic), start=1):
        if message is None:
            buffer.reject(Reason.UNREADABLE)
        else:
            buffer.add(1e-9 * stamp_ns, *message[1:])
        if done % _REPORT_EVERY == 0:
            progress(stage, done, topic.count)
    progress(stage, topic.count, topic.count)


def _on_one_clock(bag: Bag, topic: Topic) -> Iterator[Stamped]:
    received = _extracted(bag, topic)
    window = list(islice(received, _WINDOW))
    headers = [message.stamp_ns for _, message in window if message is not None]
    if header_stamps_usable(headers):
        for receive_ns, message in chain(window, received):
            yield receive_ns if message is None else message.stamp_ns, message
    else:
        yield from chain(window, received)


def _extracted(bag: Bag, topic: Topic) -> Iterator[Stamped]:
    extract = EXTRACTORS[topic.type]
    for receive_ns, message in bag.messages(topic.name):
        yield receive_ns, None if message is None else extract(message)


def _check_any(samples: JointSamples, topic: Topic) -> None:
    if samples.n_samples:
        return
    where = f'{topic.name} in {samples.source}'
    if not samples.counts:
        raise SourceError(f'{where} must hold messages, but is empty; record while the arm moves.')
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


def _check_joints(samples: JointSamples, topic: Topic) -> None:
    strange = (Reason.FOREIGN_JOINTS, Reason.MISSING_JOINT)
    dropped = sum(samples.counts.get(reason, 0) for reason in strange)
    if dropped > samples.n_samples:
        raise SourceError(
            f'most messages of {topic.name} in {samples.source} lack joints of the first one, '
            f'{", ".join(samples.joint_names)} ({_counted(samples)}); name the joints to use '
            'with recording.joints.'
        )


def _counted(samples: JointSamples) -> str:
    return ', '.join(f'{count} {reason}' for reason, count in samples.counts.items())


def _listed(topics: Sequence[Topic]) -> str:
    return ', '.join(f'{topic.name} ({topic.type})' for topic in topics) or 'no topics'
