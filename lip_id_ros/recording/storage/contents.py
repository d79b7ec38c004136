"""Channels, damage and bounded decompression, common to all storage files of bags."""

from __future__ import annotations

import bz2
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
import sys
from typing import Any, BinaryIO, Protocol

import lz4.frame

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

LARGEST_MESSAGE = 64 * 2**20
"""A compressed message or chunk never takes more memory than these two, in bytes."""
LARGEST_CHUNK = 256 * 2**20

_BLOCK = 2**20
_DECOMPRESSORS: dict[str, Callable[[], Any]] = {
    'zstd': zstd.ZstdDecompressor,
    'lz4': lz4.frame.LZ4FrameDecompressor,
    'bz2': bz2.BZ2Decompressor,
}
_MAGIC = {b'\x28\xb5\x2f\xfd': 'zstd', b'\x04\x22\x4d\x18': 'lz4'}
FILE_SUFFIXES = {'.zstd': 'zstd', '.zst': 'zstd', '.lz4': 'lz4'}


class DamageError(Exception):
    """A file, or a part of it, that cannot be read, with the reason in a few words."""


@dataclass(frozen=True)
class Channel:
    """One publisher's topic in one file, with its type as package/msg/Name."""

    id: int
    topic: str
    type: str
    encoding: str
    definition: str
    count: int

    @property
    def form(self) -> tuple[str, str, str]:
        """What its messages are read by."""
        return self.type, self.encoding, self.definition


class Storage(Protocol):
    """
    An open storage file.

    `notes`: what is wrong with the file, a phrase each, as it was found; the values mean nothing.
    `lost`: messages that the file once had and cannot be read, by topic, as far as `messages`
    went.
    """

    notes: dict[str, None]
    lost: Counter[str]

    @property
    def channels(self) -> list[Channel]:
        """What the file holds."""

    def messages(self, ids: Collection[int]) -> Iterator[tuple[int, int, bytes]]:
        """Yield channel, receive time [ns] and bytes of messages of some channels, as they lie."""

    def close(self) -> None:
        """Close the file."""


def full_type(name: str) -> str:
    """Return package/msg/Name for a type that ROS 1 calls package/Name."""
    package, _, rest = name.partition('/')
    return name if '/' in rest or not rest else f'{package}/msg/{rest}'


def unpacked_chunk(data: bytes, method: str, size: int, *, is_cut: bool) -> bytes:
    """
    Decompress a chunk of known size; of one that is cut short, as much as there is.

    DamageError if it is damaged, or claims to be larger than `LARGEST_CHUNK`.
    """
    if size > LARGEST_CHUNK:
        raise DamageError(f'a chunk claims {size} bytes')
    limit = size if is_cut else size + 1  # one byte more shows that there is more
    unpacked = data if method in ('', 'none') else _limited(data, method, limit)
    if len(unpacked) != size and not is_cut:
        more = ' or more' if len(unpacked) > size else ''
        raise DamageError(f'a chunk has {len(unpacked)} bytes{more} instead of {size}')
    return unpacked


def plain_message(data: bytes) -> bytes:
    """Return a ROS 2 message, decompressed where it was compressed; DamageError if that fails."""
    method = _MAGIC.get(data[:4])  # no serialized message begins like that
    return data if method is None else _limited(data, method, LARGEST_MESSAGE)


def unpack_file(source: BinaryIO, target: BinaryIO, method: str) -> str:
    """Decompress frames block by block, as far as it goes; return what stopped it, or ''."""
    decompressor = _DECOMPRESSORS[method]()
    is_begun = False
    try:
        for block in iter(lambda: source.read(_BLOCK), b''):
            rest = block
            while rest:
                if decompressor.eof:
                    decompressor, is_begun = _DECOMPRESSORS[method](), False
                for piece in _pieces(decompressor, rest):
                    target.write(piece)
                is_begun = True
                rest = decompressor.unused_data if decompressor.eof else b''
    except OSError:
        raise
    except Exception as error:
        return f'its compression is damaged ({error})'
    return '' if decompressor.eof or not is_begun else 'it was cut short'


def _pieces(decompressor: Any, block: bytes) -> Iterator[bytes]:
    yield decompressor.decompress(block, _BLOCK)
    while not decompressor.needs_input and not decompressor.eof:
        yield decompressor.decompress(b'', _BLOCK)


def _limited(data: bytes, method: str, limit: int) -> bytes:
    """Decompress all frames of data, but no more than `limit` bytes."""
    if method not in _DECOMPRESSORS:
        raise DamageError(f'compression {method[:20]!r} is unknown')
    pieces: list[bytes] = []
    room = limit
    try:
        while data and room > 0:
            decompressor = _DECOMPRESSORS[method]()
            pieces.append(decompressor.decompress(data, room))
            room -= len(pieces[-1])
            data = (decompressor.unused_data or b'') if decompressor.eof else b''
    except Exception as error:  # each library has its own
        raise DamageError(f'compressed data are damaged ({error})') from error
    return pieces[0] if len(pieces) == 1 else b''.join(pieces)
