"""
Which messages carry joint samples, and where in them.

One function per message type; a new type is one more line in the table.

"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

JOINT_STATE = 'sensor_msgs/msg/JointState'


class JointMessage(NamedTuple):
    """What a message says about joints; velocity and effort may be empty."""

    stamp_ns: int
    names: Sequence[str]
    position: Sequence[float]
    velocity: Sequence[float]
    effort: Sequence[float]


def from_joint_state(message: Any) -> JointMessage:
    """Take the fields of a sensor_msgs/JointState."""
    stamp = message.header.stamp
    return JointMessage(
        stamp.sec * 1_000_000_000 + stamp.nanosec,
        message.name,
        message.position,
        message.velocity,
        message.effort,
    )


EXTRACTORS: Mapping[str, Callable[[Any], JointMessage]] = {JOINT_STATE: from_joint_state}
