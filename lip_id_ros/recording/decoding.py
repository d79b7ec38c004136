"""
Deserialise messages, and decode joint messages to arrays, many at a time.

Messages of one publisher differ in nothing but stamp and numbers. So the first of a block is
decoded by the library, and those that agree with it in every other byte are cut into arrays at
once.

"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

from lip_id_ros.arrays import Array, IndexArray, IntArray
from lip_id_ros.recording.joint_messages import (
    EXTRACTORS,
    JOINT_STATE,
    JointMessage,
    KNOWN_DEFINITIONS,
)

Decode = Callable[[bytes], Any]
"""Returns a message with the fields of its type, None where it is broken."""

_MOST_DECODERS = 64


class MessageBlock(NamedTuple):
    """
    Messages of the same joints in the same order, arrays of shape (k, length of the field).

    `rows`, shape (k,), says which of the messages given they are, increasing.

    """

    rows: IndexArray
    names: tuple[str, ...]
    stamp_ns: IntArray
    position: Array
    velocity: Array
    effort: Array
    frame_id: str

    @property
    def values(self) -> tuple[Array, Array, Array]:
        """Positions, velocities and efforts."""
        return self.position, self.velocity, self.effort


class _Layout(NamedTuple):
    """Where in a JointState its parts are; `constant` are all bytes but stamp and numbers."""

    names: tuple[str, ...]
    frame_id: str
    order: str
    stamp: int
    numbers: tuple[tuple[int, int], ...]
    constant: IndexArray


def message_decoder(name: str, encoding: str, definition: str) -> Decode:
    """
    Return the function that decodes messages of a type, to None where they are broken.

    `definition` is the one of the file; the known definition of a standard type is trusted more.
    Raises whatever a definition makes the library raise.

    """
    if name in _store(encoding == 'ros1').fielddefs:
        definition = ''
    decode = _decoder(name, encoding, definition)

    def decoded(data: bytes) -> Any:
        try:
            return decode(data)
        except Exception:  # whatever a broken message makes it raise: it is counted
            return None

    return decoded


@cache
def _store(is_ros1: bool) -> Any:
    return get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_JAZZY)


@lru_cache(_MOST_DECODERS)
def _decoder(name: str, encoding: str, definition: str) -> Decode:
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


def _known_decoder(name: str) -> Decode:
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


def message_blocks(
    messages: Sequence[bytes], kind: str, is_ros1: bool, decode: Decode
) -> list[MessageBlock]:
    """Sort serialised joint messages of one type into blocks; broken ones are in none of them."""
    if kind != JOINT_STATE:
        decoded = ((row, decode(data)) for row, data in enumerate(messages))
        read = (_extracted(EXTRACTORS[kind], row, message) for row, message in decoded)
        return _grouped([one for one in read if one is not None])
    found: list[MessageBlock] = []
    by_length: dict[int, list[int]] = {}
    for row, data in enumerate(messages):
        by_length.setdefault(len(data), []).append(row)
    for length, some in by_length.items():
        joined = np.frombuffer(b''.join([messages[row] for row in some]), np.uint8)
        _split(joined.reshape(len(some), length), np.array(some), is_ros1, decode, found)
    return found


def _split(
    matrix: NDArray[np.uint8],
    rows: IndexArray,
    is_ros1: bool,
    decode: Decode,
    found: list[MessageBlock],
) -> None:
    """Take the rows that are like the first, until none is left."""
    while rows.size:
        data = matrix[0].tobytes()
        message = decode(data)
        if message is None:
            matrix, rows = matrix[1:], rows[1:]
            continue
        layout = _layout(data, message, is_ros1)
        constant = matrix[:, layout.constant]
        same = (constant == constant[0]).all(axis=1)
        found.append(_block(matrix[same], rows[same], layout))
        matrix, rows = matrix[~same], rows[~same]


def _layout(data: bytes, message: Any, is_ros1: bool) -> _Layout:
    """Walk through a message that the library could decode."""
    start, align = (0, 1) if is_ros1 else (4, 4)
    order = '<' if is_ros1 or data[1] == 1 else '>'
    byte_order = 'little' if order == '<' else 'big'
    varying = np.zeros(len(data), bool)

    def length_at(position: int) -> tuple[int, int]:
        position = start + -(-(position - start) // align) * align
        return int.from_bytes(data[position : position + 4], byte_order), position + 4  # type: ignore[arg-type]

    stamp = start + 4 if is_ros1 else start
    varying[start : stamp + 8] = True  # the sequence number of ROS 1 too
    length, position = length_at(stamp + 8)
    count, position = length_at(position + length)
    for _ in range(count):
        length, position = length_at(position)
        position += length
    numbers = []
    for values in (message.position, message.velocity, message.effort):
        padded = position
        count, position = length_at(position)
        varying[padded : position - 4] = True
        if count and not is_ros1:
            padded, position = position, start + -(-(position - start) // 8) * 8
            varying[padded:position] = True
        numbers.append((position, len(values)))
        varying[position : position + 8 * count] = True
        position += 8 * count
    varying[position:] = True
    names = tuple(message.name)
    frame = str(message.header.frame_id)
    return _Layout(names, frame, order, stamp, tuple(numbers), np.flatnonzero(~varying))


def _block(matrix: NDArray[np.uint8], rows: IndexArray, layout: _Layout) -> MessageBlock:
    def cut(position: int, count: int, kind: str) -> NDArray[Any]:
        some = np.ascontiguousarray(
            matrix[:, position : position + np.dtype(kind).itemsize * count]
        )
        return some.view(f'{layout.order}{kind}').reshape(rows.size, count)

    seconds = cut(layout.stamp, 1, 'i4')[:, 0].astype(np.int64)
    nanoseconds = cut(layout.stamp + 4, 1, 'u4')[:, 0].astype(np.int64)
    stamp_ns = seconds * 1_000_000_000 + nanoseconds
    parts = [cut(*place, 'f8').astype(np.float64, copy=False) for place in layout.numbers]
    position, velocity, effort = parts
    return MessageBlock(rows, layout.names, stamp_ns, position, velocity, effort, layout.frame_id)


def _extracted(
    extract: Callable[[Any], JointMessage], row: int, message: Any
) -> tuple[int, str, JointMessage] | None:
    """Take row, frame and joints of a message; None where it is broken, or has other fields."""
    try:
        found, frame = extract(message), str(message.header.frame_id)
        arrays = [np.asarray(values, np.float64) for values in found[2:]]
    except (AttributeError, TypeError, ValueError):  # a bag may define a type in its own way
        return None
    is_named = all(isinstance(name, str) for name in found.names)
    return (row, frame, found) if is_named and all(each.ndim == 1 for each in arrays) else None


def _grouped(read: Sequence[tuple[int, str, JointMessage]]) -> list[MessageBlock]:
    groups: dict[tuple[Any, ...], list[tuple[int, JointMessage]]] = {}
    for row, frame, message in read:
        key = (frame, tuple(message.names), *(len(values) for values in message[2:]))
        groups.setdefault(key, []).append((row, message))
    return [_stacked(frame, names, group) for (frame, names, *_), group in groups.items()]


def _stacked(
    frame: str, names: tuple[str, ...], group: Sequence[tuple[int, JointMessage]]
) -> MessageBlock:
    messages = [message for _, message in group]
    position, velocity, effort = (
        np.array([message[part] for message in messages], np.float64).reshape(len(group), -1)
        for part in (2, 3, 4)
    )
    stamps = np.array([message.stamp_ns for message in messages], np.int64)
    rows = np.array([row for row, _ in group])
    return MessageBlock(rows, names, stamps, position, velocity, effort, frame)
