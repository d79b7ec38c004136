"""
Definitions of message types that bags may leave out and the library does not know.

rosbag2 wrote none into sqlite3 files up to Humble.

"""

from __future__ import annotations

from collections.abc import Mapping

from lip_id_ros.recording.joint_messages import CONTROLLER_STATE


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
"""Newest first; a message fits one of them only, since it must be as long as that says."""
