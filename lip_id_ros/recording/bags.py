"""Bags of ROS 1 and ROS 2 behind one face: which files, topics and message definitions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import groupby
from operator import itemgetter
import os
from pathlib import Path
from types import TracebackType
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

from lip_id_ros.errors import SourceError
from lip_id_ros.recording.bag_folder import files_of
from lip_id_ros.recording.definitions import KNOWN_DEFINITIONS
from lip_id_ros.recording.storage import Channel, DamageError, is_storage, open_storage, SUFFIXES
from lip_id_ros.recording.storage.compression import plain_message
from lip_id_ros.recording.storage.contents import Storage
from lip_id_ros.recording.storage.opening import storage_suffix

KINDS = {'.mcap': 'rosbag2 file (mcap)', '.db3': 'rosbag2 file (sqlite3)', '.bag': 'ROS 1 bag'}
FOLDER = 'rosbag2 folder'

Decoder = Callable[[bytes], Any]

_MOST_DECODERS = 64


@dataclass(frozen=True)
class Topic:
    """A topic of a bag, its message type (as package/msg/Name) and how many messages it has."""

    name: str
    type: str
    count: int


class Bag:
    """
    An open bag: rosbag2 folder, bare .mcap or .db3 file, or ROS 1 .bag.

    Files may be compressed, damaged, cut short, without an index or never closed: they are read
    as far as they can be, and `notes` says what is wrong. To be used in a `with` statement.

    Parameters
    ----------
    path : path
        The bag.

    Attributes
    ----------
    topics : tuple of Topic

    Raises
    ------
    SourceError
        If it is no bag, or nothing of it can be read.
    OSError
        If it does not exist or cannot be opened.

    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close every file."""
        self._stack.close()

    @property
    def notes(self) -> tuple[str, ...]:
        """What is wrong with the bag, as far as it was read: one phrase each, with the file."""
        found = [f'{name}: {note}' for name, storage in self._files for note in storage.notes]
        return (*self._notes, *found)

    def lost(self, topic: str) -> int:
        """Return how many messages of a topic, once read, lay in damaged parts of the files."""
        return sum(storage.lost[topic] for _, storage in self._files)

    def stored(self, topic: str, kind: str = '') -> Iterator[tuple[Channel, int, bytes | None]]:
        """
        Yield the messages of a topic as they are stored, in the order of the files.

        Parameters
        ----------
        topic, kind : str
            Name and, where it has several, type of the topic.

        Yields
        ------
        channel : Channel
            Tells type, encoding and definition.
        receive_ns : int
            When the message was recorded [ns].
        data : bytes or None
            Serialized; None where it was compressed and is damaged.

        """
        for _, storage in self._files:
            publishers: dict[tuple[str, ...], list[Channel]] = {}
            for channel in storage.channels:
                if channel.topic == topic and kind in ('', channel.type):
                    publishers.setdefault(channel.form, []).append(channel)
            for channels in publishers.values():
                for receive_ns, data in storage.messages([channel.id for channel in channels]):
                    yield channels[0], receive_ns, _plain(channels[0], data)

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """
        Yield the messages of a topic in the order of the files.

        Parameters
        ----------
        topic : str
            Name of a topic of one type.

        Yields
        ------
        receive_ns : int
            When the message was recorded [ns].
        message : object
            With the fields of its type; None where it could not be read.

        Raises
        ------
        SourceError
            If the bag defines the message type in a way that cannot be read.

        """
        for channel, stored in groupby(self.stored(topic), itemgetter(0)):
            decode = self.decoder(channel)
            for _, receive_ns, data in stored:
                yield receive_ns, None if data is None else decode(data)

    def decoder(self, channel: Channel) -> Decoder:
        """
        Return the function that decodes a channel's messages, to None where they are broken.

        Raises
        ------
        SourceError
            If the bag defines the message type in a way that cannot be read.

        """
        try:
            decode = _decoder(*channel.form)
        except Exception as error:  # whatever a definition makes the library raise
            raise SourceError(
                f'the definition of {channel.type} on {channel.topic} in {self.path} '
                f'cannot be read ({_one_line(error)}); choose another topic.'
            ) from error

        def decoded(data: bytes) -> Any:
            try:
                return decode(data)
            except Exception:  # whatever a broken message makes it raise: it is counted
                return None

        return decoded

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
    """
    Say what kind of bag a path is.

    Raises
    ------
    SourceError
        If its name is not that of a bag.
    OSError
        If it does not exist.

    """
    path.stat()
    if path.is_dir():
        return FOLDER
    if not is_storage(path):
        raise SourceError(
            f'{path} must be a rosbag2 folder, a {", ".join(SUFFIXES)} file or a data set .npz; '
            'convert it, or correct the name.'
        )
    return KINDS[storage_suffix(path)]


@cache
def _store(is_ros1: bool) -> Any:
    return get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_JAZZY)


@lru_cache(_MOST_DECODERS)
def _decoder(name: str, encoding: str, definition: str) -> Decoder:
    """Trust the known definition of a standard type; take the bag's own for any other."""
    is_ros1 = encoding == 'ros1'
    if encoding not in ('ros1', 'cdr'):
        raise ValueError(f'its messages are encoded as {encoding or "nothing known"}')
    store = _store(is_ros1)
    if name not in store.fielddefs and not definition and name in KNOWN_DEFINITIONS:
        return _known_decoder(name)
    if name not in store.fielddefs:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(definition, name))
    if is_ros1:
        return lambda data: store.deserialize_ros1(data, name)
    return lambda data: store.deserialize_cdr(data, name)


def _known_decoder(name: str) -> Decoder:
    stores = []
    for definition in KNOWN_DEFINITIONS[name]:
        store = get_typestore(Stores.ROS2_JAZZY)
        store.register(get_types_from_msg(definition, name))
        stores.append(store)

    def decode(data: bytes) -> Any:
        for store in stores:
            with suppress(SerdeError):
                return store.deserialize_cdr(data, name)
        return None

    return decode


def _plain(channel: Channel, data: bytes) -> bytes | None:
    if channel.encoding == 'ros1':
        return data
    try:
        return plain_message(data)
    except DamageError:
        return None


def _one_line(error: object) -> str:
    return ' '.join(f'{type(error).__name__}: {error}'.split())
