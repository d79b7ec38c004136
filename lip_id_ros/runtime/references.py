"""Reference trajectories: mapped by joint name, checked, and refused with a reason."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.errors import LipIdError


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


class Reason(StrEnum):
    """Why a reference is not answered: the key that it is counted under."""

    INACTIVE = 'inactive'
    DISABLED = 'disabled'
    NO_POINTS = 'no points'
    REPEATED_NAME = 'joint name repeated'
    MISSING_JOINT = 'joint missing'
    FOREIGN_JOINT = 'foreign joint in a plan'
    WRONG_LENGTH = 'wrong length'
    NOT_INCREASING = 'times not increasing'
    NOT_FINITE = 'value not finite'
    NOT_FINITE_TORQUE = 'torque not finite'


ON_PURPOSE = frozenset({Reason.INACTIVE, Reason.DISABLED})
"""Refused because somebody wanted it so: counted, but nothing to warn of."""

_SENTENCES = {
    Reason.INACTIVE: 'the node is not active; activate it through its lifecycle',
    Reason.DISABLED: 'the node is disabled; call its service enable',
    Reason.NO_POINTS: 'a trajectory needs at least one point, this one has none',
    Reason.REPEATED_NAME: 'joint_names must be unique, one is named twice',
    Reason.MISSING_JOINT: 'joint_names must hold every joint of the model, one is missing',
    Reason.FOREIGN_JOINT: 'a plan gets an effort for each of its joints, one is not in the model',
    Reason.WRONG_LENGTH: (
        'every point needs positions, velocities and accelerations, each as long as joint_names'
    ),
    Reason.NOT_INCREASING: 'the times of a plan must increase from point to point',
    Reason.NOT_FINITE: 'positions, velocities and accelerations must be finite',
    Reason.NOT_FINITE_TORQUE: (
        'the model gave a torque that is not finite, the reference is far from its training data'
    ),
}


class RefusedError(LipIdError):
    """
    A reference that cannot be answered.

    Attributes
    ----------
    reason : Reason
        The message is its sentence.

    """

    def __init__(self, reason: Reason) -> None:
        super().__init__(f'{_SENTENCES[reason]}.')
        self.reason = reason


class JointOrder:
    """
    Where each joint of the model stands in a message.

    The order of names may change with every message; the last one is remembered, so that a steady
    stream costs one comparison.

    Parameters
    ----------
    joint_names : sequence of str
        The joints of the model, base to tip.

    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        self.joint_names = tuple(joint_names)
        self._last_names = self.joint_names
        self._last_columns = self._look_up(self.joint_names)

    def columns(self, names: Sequence[str]) -> IndexArray:
        """
        Find the model's joints among the names of a message.

        Parameters
        ----------
        names : sequence of str
            As the message has them.

        Returns
        -------
        ndarray, shape (n,)
            ``names[columns[i]]`` is the model's joint i.

        Raises
        ------
        RefusedError
            If a joint is missing or named twice.

        """
        key = tuple(names)
        if key != self._last_names:
            self._last_columns = self._look_up(key)
            self._last_names = key
        return self._last_columns

    def _look_up(self, names: tuple[str, ...]) -> IndexArray:
        place = {name: column for column, name in enumerate(names)}
        if len(place) != len(names):
            raise RefusedError(Reason.REPEATED_NAME)
        if not all(name in place for name in self.joint_names):
            raise RefusedError(Reason.MISSING_JOINT)
        return np.array([place[name] for name in self.joint_names], dtype=np.intp)


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
        raise RefusedError(Reason.NO_POINTS)
    rows = [(point.positions, point.velocities, point.accelerations) for point in points]
    if any(len(values) != n_names for row in rows for values in row):
        raise RefusedError(Reason.WRONG_LENGTH)
    stacked = np.empty((3, len(rows), n_names))
    for index, row in enumerate(rows):
        for kind, values in enumerate(row):
            stacked[kind, index] = values
    if not np.isfinite(stacked).all():
        raise RefusedError(Reason.NOT_FINITE)
    return stacked


def times(points: Sequence[PlannedPoint]) -> Array:
    """Return when each point of a plan is reached [s]."""
    after = [point.time_from_start for point in points]
    return np.array([each.sec + 1e-9 * each.nanosec for each in after])
