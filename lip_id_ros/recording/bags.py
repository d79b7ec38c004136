"""Read bags of ROS 1 and ROS 2 through one interface: files, topics, message definitions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
import os
from pathlib import Path
from typing import Any

from lip_id_ros.errors import SourceError
from lip_id_ros.files import require_regular_file
from lip_id_ros.recording.decoding import Decode, message_decoder
from lip_id_ros.recording.joint_messages import EXTRACTORS, JOINT_STATE
from lip_id_ros.recording.storage.contents import Channel, DamageError, plain_message, Storage
from lip_id_ros.recording.storage.opening import (
    files_of,
    is_storage,
    open_storage,
    storage_suffix,
    SUFFIXES,
)

KINDS = {'.mcap': 'rosbag2 file (mcap)', '.db3': 'rosbag2 file (sqlite3)', '.bag': 'ROS 1 bag'}
FOLDER = 'rosbag2 folder'
DEFAULT_TOPIC = '/joint_states'

_MOST_DEFINITIONS = 64
_MOST_LISTED = 20


@dataclass(frozen=True)
class Topic:
    """A topic of a bag, its message type (as package/msg/Name) and how many messages it has."""

    name: str
    type: str
    count: int


class Bag:
    """
    An open bag: rosbag2 folder, bare .mcap or .db3 file, or ROS 1 .bag.

    Files may be compressed, damaged, cut short, without an index or never closed: they are read as
    far as they can be, and `notes` lists what is wrong. To be used in a `with` statement.

    Raises
    ------
    SourceError
        If it is no bag, or nothing of it can be read.
    OSError
        If it does not exist or cannot be opened.

    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        if not os.fspath(path):
            raise SourceError('the path of a recording is empty; name the file or folder.')
        self.path = Path(path)
        self.kind = kind_of(self.path)
        self.topics: tuple[Topic, ...] = ()
        self._files: list[tuple[str, Storage]] = []
        self._notes: list[str] = []
        self._stack = ExitStack()

    def __enter__(self) -> Bag:
        """Open every file and list the topics."""
        try:
            self._open()
            self.topics = self._listed_topics()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *error: object) -> None:
        """Close every file."""
        self._stack.close()

    @property
    def notes(self) -> tuple[str, ...]:
        """Defects of the bag that reading has found: one phrase each, with the file."""
        found = [f'{name}: {note}' for name, storage in self._files for note in storage.notes]
        return (*self._notes, *found)

    def lost(self, topic: str) -> int:
        """Return how many messages of a topic, once read, lay in damaged parts of the files."""
        return sum(storage.lost[topic] for _, storage in self._files)

    def stored(self, topic: str, kind: str = '') -> Iterator[tuple[Channel, int, bytes | None]]:
        """
        Yield the messages of a topic, and of one type if given, in the order of the files.

        Yields
        ------
        channel : Channel
            Its type, encoding and definition.
        receive_ns : int
            When the message was recorded [ns].
        data : bytes or None
            Serialized; None where it was compressed and is damaged.

        Raises
        ------
        SourceError
            If the topic has very many message definitions.

        """
        forms: set[tuple[str, ...]] = set()
        for _, storage in self._files:
            channels = {
                channel.id: channel
                for channel in storage.channels
                if channel.topic == topic and kind in ('', channel.type)
            }
            for number, receive_ns, data in storage.messages(channels):
                channel = channels[number]
                forms.add(channel.form)
                if len(forms) > _MOST_DEFINITIONS:
                    raise SourceError(
                        f'{topic} in {self.path} must have at most {_MOST_DEFINITIONS} message '
                        'definitions, but has more; record it again.'
                    )
                yield channel, receive_ns, _plain(channel, data)

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """
        Yield receive times [ns] and messages of a topic of one type, in the order of the files.

        A message has the fields of its type; it is None where it could not be read. Raises what
        `decoder` raises.

        """
        decoders: dict[tuple[str, ...], Decode] = {}
        for channel, receive_ns, data in self.stored(topic):
            if channel.form not in decoders:
                decoders[channel.form] = self.decoder(channel)
            yield receive_ns, None if data is None else decoders[channel.form](data)

    def decoder(self, channel: Channel) -> Decode:
        """
        Return the function that decodes a channel's messages, to None where they are broken.

        Raises
        ------
        SourceError
            If the bag defines the message type in a way that cannot be read.

        """
        try:
            return message_decoder(*channel.form)
        except Exception as error:  # whatever a definition makes the library raise
            raise SourceError(
                f'the definition of {channel.type} on {channel.topic} in {self.path} '
                f'cannot be read ({_one_line(error)}); choose another topic.'
            ) from error

    def _open(self) -> None:
        if self.path.is_dir():
            files, notes = files_of(self.path)
            self._notes.extend(notes)
        else:
            files = [self.path]
        troubles = []
        for file in files:
            try:
                self._files.append((file.name, open_storage(file, self._stack)))
            except DamageError as damage:
                troubles.append((file, damage))
        if not self._files:
            raise SourceError(self._nothing_readable(*troubles[0]))
        self._notes += [f'{file.name}: nothing can be read ({why})' for file, why in troubles]

    def _nothing_readable(self, file: Path, damage: DamageError) -> str:
        if file.stat().st_size == 0:
            return f'{file} is an empty file; record it again.'
        return (
            f'{file} cannot be read as {KINDS[storage_suffix(file)]}, it is damaged or something '
            f'else ({damage}); record it again, or restore it from a copy.'
        )

    def _listed_topics(self) -> tuple[Topic, ...]:
        counts: dict[tuple[str, str], int] = {}
        for _, storage in self._files:
            for each in storage.channels:
                key = (each.topic, each.type)
                counts[key] = counts.get(key, 0) + each.count
        return tuple(Topic(name, kind, count) for (name, kind), count in sorted(counts.items()))


def kind_of(path: Path) -> str:
    """Return what kind of bag a path is; SourceError if its name is not that of a bag."""
    if path.is_dir():
        return FOLDER
    require_regular_file(path)
    if not is_storage(path):
        raise SourceError(
            f'{path} must be a rosbag2 folder, a {", ".join(SUFFIXES)} file or a data set .npz; '
            'convert it, or correct the name.'
        )
    return KINDS[storage_suffix(path)]


def _plain(channel: Channel, data: bytes) -> bytes | None:
    if channel.encoding == 'ros1':
        return data
    try:
        return plain_message(data)
    except DamageError:
        return None


def _one_line(error: object) -> str:
    return ' '.join(f'{type(error).__name__}: {error}'.split())


def joint_topics(bag: Bag) -> list[Topic]:
    """Return the topics of a bag that carry joint samples."""
    return [topic for topic in bag.topics if topic.type in EXTRACTORS]


def choose_topics(bag: Bag, wanted: str) -> list[Topic]:
    """
    Return the topics to read joint samples from.

    Those named (separated by commas); else the only one with messages, else /joint_states, else
    the only one of JointState.

    Raises
    ------
    SourceError
        If there is none, or several and no way to choose.

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
