"""Many messages cut into arrays at once are what the library decodes one by one."""

from __future__ import annotations

from collections import Counter
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from recording.bag_files import JOINT_STATE, ROS1, ROS2

from lip_id_ros.arrays import Array
from lip_id_ros.recording import Reason
from lip_id_ros.recording.joint_messages import HEADER, message_blocks, PUBLISHER, RECEIVE
from lip_id_ros.recording.joint_samples import length_reason, name_reason, SIGNALS

Numbers = st.lists(st.floats(), max_size=4)
Names = st.lists(st.sampled_from(['a', 'elbow', 'wrist_3_joint', 'ä', '']), max_size=4)


@st.composite
def forms(draw: st.DrawFn) -> tuple[str, list[str], list[float], list[float], list[float]]:
    """Return frame, joints and numbers of a message, mostly as many as joints."""
    names = draw(Names)
    whole = st.lists(st.floats(), min_size=len(names), max_size=len(names))
    position, velocity, effort = (draw(whole | whole | Numbers) for _ in SIGNALS)
    return draw(st.sampled_from(['', 'base'])), names, position, velocity, effort


@st.composite
def messages(draw: st.DrawFn) -> list[tuple[int, int, str, list[str], Any, Any, Any]]:
    """Return the fields of messages, many of them of the same form."""
    some = draw(st.lists(forms(), min_size=1, max_size=3))
    seconds, nanoseconds = st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)
    stamps = draw(st.lists(st.tuples(seconds, nanoseconds, st.sampled_from(some)), max_size=12))
    return [(sec, nanosec, *form) for sec, nanosec, form in stamps]


def serialized(fields: Any, encoding: str) -> bytes:
    sec, nanosec, frame, names, *numbers = fields
    store = ROS1 if encoding == 'ros1' else ROS2
    types = store.types
    stamp = types['builtin_interfaces/msg/Time'](sec=sec, nanosec=nanosec)
    extra = {'seq': abs(sec)} if encoding == 'ros1' else {}
    position, velocity, effort = (np.array(values, float) for values in numbers)
    message = types[JOINT_STATE](
        header=types['std_msgs/msg/Header'](stamp=stamp, frame_id=frame, **extra),
        name=names,
        position=position,
        velocity=velocity,
        effort=effort,
    )
    if encoding == 'ros1':
        return bytes(ROS1.serialize_ros1(message, JOINT_STATE))
    little = encoding == 'little'
    return bytes(ROS2.serialize_cdr(message, JOINT_STATE, little_endian=little))


def decoded(data: bytes, is_ros1: bool) -> Any:
    try:
        if is_ros1:
            return ROS1.deserialize_ros1(data, JOINT_STATE)
        return ROS2.deserialize_cdr(data, JOINT_STATE)
    except Exception:
        return None


def reason_of(message: Any) -> Reason | None:
    if message is None:
        return Reason.UNREADABLE
    n = len(message.name)
    position, velocity, effort = (len(getattr(message, part)) for part in SIGNALS)
    if position == 0 and effort == n:  # efforts may come alone
        position = n
    return name_reason(message.name) or length_reason(n, position, velocity, effort)


def expected(values: Array, n_joints: int) -> Array:
    if not len(values):
        return np.full(n_joints, np.nan)
    return np.where(np.isnan(values), np.inf, np.asarray(values, '<f8'))


def check(data: list[bytes], is_ros1: bool) -> None:
    one_by_one = [decoded(each, is_ros1) for each in data]
    receive_ns = 7 + np.arange(len(data))
    counts: Counter[str] = Counter()
    found = message_blocks(
        data, receive_ns, JOINT_STATE, is_ros1, lambda each: decoded(each, is_ros1), counts
    )
    reasons = [reason_of(message) for message in one_by_one]
    assert +counts == Counter(reason for reason in reasons if reason is not None)
    rows = [row for some, _ in found for row in some.tolist()]
    assert sorted(rows) == [k for k, reason in enumerate(reasons) if reason is None]
    for some, block in found:
        assert (np.diff(some) > 0).all()
        for row, numbers, values in zip(some, block.numbers, block.values, strict=True):
            message = one_by_one[row]
            stamp = message.header.stamp
            assert block.joints == tuple(message.name)
            assert block.publishers == ((frozenset(message.name), message.header.frame_id),)
            assert numbers[HEADER] == stamp.sec * 10**9 + stamp.nanosec
            assert (numbers[RECEIVE], numbers[PUBLISHER]) == (receive_ns[row], 0)
            for ours, part in zip(values, SIGNALS, strict=True):
                theirs = expected(getattr(message, part), len(block.joints))
                assert ours.tobytes() == theirs.tobytes()


@given(messages(), st.sampled_from(['little', 'big', 'ros1']))
def test_every_message_is_what_the_library_decodes(sent: list[Any], encoding: str) -> None:
    check([serialized(fields, encoding) for fields in sent], encoding == 'ros1')


@given(messages(), st.sampled_from(['little', 'big', 'ros1']), st.data())
def test_broken_messages_are_those_that_the_library_refuses(
    sent: list[Any], encoding: str, draws: st.DataObject
) -> None:
    data = [bytearray(serialized(fields, encoding)) for fields in sent]
    for each in data:
        if draws.draw(st.booleans()):
            place = draws.draw(st.integers(0, len(each) - 1))
            each[place] = draws.draw(st.integers(0, 255))
        if draws.draw(st.integers(0, 4)) == 0:
            del each[draws.draw(st.integers(0, len(each))) :]
    check([bytes(each) for each in data], encoding == 'ros1')
