"""Many messages cut into arrays at once are what the library decodes one by one."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from recording.bag_files import JOINT_STATE, ROS1, ROS2

from lip_id_ros.recording.decoding import message_blocks

Numbers = st.lists(st.floats(), max_size=4)
Names = st.lists(st.sampled_from(['a', 'elbow', 'wrist_3_joint', 'ä', '']), max_size=4)


@st.composite
def messages(draw: st.DrawFn) -> list[tuple[int, int, str, list[str], Any, Any, Any]]:
    """Return the fields of messages, many of them of the same form."""
    forms = draw(
        st.lists(st.tuples(st.sampled_from(['', 'base']), Names, Numbers, Numbers, Numbers),
                 min_size=1, max_size=3)
    )  # fmt: skip
    seconds, nanoseconds = st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)
    stamps = draw(st.lists(st.tuples(seconds, nanoseconds, st.sampled_from(forms)), max_size=12))
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


def check(data: list[bytes], is_ros1: bool) -> None:
    """Compare every message with the library's."""
    one_by_one = [decoded(each, is_ros1) for each in data]
    found = message_blocks(data, JOINT_STATE, is_ros1, lambda each: decoded(each, is_ros1))
    rows = [row for block in found for row in block.rows.tolist()]
    assert sorted(rows) == [k for k, message in enumerate(one_by_one) if message is not None]
    for block in found:
        assert (np.diff(block.rows) > 0).all()
        for number, row in enumerate(block.rows):
            message = one_by_one[row]
            stamp = message.header.stamp
            assert block.names == tuple(message.name)
            assert block.frame_id == message.header.frame_id
            assert block.stamp_ns[number] == stamp.sec * 10**9 + stamp.nanosec
            for part in ('position', 'velocity', 'effort'):
                ours, theirs = getattr(block, part)[number], getattr(message, part)
                assert ours.tobytes() == np.asarray(theirs, '<f8').tobytes()


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
