"""
Message types that carry joint samples, and the fields that hold them.

One function per message type; a new type is one more line in the table.

"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

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
    return JointMessage(
        _stamp_ns(message), message.name, message.position, message.velocity, message.effort
    )


def from_controller_state(message: Any) -> JointMessage:
    """
    Take the measured state of a control_msgs/JointTrajectoryControllerState.

    `feedback` (`actual` in older versions) has positions and velocities; the effort is the one
    measured there, else the `output` of the controller, its command.

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
