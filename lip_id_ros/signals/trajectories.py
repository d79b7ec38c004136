"""Points of trajectories: stacked and checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.signals.joints import Refusal, RefusedError


class Duration(Protocol):
    """The fields of a builtin_interfaces/Duration."""

    @property
    def sec(self) -> int:
        """Seconds."""

    @property
    def nanosec(self) -> int:
        """Nanoseconds beside them."""


class Point(Protocol):
    """The fields of a trajectory_msgs/JointTrajectoryPoint that are read."""

    @property
    def positions(self) -> Sequence[float]:
        """Positions [rad or m]."""

    @property
    def velocities(self) -> Sequence[float]:
        """Velocities [rad/s or m/s]."""

    @property
    def accelerations(self) -> Sequence[float]:
        """Accelerations [rad/s^2 or m/s^2]."""


class PlannedPoint(Point, Protocol):
    """A point of a plan."""

    @property
    def time_from_start(self) -> Duration:
        """When it is reached."""


def stack(points: Sequence[Point], n_names: int) -> Array:
    """
    Stack the points of a trajectory, in the message's own order of joints.

    Parameters
    ----------
    points : sequence of Point
        Points of one message.
    n_names : int
        Length of the message's joint_names.

    Returns
    -------
    ndarray, shape (3, number of points, n_names)
        Positions [rad or m], velocities, accelerations.

    Raises
    ------
    RefusedError
        If there is no point, or an array is absent, short, long or not finite.

    """
    if not points:
        raise RefusedError(Refusal.NO_POINTS)
    rows = [(point.positions, point.velocities, point.accelerations) for point in points]
    if any(len(values) != n_names for row in rows for values in row):
        raise RefusedError(Refusal.WRONG_LENGTH)
    stacked = np.empty((3, len(rows), n_names))
    for index, row in enumerate(rows):
        for kind, values in enumerate(row):
            stacked[kind, index] = values
    if not np.isfinite(stacked).all():
        raise RefusedError(Refusal.NOT_FINITE)
    return stacked


def increasing_times(points: Sequence[PlannedPoint]) -> Array:
    """
    Return when each point of a plan is reached [s].

    Raises
    ------
    RefusedError
        If they do not increase from 0 or later.

    """
    after = [point.time_from_start for point in points]
    t = np.array([each.sec + 1e-9 * each.nanosec for each in after])
    if (len(t) and t[0] < 0.0) or not (np.diff(t) > 0.0).all():
        raise RefusedError(Refusal.NOT_INCREASING)
    return t
