"""MCAP files (https://mcap.dev/spec)."""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator
import struct
from typing import NamedTuple
import zlib

from lip_id_ros.recording.storage.chunked import ChunkedFile, Item, Kind, Record
from lip_id_ros.recording.storage.contents import Channel, DamageError, full_type, unpacked_chunk

MAGIC = b'\x89MCAP0\r\n'

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX, _CHUNK_INDEX = 2, 3, 4, 5, 6, 7, 8
_KINDS = {
    _SCHEMA: Kind.CONTENT,
    _CHANNEL: Kind.CONTENT,
    _MESSAGE: Kind.CONTENT,
    _CHUNK: Kind.CHUNK,
    _INDEX: Kind.INDEX,
    _FOOTER: Kind.END,
}
_LAST_KNOWN, _FIRST_PRIVATE = 0x0F, 0x80
_HEAD = struct.Struct('<BQ')
_MESSAGE_HEAD = struct.Struct('<HIQQ')
_BOTH_HEADS = struct.Struct('<BQHIQQ')
_CHUNK_HEAD = struct.Struct('<QQQII')
_FOOTER_LENGTH = 20
_ENTRY_LENGTH = 16  # of a message index


class _Schema(NamedTuple):
    name: str
    definition: str


class McapFile(ChunkedFile):
    """An MCAP file, of any profile; see `ChunkedFile`."""

    _schemas: dict[int, _Schema]

    def _check_magic(self) -> int:
        self._schemas = {}
        if self._read(0, len(MAGIC)) != MAGIC:
            raise DamageError('it does not begin as an MCAP file does')
        return len(MAGIC)

    def _record_at(self, position: int) -> Record | None:
        head = self._read(position, position + _HEAD.size)
        if len(head) < _HEAD.size:
            return None
        code, length = _HEAD.unpack(head)
        start = position + _HEAD.size
        if code == 0 or _LAST_KNOWN < code < _FIRST_PRIVATE:
            return None
        if length > self._size - start:
            cut = Record(Kind.CHUNK, position, self._size, is_cut=True)
            return cut if code == _CHUNK else None
        kind, end = _KINDS.get(code, Kind.OTHER), start + length
        if code == _MESSAGE and length >= _MESSAGE_HEAD.size:
            return Record(kind, position, end, self._number(start))
        if code == _INDEX:
            entries = max(0, length - 6) // _ENTRY_LENGTH
            return Record(kind, position, end, self._number(start), entries)
        return Record(kind, position, end)

    def _number(self, position: int) -> int:
        return int.from_bytes(self._read(position, position + 2), 'little')

    def _chunk_starts(self) -> Iterator[int]:
        footer = self._read(self._size - _HEAD.size - _FOOTER_LENGTH - len(MAGIC), self._size)
        if not footer.endswith(MAGIC) or footer[0] != _FOOTER:
            return
        (position,) = struct.unpack_from('<Q', footer, _HEAD.size)
        if position:
            yield position
        while position and (record := self._record_at(position)) is not None:
            body = record.start + _HEAD.size
            if self._read(record.start, record.start + 1)[0] == _CHUNK_INDEX:
                yield int.from_bytes(self._read(body + 16, body + 24), 'little')
            if record.kind is Kind.END or record.end <= position:
                return
            position = record.end

    def _content(self, record: Record) -> bytes:
        data = self._read(record.start + _HEAD.size, record.end)
        try:
            _, _, size, checksum, name_length = _CHUNK_HEAD.unpack_from(data)
            start = _CHUNK_HEAD.size + name_length
            method = data[_CHUNK_HEAD.size : start].decode()
            (packed_size,) = struct.unpack_from('<Q', data, start)
        except (struct.error, UnicodeDecodeError) as error:
            raise DamageError('the head of a chunk') from error
        packed = data[start + 8 : start + 8 + packed_size]
        content = unpacked_chunk(packed, method, size, is_cut=record.is_cut)
        if checksum and not record.is_cut and zlib.crc32(content) != checksum:
            raise DamageError('the checksum of a chunk')
        return content

    def _items(self, data: bytes, wanted: Collection[int] | None) -> Generator[Item, None, int]:
        position, size, head = 0, len(data), _HEAD.size
        room = data + bytes(_MESSAGE_HEAD.size)  # one struct for both heads, where there is one
        while position + head <= size:
            code, length, channel, _, time_ns, _ = _BOTH_HEADS.unpack_from(room, position)
            start = position + head
            end = start + length
            if end > size:
                break
            if code == _MESSAGE and length >= _MESSAGE_HEAD.size:
                if wanted is None:
                    yield Item(channel, time_ns, b'')
                elif channel in wanted:
                    yield Item(channel, time_ns, data[start + _MESSAGE_HEAD.size : end])
            elif code in (_SCHEMA, _CHANNEL):
                yield Item(code, None, data[start:end])
            position = end
        return size - position

    def _declare(self, item: Item) -> None:
        try:
            number, rest = int.from_bytes(item.data[:2], 'little'), item.data[2:]
            if item.channel == _SCHEMA:
                name, _, definition = _texts(rest, 3)
                self._schemas[number] = _Schema(name, definition)
            elif number not in self._declared:
                topic, encoding = _texts(rest[2:], 2)
                schema = self._schemas.get(int.from_bytes(rest[:2], 'little'), _Schema('', ''))
                self._declared[number] = Channel(
                    number, topic, full_type(schema.name), encoding, schema.definition, 0
                )
        except (struct.error, UnicodeDecodeError):
            self.notes['the declaration of a topic is damaged'] = None


def _texts(data: bytes, count: int) -> list[str]:
    texts: list[str] = []
    position = 0
    for _ in range(count):
        (length,) = struct.unpack_from('<I', data, position)
        position += 4
        text = data[position : position + length]
        # a definition may be in any encoding; names that are not UTF-8 are damaged
        texts.append(text.decode(errors='strict' if len(texts) < 2 else 'replace'))
        position += length
    return texts
