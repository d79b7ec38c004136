"""ROS 1 bags (http://wiki.ros.org/Bags/Format/2.0)."""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator, Mapping
import struct

from lip_id_ros.recording.storage.chunked import ChunkedFile, Item, Kind, Record
from lip_id_ros.recording.storage.contents import Channel, DamageError, full_type, unpacked_chunk

MAGIC = b'#ROSBAG V2.0\n'

_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7
_KINDS = {
    _MESSAGE: Kind.CONTENT,
    _CONNECTION: Kind.CONTENT,
    _CHUNK: Kind.CHUNK,
    _INDEX: Kind.INDEX,
}
_LONGEST_HEADER = 2**20
_TIME = struct.Struct('<II')

Fields = Mapping[bytes, bytes]


class Ros1File(ChunkedFile):
    """A ROS 1 bag, indexed or not (.bag.active); see `ChunkedFile`."""

    def _check_magic(self) -> int:
        if self._read(0, len(MAGIC)) != MAGIC:
            raise DamageError('it does not begin as a ROS 1 bag of version 2.0 does')
        return len(MAGIC)

    def _record_at(self, position: int) -> Record | None:
        found = self._fields_at(position)
        if found is None:
            return None
        fields, start, length = found
        kind = _KINDS.get(_code(fields), Kind.OTHER)
        if length > self._size - start:
            cut = Record(Kind.CHUNK, position, self._size, is_cut=True)
            return cut if kind is Kind.CHUNK else None
        end = start + length
        if kind is Kind.INDEX:
            return Record(kind, position, end, _number(fields, b'conn'), _number(fields, b'count'))
        if _code(fields) == _MESSAGE:
            return Record(kind, position, end, _number(fields, b'conn'))
        if end == self._size:  # there is no end record: the last one ends with the file
            return Record(Kind.END if kind is Kind.OTHER else kind, position, end)
        return Record(kind, position, end)

    def _fields_at(self, position: int) -> tuple[Fields, int, int] | None:
        """Return the header of a record, where its data begin, and how long they are."""
        header_length = int.from_bytes(self._read(position, position + 4), 'little')
        start = position + 4 + header_length + 4
        if header_length > _LONGEST_HEADER or start > self._size:
            return None
        head = self._read(position + 4, start)
        fields = _fields(head[:-4])
        if fields is None or _code(fields) == 0:
            return None
        return fields, start, int.from_bytes(head[-4:], 'little')

    def _chunk_starts(self) -> Iterator[int]:
        found = self._fields_at(len(MAGIC))
        position = _number(found[0], b'index_pos') if found else 0
        if position and self._fields_at(position) is not None:
            yield position
        while position and (found := self._fields_at(position)) is not None:
            fields, start, length = found
            if _code(fields) == _CHUNK_INFO:
                yield _number(fields, b'chunk_pos')
            position = start + length

    def _content(self, record: Record) -> bytes:
        found = self._fields_at(record.start)
        if found is None:
            raise DamageError('the head of a chunk')
        fields, start, _ = found
        method = fields.get(b'compression', b'').decode(errors='replace')
        size = _number(fields, b'size')
        return unpacked_chunk(self._read(start, record.end), method, size, is_cut=record.is_cut)

    def _items(self, data: bytes, wanted: Collection[int] | None) -> Generator[Item, None, int]:
        position, size = 0, len(data)
        while position + 4 <= size:
            start = position + 8 + int.from_bytes(data[position : position + 4], 'little')
            fields = _fields(data[position + 4 : start - 4]) if start <= size else None
            if fields is None:
                break
            end = start + int.from_bytes(data[start - 4 : start], 'little')
            if end > size:
                break
            channel = _number(fields, b'conn')
            if _code(fields) == _CONNECTION:
                yield Item(channel, None, fields.get(b'topic', b'') + b'\0' + data[start:end])
            elif _code(fields) == _MESSAGE and (wanted is None or channel in wanted):
                yield Item(channel, _time_ns(fields), b'' if wanted is None else data[start:end])
            position = end
        return size - position

    def _declare(self, item: Item) -> None:
        topic, _, body = item.data.partition(b'\0')
        fields = _fields(body)
        if fields is None or b'type' not in fields:
            self.notes['the declaration of a topic is damaged'] = None
            return
        texts = [
            each.decode(errors='replace')
            for each in (topic, fields[b'type'], fields.get(b'message_definition', b''))
        ]
        self._declared.setdefault(
            item.channel,
            Channel(item.channel, texts[0], full_type(texts[1]), 'ros1', texts[2], 0),
        )


def _fields(data: bytes) -> Fields | None:
    fields, position = {}, 0
    while position < len(data):
        length = int.from_bytes(data[position : position + 4], 'little')
        name, equals, value = data[position + 4 : position + 4 + length].partition(b'=')
        position += 4 + length
        if not equals or position > len(data):
            return None
        fields[name] = value
    return fields


def _code(fields: Fields) -> int:
    return _number(fields, b'op')


def _number(fields: Fields, name: bytes) -> int:
    return int.from_bytes(fields.get(name, b''), 'little')


def _time_ns(fields: Fields) -> int:
    value = fields.get(b'time', b'')
    seconds, nanoseconds = _TIME.unpack(value) if len(value) == _TIME.size else (0, 0)
    return int(seconds) * 10**9 + int(nanoseconds)
