"""Open bags of ROS 1 and ROS 2: their files, compressed or not, topics and messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
import os
from pathlib import Path, PurePath
import re
import tempfile
from typing import Any, BinaryIO, cast

import yaml

from lip_id_ros.errors import SourceError
from lip_id_ros.files import require_regular_file
from lip_id_ros.recording.joint_messages import Decode, message_decoder
from lip_id_ros.recording.storage.contents import (
    Channel,
    DamageError,
    FILE_SUFFIXES,
    plain_message,
    Storage,
    unpack_file,
)
from lip_id_ros.recording.storage.mcap import McapFile
from lip_id_ros.recording.storage.ros1 import Ros1File
from lip_id_ros.recording.storage.sqlite import SqliteFile

SUFFIXES: dict[str, Callable[[Path], Storage]] = {
    '.mcap': McapFile,
    '.db3': SqliteFile,
    '.bag': Ros1File,
}

KINDS = {'.mcap': 'rosbag2 file (mcap)', '.db3': 'rosbag2 file (sqlite3)', '.bag': 'ROS 1 bag'}
FOLDER = 'rosbag2 folder'
ACTIVE = '.active'
"""What rosbag and rosbag2 add to the name of a file that is still being written."""
METADATA = 'metadata.yaml'

_LONGEST_METADATA = 2**20
_SHOWN = 5
_MOST_DEFINITIONS = 64


@dataclass(frozen=True)
class Topic:
    """A topic of a bag, its message type (as package/msg/Name) and how many messages it has."""

    name: str
    type: str
    count: int


class Bag:
    """
    An open bag: rosbag2 folder, bare .mcap or .db3 file, or ROS 1 .bag; for a `with` statement.

    Files may be compressed, damaged, cut short, without an index or never closed: they are read as
    far as they can be, and `notes` lists what is wrong. SourceError if it is no bag, or nothing of
    it can be read.
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
        try:
            self._open()
            self.topics = self._listed_topics()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *error: object) -> None:
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

        Each with type, encoding and definition, time of recording [ns], and bytes; None for bytes
        that were compressed and are damaged. SourceError if the topic has very many message
        definitions.
        """
        forms: set[tuple[str, ...]] = set()
        for _, storage in self._files:
            channels = {
                channel.id: channel
                for channel in storage.channels
                if channel.topic == topic and kind in ('', channel.type)
            }
            seen: set[int] = set()
            for number, receive_ns, data in storage.messages(channels):
                channel = channels[number]
                if number not in seen:
                    seen.add(number)
                    forms.add(channel.form)
                    self._check_definitions(topic, len(forms))
                yield channel, receive_ns, _plain(channel, data)

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """
        Yield receive times [ns] and messages of a topic of one type, in the order of the files.

        A message that could not be read is None. Raises what `decoder` raises.
        """
        decoders: dict[tuple[str, ...], Decode] = {}
        for channel, receive_ns, data in self.stored(topic):
            if channel.form not in decoders:
                decoders[channel.form] = self.decoder(channel)
            yield receive_ns, None if data is None else decoders[channel.form](data)

    def _check_definitions(self, topic: str, count: int) -> None:
        if count > _MOST_DEFINITIONS:
            raise SourceError(
                f'{topic} in {self.path} must have at most {_MOST_DEFINITIONS} message '
                'definitions, but has more; record it again.'
            )

    def decoder(self, channel: Channel) -> Decode:
        """
        Return the function that decodes a channel's messages, to None where they are broken.

        SourceError if the bag defines the message type in a way that cannot be read.
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
            f'{path} must be a rosbag2 folder, a {", ".join(SUFFIXES)} file, a log .csv or a data '
            'set .npz; unpack or convert it, or correct the name.'
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


def is_storage(path: Path) -> bool:
    """Whether a file has the name of a storage file, compressed or not."""
    return storage_suffix(path) in SUFFIXES


def storage_suffix(path: Path) -> str:
    """Return the suffix of the format, without that of compression."""
    name = Path(path.name.removesuffix(ACTIVE))
    return Path(name.stem).suffix if name.suffix in FILE_SUFFIXES else name.suffix


def open_storage(path: Path, stack: ExitStack) -> Storage:
    """
    Open a storage file; a compressed one is decompressed into a temporary file first.

    The stack closes the file and removes what is temporary. DamageError if it cannot be read.
    """
    with open(path, 'rb') as source:  # so that errors of the file system keep their name
        if not source.read(1):
            raise DamageError('it is empty')
    suffix, method = storage_suffix(path), FILE_SUFFIXES.get(path.suffix)
    trouble = ''
    if method is not None:
        target = stack.enter_context(tempfile.NamedTemporaryFile(suffix=suffix))  # noqa: SIM115
        with open(path, 'rb') as source:
            trouble = unpack_file(source, cast(BinaryIO, target), method)
        target.flush()
        path = Path(target.name)
    storage = SUFFIXES[suffix](path)
    stack.callback(storage.close)
    if trouble:
        storage.notes[trouble] = None
    return storage


def files_of(folder: Path) -> tuple[list[Path], list[str]]:
    """
    Return the storage files of a rosbag2 folder by their numbers, and notes on its metadata.

    The files themselves are trusted: those that metadata.yaml names and that are there, and those
    of the same format that it does not name (a killed recorder never wrote them down). Where it is
    absent, unreadable or names none of them, all are taken. SourceError if there is none.
    """
    files = (file for file in folder.iterdir() if is_storage(file) and file.is_file())
    there = {file.name: file for file in sorted(files, key=_by_number)}
    named, notes = _named(folder / METADATA)
    if not there:
        raise SourceError(_no_bag(folder, named))
    notes += [
        f'{METADATA} names {name}, which is not there' for name in named if name not in there
    ]
    formats = {storage_suffix(there[name]) for name in named if name in there}
    chosen = [
        file
        for file in there.values()
        if not (formats and storage_suffix(file) not in formats) and not _is_copy(file, there)
    ]
    if named:
        notes += [f'{METADATA} does not name {f.name}' for f in chosen if f.name not in named]
    notes += [f'{file.name} was left aside' for file in there.values() if file not in chosen]
    return chosen, notes


def _no_bag(folder: Path, named: list[str]) -> str:
    # a folder of recordings is a frequent mistake
    inside = sorted({f'{file.parent.name}/' for file in folder.glob('*/*') if is_storage(file)})
    inside += sorted(file.name for file in folder.glob('*.csv'))
    found = f'none of {", ".join(named)}, which {METADATA} names' if named else 'no such file'
    remedy = 'give the folder or file that was recorded'
    if inside:
        more = ', ...' if len(inside) > _SHOWN else ''
        found = f'recordings: {", ".join(inside[:_SHOWN])}{more}'
        remedy = 'give one or several of these by name'
    return f'{folder} must hold {", ".join(SUFFIXES)} files of one bag, but has {found}; {remedy}.'


def _named(path: Path) -> tuple[list[str], list[str]]:
    try:
        require_regular_file(path)
        if path.stat().st_size > _LONGEST_METADATA:
            return [], [f'{METADATA} is too long to be read']
        text = path.read_bytes()
    except FileNotFoundError:
        return [], [f'{METADATA} is missing']
    except SourceError:
        return [], [f'{METADATA} is not a file']
    try:
        information: Any = yaml.safe_load(text)['rosbag2_bagfile_information']
        return [PurePath(name).name for name in information['relative_file_paths']], []
    except Exception as error:  # whatever nonsense makes the parser, or the look-up, raise
        return [], [f'{METADATA} cannot be read ({type(error).__name__})']


def _is_copy(file: Path, there: dict[str, Path]) -> bool:
    """Whether a compressed file lies beside its decompressed form."""
    return storage_suffix(file) != file.suffix and file.stem in there


def _by_number(file: Path) -> list[Any]:
    return [int(part) if part.isdigit() else part for part in re.split(r'(\d+)', file.name)]
