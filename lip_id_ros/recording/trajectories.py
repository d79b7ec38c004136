"""Planned trajectories from bags."""

from __future__ import annotations

from dataclasses import dataclass
import os
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import SourceError
from lip_id_ros.recording.bags import Bag, Topic

JOINT_TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'


@dataclass(frozen=True, eq=False)
class Trajectory:
    """
    A planned motion of N points and n joints.

    Attributes
    ----------
    t : ndarray, shape (N,)
        Time from start [s].
    q, dq, ddq, tau : ndarray, shape (N, n)
        Positions, velocities, accelerations, efforts; NaN where a point has none.
    joint_names : tuple of str
        Names of the n columns.

    """

    t: Array
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    joint_names: tuple[str, ...]


def read_trajectory(path: str | os.PathLike[str], topic: str = '') -> Trajectory:
    """
    Read the first JointTrajectory of a bag.

    Parameters
    ----------
    path : path
        A rosbag2 folder, .mcap, .db3 or ROS 1 .bag.
    topic : str
        Empty for the only topic of that type.

    Raises
    ------
    SourceError
        If the bag cannot be read, or has no such topic or no readable message on it.
    OSError
        If it does not exist or cannot be opened.

    """
    with Bag(path) as bag:
        chosen = _choose(bag, topic)
        for _, message in bag.messages(chosen.name):
            if message is not None and len(message.points) > 0:
                return _trajectory(message, f'{chosen.name} in {bag.path}')
    raise SourceError(
        f'{chosen.name} in {bag.path} must hold a trajectory with points, but holds none; '
        'record the plan again.'
    )


def _choose(bag: Bag, wanted: str) -> Topic:
    topics = [topic for topic in bag.topics if topic.type == JOINT_TRAJECTORY]
    names = ', '.join(topic.name for topic in topics) or 'none'
    chosen = [topic for topic in topics if wanted in ('', topic.name)]
    if len(chosen) != 1:
        raise SourceError(
            f'{wanted or "one topic"} of {JOINT_TRAJECTORY} must be in {bag.path}, which has '
            f'{names}; name one that it has.'
        )
    return chosen[0]


def _trajectory(message: Any, where: str) -> Trajectory:
    names = tuple(message.joint_names)
    times = [point.time_from_start for point in message.points]
    fields = ('positions', 'velocities', 'accelerations', 'effort')
    q, dq, ddq, tau = (_column(message.points, field, len(names), where) for field in fields)
    return Trajectory(
        t=np.array([time.sec + 1e-9 * time.nanosec for time in times]),
        q=q,
        dq=dq,
        ddq=ddq,
        tau=tau,
        joint_names=names,
    )


def _column(points: Any, field: str, n_joints: int, where: str) -> Array:
    values = np.full((len(points), n_joints), np.nan)
    for row, point in zip(values, points, strict=True):
        given = getattr(point, field)
        if len(given) not in (0, n_joints):
            raise SourceError(
                f'{field} of a point on {where} must have {n_joints} values, not {len(given)}; '
                'record the plan again.'
            )
        if len(given):
            row[:] = given
    return values
