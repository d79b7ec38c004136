"""Decompression that never makes more than it is allowed to, whatever the data claim."""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator
import sys
from typing import Any, BinaryIO

import lz4.frame

from lip_id_ros.recording.storage.contents import DamageError

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


def unpacked_chunk(data: bytes, method: str, size: int, *, is_cut: bool) -> bytes:
    """
    Decompress a chunk of known size; of one that is cut short, as much as there is.

    Raises
    ------
    DamageError
        If it is damaged, or claims to be larger than `LARGEST_CHUNK`.

    """
    if method in ('', 'none'):
        return data
    if size > LARGEST_CHUNK:
        raise DamageError(f'a chunk claims {size} bytes')
    unpacked = _limited(data, method, size)
    if len(unpacked) != size and not is_cut:
        raise DamageError(f'a chunk has {len(unpacked)} bytes instead of {size}')
    return unpacked


def plain_message(data: bytes) -> bytes:
    """
    Return a serialized ROS 2 message, decompressed where it was compressed by itself.

    Raises
    ------
    DamageError
        If it is damaged, or larger than `LARGEST_MESSAGE`.

    """
    method = _MAGIC.get(data[:4])  # no serialized message begins like that
    return data if method is None else _limited(data, method, LARGEST_MESSAGE)


def unpack_file(source: BinaryIO, target: BinaryIO, method: str) -> str:
    """Decompress a file block by block, as far as it goes; say what stopped it, if anything."""
    decompressor = _DECOMPRESSORS[method]()
    try:
        for block in iter(lambda: source.read(_BLOCK), b''):
            for piece in _pieces(decompressor, block):
                target.write(piece)
            if decompressor.eof:
                return ''
    except OSError:
        raise
    except Exception as error:
        return f'its compression is damaged ({error})'
    return 'it was cut short'


def _pieces(decompressor: Any, block: bytes) -> Iterator[bytes]:
    yield decompressor.decompress(block, _BLOCK)
    while not decompressor.needs_input and not decompressor.eof:
        yield decompressor.decompress(b'', _BLOCK)


def _limited(data: bytes, method: str, limit: int) -> bytes:
    if method not in _DECOMPRESSORS:
        raise DamageError(f'compression {method[:20]!r} is unknown')
    try:
        unpacked: bytes = _DECOMPRESSORS[method]().decompress(data, limit)
    except Exception as error:  # each library has its own
        raise DamageError(f'compressed data are damaged ({error})') from error
    return unpacked
