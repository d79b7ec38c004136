"""
Read files of records and chunks from front to back, as MCAP files and ROS 1 bags are.

The index at the end of such a file is not needed, and only asked where to go on after damage: a
file without one, or cut short, is read like any other. Only the chunks that hold a wanted topic
are decompressed, one at a time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections import Counter
from collections.abc import Collection, Generator, Iterator
from dataclasses import replace
from enum import Enum
import os
from pathlib import Path
from typing import NamedTuple

from lip_id_ros.recording.storage.contents import Channel, DamageError, LARGEST_CHUNK

_MOST_UNPACKED = 8 * 2**30
_MOST_RATIO = 64
"""No recording unpacks to more than these bytes, or so many times its size."""
_LONGEST_GAP = 4096
"""So many bytes before the index may be filled up with anything."""


class Kind(Enum):
    """What a record is to the reader."""

    CONTENT = 'a message, or the declaration of a channel'
    CHUNK = 'a chunk of them'
    INDEX = 'how many messages of a channel the chunk before has'
    END = 'the end of the file'
    OTHER = 'anything else'


class Record(NamedTuple):
    """Where a record lies; `channel` is that of an index or of a message outside of chunks."""

    kind: Kind
    start: int
    end: int
    channel: int | None = None
    messages: int = 0
    is_cut: bool = False


class Item(NamedTuple):
    """A message, or the declaration of a channel (without time)."""

    channel: int
    time_ns: int | None
    data: bytes


class ChunkedFile(ABC):
    """A storage file of records, see `contents.Storage`; DamageError if it is none."""

    def __init__(self, path: Path) -> None:
        self.notes: dict[str, None] = {}
        self.lost: Counter[str] = Counter()
        self._declared: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        self._starts: list[int] | None = None
        self._index_start = 0
        self._room = 0
        self._stream = open(path, 'rb')  # noqa: SIM115  closed by close()
        try:
            self._size = os.fstat(self._stream.fileno()).st_size
            self._first = self._check_magic()
            self._survey()
        except BaseException:
            self._stream.close()
            raise

    @property
    def channels(self) -> list[Channel]:
        """What the file holds."""
        return [replace(each, count=self._counts[each.id]) for each in self._declared.values()]

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def messages(self, ids: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield channel, receive time [ns] and bytes of messages of some channels, as they lie."""
        wanted = frozenset(ids)
        for channel in wanted:
            self.lost.pop(self._declared[channel].topic, None)
        for record, counts in self._with_counts():
            if counts and not wanted & counts.keys():
                continue
            found: Counter[int] = Counter()
            for item in self._inside(record, wanted):
                if item.time_ns is not None:
                    found[item.channel] += 1
                    yield item.channel, item.time_ns, item.data
            for channel, count in counts.items():
                if channel in wanted and count > found[channel]:
                    self.lost[self._declared[channel].topic] += count - found[channel]

    @abstractmethod
    def _check_magic(self) -> int:
        """Return where the first record is; raise DamageError if it is another kind of file."""

    @abstractmethod
    def _record_at(self, position: int) -> Record | None:
        """Return the record there, None where there is none."""

    @abstractmethod
    def _chunk_starts(self) -> Iterator[int]:
        """Yield where the index at the end of the file begins, then where chunks do."""

    @abstractmethod
    def _content(self, record: Record) -> bytes:
        """Return the records of a chunk; raise DamageError where they cannot be had."""

    @abstractmethod
    def _items(self, data: bytes, wanted: Collection[int] | None) -> Generator[Item, None, int]:
        """Yield declarations and messages of wanted channels; return the bytes left."""

    @abstractmethod
    def _declare(self, item: Item) -> None:
        """Note the channel, or what else is needed to know it."""

    def _survey(self) -> None:
        for record, counts in self._with_counts():
            if record.kind is Kind.CONTENT and record.channel is not None:
                self._counts[record.channel] += 1
            elif not counts or not counts.keys() <= self._declared.keys():
                found = Counter(item.channel for item in self._declaring(record))
                self._counts.update(counts or found)
            else:
                self._counts.update(counts)
        strays = sum(count for id_, count in self._counts.items() if id_ not in self._declared)
        if strays:
            self.notes[f'{strays} messages belong to no topic that is declared'] = None

    def _declaring(self, record: Record) -> Iterator[Item]:
        """Note the declarations of a record or chunk, yield its messages."""
        for item in self._inside(record, None):
            if item.time_ns is None:
                self._declare(item)
            else:
                yield item

    def _inside(self, record: Record, wanted: Collection[int] | None) -> Iterator[Item]:
        if record.channel is not None and wanted is not None and record.channel not in wanted:
            return
        try:
            if record.end - record.start > LARGEST_CHUNK:
                raise DamageError('too much for one chunk or message')
            if self._room < 0:
                raise DamageError('the chunks before it unpack to more than can be')
            is_chunk = record.kind is Kind.CHUNK
            data = self._content(record) if is_chunk else self._read(record.start, record.end)
            self._room -= len(data)
            rest = yield from self._items(data, wanted)
            if rest and not record.is_cut:
                raise DamageError(f'its last {rest} bytes are no record')
        except DamageError as damage:
            self.notes[f'bytes {record.start} to {record.end} are damaged: {damage}'] = None

    def _with_counts(self) -> Iterator[tuple[Record, Counter[int]]]:
        """Yield contents, and chunks with the messages of each channel, where these are known."""
        chunk, counts = None, Counter[int]()
        self._room = max(_MOST_UNPACKED, _MOST_RATIO * self._size)
        for record in self._records():
            if record.kind is Kind.INDEX and chunk is not None:
                counts[record.channel or 0] += record.messages
                continue
            if chunk is not None:
                yield chunk, counts
            chunk, counts = (record if record.kind is Kind.CHUNK else None), Counter()
            if record.kind is Kind.CONTENT:
                yield record, counts
        if chunk is not None:
            yield chunk, counts

    def _records(self) -> Iterator[Record]:
        position = self._first
        while position < self._size:
            record = self._record_at(position)
            if record is not None:
                yield record
                if record.kind is Kind.END:
                    return
            if record is None or record.is_cut:
                resume = self._next_chunk(position)
                if resume is None:
                    self._note_cut(position, is_read=record is not None)
                    return
                is_gap = resume == self._index_start and resume - position < _LONGEST_GAP
                what = 'hold no record' if is_gap else 'are damaged'
                self.notes[f'bytes {position} to {resume} {what}'] = None
                position = resume
            else:
                position = record.end
        self._note_cut(position, is_read=False)

    def _next_chunk(self, position: int) -> int | None:
        if self._starts is None:
            found = [start for start in self._chunk_starts() if start < self._size]
            self._index_start = found[0] if found else 0
            self._starts = sorted(found)
        number = bisect_right(self._starts, position)
        return self._starts[number] if number < len(self._starts) else None

    def _note_cut(self, position: int, *, is_read: bool) -> None:
        rest = self._size - position
        what = f'the last {rest} bytes cannot be read' if rest else 'its end is missing'
        if is_read:
            what = 'its last chunk was read as far as it goes'
        self.notes[f'the file was cut short or never closed, {what}'] = None

    def _read(self, start: int, end: int) -> bytes:
        if not 0 <= start < self._size:
            return b''
        self._stream.seek(start)
        return self._stream.read(max(0, min(end, self._size) - start))
