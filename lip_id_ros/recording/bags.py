"""Bags of ROS 1 and ROS 2 behind one face; the only place that knows the `rosbags` library."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
import os
from pathlib import Path
import re
from types import TracebackType
from typing import Any

from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Connection
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

from lip_id_ros.errors import SourceError

METADATA = 'metadata.yaml'
KINDS = {'.mcap': 'rosbag2 file (mcap)', '.db3': 'rosbag2 file (sqlite3)', '.bag': 'ROS 1 bag'}
FOLDER = 'rosbag2 folder'

Reader = rosbag1.Reader | rosbag2.Reader
Decoder = Callable[[bytes], Any]


@dataclass(frozen=True)
class Topic:
    """A topic of a bag, its message type (as package/msg/Name) and how many messages it has."""

    name: str
    type: str
    count: int


class Bag:
    """
    An open bag: rosbag2 folder, bare .mcap or .db3 file, or ROS 1 .bag.

    In a folder, `metadata.yaml` is followed where it is right; where it is absent, unreadable or
    names other files, the storage files that lie in the folder are read in the order of their
    numbers. To be used in a `with` statement.

    Parameters
    ----------
    path : path
        The bag.

    Raises
    ------
    SourceError
        If it is no bag, or a damaged one.
    OSError
        If it does not exist or cannot be opened.

    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.kind = kind_of(self.path)
        self.topics: tuple[Topic, ...] = ()
        self._readers: list[Reader] = []
        self._stack = ExitStack()

    def __enter__(self) -> Bag:
        """Open every file and list the topics."""
        try:
            self._readers = self._open()
            self.topics = _topics([reader.connections for reader in self._readers])
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
            If the file is damaged, or defines the message type in a way that cannot be read.

        """
        for reader in self._readers:
            connections = [each for each in reader.connections if each.topic == topic]
            if not connections:
                continue
            is_ros1 = isinstance(reader, rosbag1.Reader)
            decoders = {each.id: self._decoder(each, is_ros1) for each in connections}
            stored = reader.messages(connections)
            while (item := self._next(stored)) is not None:
                connection, receive_ns, data = item
                yield receive_ns, _decoded(decoders[connection.id], data)

    def _next(self, stored: Iterator[tuple[Connection, int, bytes]]) -> Any:
        try:
            return next(stored, None)
        except Exception as error:
            raise self._damaged(error) from error

    def _open(self) -> list[Reader]:
        if self.path.is_dir() and (self.path / METADATA).exists():
            try:
                return [self._stack.enter_context(rosbag2.Reader(self.path))]
            except PermissionError:
                raise
            except Exception as error:
                return [self._open_file(file) for file in self._storage_files(error)]
        if self.path.is_dir():
            return [self._open_file(file) for file in self._storage_files(None)]
        return [self._open_file(self.path)]

    def _storage_files(self, error: Exception | None) -> list[Path]:
        files = [file for file in self.path.iterdir() if file.suffix in KINDS]
        if files:
            return sorted(files, key=_by_number)
        reason = f'{METADATA} says otherwise: {_one_line(error)}' if error else f'nor {METADATA}'
        raise SourceError(
            f'{self.path} must hold a bag, but there is no {", ".join(KINDS)} file in it '
            f'({reason}); give the folder or file that was recorded.'
        )

    def _open_file(self, file: Path) -> Reader:
        with open(file, 'rb') as stream:  # so that errors of the file system keep their name
            if not stream.read(1):
                raise SourceError(f'{file} is an empty file; record it again.')
        try:
            if file.suffix == '.bag':
                return self._stack.enter_context(rosbag1.Reader(file))
            return self._stack.enter_context(rosbag2.Reader(file))
        except Exception as error:
            raise self._damaged(error) from error

    def _damaged(self, error: Exception) -> SourceError:
        return SourceError(
            f'{self.path} cannot be read as {self.kind}, it is damaged or something else '
            f'({_one_line(error)}); try `ros2 bag reindex` or record it again.'
        )

    def _decoder(self, connection: Connection, is_ros1: bool) -> Decoder:
        try:
            return _decoder(connection, is_ros1)
        except Exception as error:
            raise SourceError(
                f'the definition of {connection.msgtype} on {connection.topic} in {self.path} '
                f'cannot be read ({_one_line(error)}); choose another topic.'
            ) from error


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
    if path.suffix not in KINDS:
        raise SourceError(
            f'{path} must be a rosbag2 folder, a {", ".join(KINDS)} file or a data set .npz; '
            'convert it, or correct the name.'
        )
    return KINDS[path.suffix]


def _topics(connections: Sequence[Sequence[Connection]]) -> tuple[Topic, ...]:
    counts: dict[tuple[str, str], int] = {}
    for each in (each for some in connections for each in some):
        key = (each.topic, each.msgtype)
        counts[key] = counts.get(key, 0) + each.msgcount
    return tuple(Topic(name, kind, count) for (name, kind), count in sorted(counts.items()))


def _decoder(connection: Connection, is_ros1: bool) -> Decoder:
    """Trust the known definition of a standard type; take the bag's own for any other."""
    name = connection.msgtype
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_JAZZY)
    if name not in store.fielddefs:
        store = get_typestore(Stores.EMPTY)
        store.register(get_types_from_msg(connection.msgdef.data, name))
    if is_ros1:
        return lambda data: store.deserialize_ros1(data, name)
    return lambda data: store.deserialize_cdr(data, name)


def _decoded(decode: Decoder, data: bytes) -> Any:
    try:
        return decode(data)
    except Exception:  # whatever a broken message makes the library raise: it is counted
        return None


def _by_number(file: Path) -> list[Any]:
    parts = re.split(r'(\d+)', file.name)
    return [int(part) if part.isdigit() else part for part in parts]


def _one_line(error: object) -> str:
    return ' '.join(f'{type(error).__name__}: {error}'.split())
