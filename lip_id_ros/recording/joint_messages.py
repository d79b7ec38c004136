"""
Joint messages: the types that carry them, and many serialised ones cut into arrays at once.

Messages of one publisher differ in nothing but stamp and numbers. So the first of a block is
decoded by the library, and those that agree with it in every other byte are cut into arrays at
once. For another message type, add a function and its row in `EXTRACTORS`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

from lip_id_ros.arrays import Array, IndexArray, IntArray
from lip_id_ros.recording.joint_samples import length_reason, name_reason, Reason, stacked

JOINT_STATE = 'sensor_msgs/msg/JointState'
CONTROLLER_STATE = 'control_msgs/msg/JointTrajectoryControllerState'


class JointMessage(NamedTuple):
    """The joint samples of one message; velocity and effort may be empty."""

    stamp_ns: int
    names: Sequence[str]
    position: Sequence[float]
    velocity: Sequence[float]
    effort: Sequence[float]


def from_joint_state(message: Any) -> JointMessage:
    """Take the fields of a sensor_msgs/JointState."""
    signals = message.position, message.velocity, message.effort
    return JointMessage(_stamp_ns(message), message.name, *signals)


def from_controller_state(message: Any) -> JointMessage:
    """
    Take the measured state of a control_msgs/JointTrajectoryControllerState.

    `feedback` is `actual` in older versions; where it has no effort, the `output` of the
    controller is taken, its command.
    """
    measured = message.feedback if hasattr(message, 'feedback') else message.actual
    output = getattr(message, 'output', None)
    effort = measured.effort if output is None or len(measured.effort) else output.effort
    return JointMessage(
        _stamp_ns(message), message.joint_names, measured.positions, measured.velocities, effort
    )


def _stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


EXTRACTORS: Mapping[str, Callable[[Any], JointMessage]] = {
    JOINT_STATE: from_joint_state,
    CONTROLLER_STATE: from_controller_state,
}


def _fields(kind: str, *names: str) -> list[str]:
    return [f'{kind} {name}' for name in names]


_POINT = 'trajectory_msgs/JointTrajectoryPoint'
_BEGIN = ['std_msgs/Header header', 'string[] joint_names']
_OLD = [*_BEGIN, *_fields(_POINT, 'desired', 'actual', 'error')]
_NEW = [
    *_BEGIN,
    *_fields(_POINT, 'reference', 'feedback', 'error', 'output'),
    'string[] multi_dof_joint_names',
    *_fields(
        'trajectory_msgs/MultiDOFJointTrajectoryPoint',
        'multi_dof_reference',
        'multi_dof_feedback',
        'multi_dof_error',
        'multi_dof_output',
    ),
]
_NEWEST = [*_NEW, 'float64 speed_scaling_factor']

KNOWN_DEFINITIONS: Mapping[str, tuple[str, ...]] = {
    CONTROLLER_STATE: tuple('\n'.join(lines) for lines in (_NEWEST, _NEW, _OLD)),
}
"""
Of types that bags may leave out and the library does not know.

rosbag2 wrote no definitions into sqlite3 files up to Humble. Newest first; a message fits one of
them only, since its length must agree.
"""

Decode = Callable[[bytes], Any]
"""Returns a message with the fields of its type, None where it is broken."""

_MOST_DECODERS = 64

HEADER, RECEIVE, PUBLISHER = range(3)
"""Columns of `MessageBlock.numbers`."""
CLOCKS = {'header': HEADER, 'receive': RECEIVE}

Publisher = tuple[frozenset[str], str]
"""Joints and frame of its messages."""


class MessageBlock(NamedTuple):
    """
    Messages of the same joints, N messages of n joints.

    `publishers`: joints and frame of each number; one where there are too many to be publishers.
    `numbers`, shape (N, 3): stamp of the header and time of reception [ns], and number of the
    publisher: messages with other joints beside these, or another frame, are of another publisher.
    `values`, shape (N, 3, n): position, velocity and effort; NaN where a message has none,
    infinity where it has no finite number. All messages have positions, or none has.
    """

    joints: tuple[str, ...]
    publishers: tuple[Publisher, ...]
    numbers: IntArray
    values: Array

    @property
    def has_position(self) -> bool:
        """Whether its messages have positions; else they are efforts alone."""
        return not np.isnan(self.values[:1, 0]).any()


_Alike = tuple[IndexArray, tuple[str, ...], str, IntArray, Sequence[Array]]
"""Messages of the same joints: their rows, joints, frame, stamps [ns], and arrays (k, length)."""


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

    `definition` is the one of the file; the known one of a standard type is trusted more. Raises
    whatever a definition makes the library raise.
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
    messages: Sequence[bytes],
    receive_ns: IntArray,
    kind: str,
    is_ros1: bool,
    decode: Decode,
    counts: Counter[str],
) -> list[tuple[IndexArray, MessageBlock]]:
    """
    Sort serialised joint messages of one type, received at some times [ns], into blocks.

    Each block comes with the increasing numbers of its messages; broken messages are only counted.
    """
    if kind == JOINT_STATE:
        alike = _cut(messages, is_ros1, decode)
    else:
        alike = _extracted(messages, EXTRACTORS[kind], decode)
    blocks, n_read = [], 0
    for rows, names, frame_id, stamps_ns, signals in alike:
        n_read += rows.size
        reason = name_reason(names) or _misfit(len(names), *(each.shape[1] for each in signals))
        if reason is not None:
            counts[reason] += rows.size
            continue
        numbers = np.stack([stamps_ns, receive_ns[rows], np.zeros(rows.size, np.int64)], axis=1)
        publishers = ((frozenset(names), frame_id),)
        blocks.append((rows, MessageBlock(names, publishers, numbers, stacked(*signals))))
    counts[Reason.UNREADABLE] += len(messages) - n_read
    return blocks


def _misfit(names: int, position: int, velocity: int, effort: int) -> Reason | None:
    is_effort = position == 0 and effort == names
    return length_reason(names, names if is_effort else position, velocity, effort)


def _cut(messages: Sequence[bytes], is_ros1: bool, decode: Decode) -> Iterator[_Alike]:
    """Cut messages of JointState into arrays, those of one length and layout at once."""
    by_length: dict[int, list[int]] = {}
    for row, data in enumerate(messages):
        by_length.setdefault(len(data), []).append(row)
    for length, some in by_length.items():
        joined = np.frombuffer(b''.join([messages[row] for row in some]), np.uint8)
        matrix, rows = joined.reshape(len(some), length), np.array(some)
        while rows.size:
            data = matrix[0].tobytes()
            message = decode(data)
            if message is None:
                matrix, rows = matrix[1:], rows[1:]
                continue
            layout = _layout(data, message, is_ros1)
            constant = matrix[:, layout.constant]
            same = (constant == constant[0]).all(axis=1)
            yield rows[same], layout.names, layout.frame_id, *_numbers(matrix[same], layout)
            matrix, rows = matrix[~same], rows[~same]


def _layout(data: bytes, message: Any, is_ros1: bool) -> _Layout:
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


def _numbers(matrix: NDArray[np.uint8], layout: _Layout) -> tuple[IntArray, list[Array]]:
    """Return stamps [ns], positions, velocities and efforts of messages of one layout."""

    def cut(position: int, count: int, kind: str) -> NDArray[Any]:
        some = np.ascontiguousarray(
            matrix[:, position : position + np.dtype(kind).itemsize * count]
        )
        return some.view(f'{layout.order}{kind}').reshape(len(matrix), count)

    seconds = cut(layout.stamp, 1, 'i4')[:, 0].astype(np.int64)
    nanoseconds = cut(layout.stamp + 4, 1, 'u4')[:, 0].astype(np.int64)
    signals = [cut(*place, 'f8').astype(np.float64, copy=False) for place in layout.numbers]
    return seconds * 1_000_000_000 + nanoseconds, signals


def _extracted(
    messages: Sequence[bytes], extract: Callable[[Any], JointMessage], decode: Decode
) -> Iterator[_Alike]:
    """Decode messages one by one; yield those of the same joints and lengths together."""
    groups: dict[tuple[Any, ...], list[tuple[int, int, list[Array]]]] = {}
    for row, data in enumerate(messages):
        try:
            message = decode(data)
            found, frame_id = extract(message), str(message.header.frame_id)
            arrays = [np.asarray(values, np.float64) for values in found[2:]]
        except (AttributeError, TypeError, ValueError):  # a bag may define a type in its own way
            continue
        is_named = all(isinstance(name, str) for name in found.names)
        if is_named and all(each.ndim == 1 for each in arrays):
            key = (frame_id, tuple(found.names), *map(len, arrays))
            groups.setdefault(key, []).append((row, found.stamp_ns, arrays))
    for (frame_id, names, *_), group in groups.items():
        rows, stamps_ns, some = zip(*group, strict=True)
        signals = [np.stack(each) for each in zip(*some, strict=True)]
        yield np.array(rows), names, frame_id, np.array(stamps_ns, np.int64), signals
