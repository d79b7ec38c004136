"""Messages by joint name: their order, the points of trajectories, and why one is refused."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
import os
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.errors import ConfigError, LipIdError, ModelError


class Refusal(StrEnum):
    """Why a message is refused: the key that it is counted under."""

    INACTIVE = 'inactive'
    DISABLED = 'disabled'
    ENDING = 'node is ending'
    NO_POINTS = 'no points'
    TOO_LONG = 'plan too long'
    BEYOND_LIMITS = 'torques beyond limits'
    WRONG_PLAN = 'plan that no controller takes'
    ENDED_PLAN = 'plan that is over'
    NO_CONTROLLER = 'no controller'
    WRONG_SPEED = 'wrong speed scaling'
    MALFORMED = 'malformed'
    TOO_MANY_NAMES = 'too many joint names'
    REPEATED_NAME = 'joint name repeated'
    MISSING_JOINT = 'joint missing'
    FOREIGN_JOINT = 'foreign joint in a plan'
    FOREIGN_JOINTS = 'only foreign joints'
    WRONG_LENGTH = 'wrong length'
    NO_POSITION = 'position missing'
    NO_VELOCITY = 'velocity missing'
    NO_EFFORT = 'effort missing'
    NOT_INCREASING = 'times not increasing'
    NOT_FINITE = 'value not finite'
    NOT_FINITE_TORQUE = 'torque not finite'
    TOO_LARGE = 'value too large'
    NO_STAMP = 'stamp missing'
    REPEATED_STAMP = 'stamp repeated'
    BACKWARD_STAMP = 'stamp went back'
    FAR_STAMP = 'stamp far ahead'
    OLD = 'reference too old'
    SUPERSEDED = 'overtaken by a newer one'
    SEVERAL_PUBLISHERS = 'several publishers'
    NO_UPDATE = 'no update'
    NOT_FINITE_UPDATE = 'update not finite'
    OTHER_MODEL = 'update of another model'
    OTHER_SOURCE = 'update of another node'
    NOT_NEWER_UPDATE = 'update not newer'
    OLD_UPDATE = 'update too old'
    IMPOSSIBLE_ARM = 'arm that cannot exist'
    BEYOND_TRUST = 'change too large'
    FAILED = 'failed'


HARMLESS = frozenset({Refusal.INACTIVE, Refusal.DISABLED, Refusal.FOREIGN_JOINTS})
"""
Counted, but nothing to warn of: somebody wanted it so, or another robot uses the same topic. A
node that gets nothing else warns all the same.
"""

_SENTENCES = {
    Refusal.INACTIVE: 'the node is not active; activate it through its lifecycle',
    Refusal.DISABLED: 'the node is disabled; call its service enable',
    Refusal.ENDING: 'the node is ending; start it again',
    Refusal.NO_POINTS: 'a trajectory needs at least one point, this one has none',
    Refusal.TOO_LONG: (
        'a plan must not have more points than max_plan_points, those included that refine_plans '
        'adds; send it in pieces'
    ),
    Refusal.BEYOND_LIMITS: (
        'the torques of the plan would exceed torque_limits, and overload_policy refuses that or '
        'found no slower plan that fits; look at it with lip_id check-plan'
    ),
    Refusal.WRONG_PLAN: (
        'every point of a plan needs a position of each joint, and velocities where it has '
        'accelerations; correct the points'
    ),
    Refusal.ENDED_PLAN: (
        'the plan would have ended by its stamp; send plans earlier, leave their stamps zero, or '
        'synchronise the clocks'
    ),
    Refusal.NO_CONTROLLER: (
        'no controller offers the action; activate it, or correct the parameter controller_action'
    ),
    Refusal.WRONG_SPEED: (
        'speed_scaling_factor must be a number from 0 to 10; look at the controller'
    ),
    Refusal.MALFORMED: 'the message could not be deserialised; check the type of its publisher',
    Refusal.TOO_MANY_NAMES: 'a trajectory must not name over 1000 joints; check its publisher',
    Refusal.REPEATED_NAME: 'joint names must be unique, one comes twice',
    Refusal.MISSING_JOINT: (
        'the message must name every joint of the model, one is missing; joint_names of the '
        'status has them'
    ),
    Refusal.FOREIGN_JOINT: 'a plan gets an effort for each of its joints, one is not in the model',
    Refusal.FOREIGN_JOINTS: (
        'the joint state has no joint of the model; correct the topic unless another publisher '
        'has them'
    ),
    Refusal.WRONG_LENGTH: (
        'every array must be as long as the joint names, and every point of a trajectory needs '
        'positions, velocities and accelerations, or torques of friction and inertia would be '
        'missing; time the plan where it is made'
    ),
    Refusal.NO_POSITION: 'the joint state has no positions; use a driver that publishes them',
    Refusal.NO_VELOCITY: 'the joint state has no velocities; use a driver that publishes them',
    Refusal.NO_EFFORT: 'the joint state has no effort; use a driver that publishes it',
    Refusal.NOT_INCREASING: (
        'the times of a plan must begin at 0 or later and increase from point to point'
    ),
    Refusal.NOT_FINITE: 'positions, velocities, accelerations and efforts must be finite',
    Refusal.NOT_FINITE_TORQUE: (
        'the torque would not be finite, the motion is far from what the model was trained on'
    ),
    Refusal.TOO_LARGE: 'a value is larger than that of any arm; check its unit and publisher',
    Refusal.NO_STAMP: 'the stamp is zero; use a driver that stamps its joint states',
    Refusal.REPEATED_STAMP: 'the stamp is that of the last joint state; check the driver',
    Refusal.BACKWARD_STAMP: (
        'the stamp lies before that of the last message; check for two publishers and clocks'
    ),
    Refusal.FAR_STAMP: (
        'the stamp lies far ahead of the last joint state; check for two publishers, clocks and '
        'pauses'
    ),
    Refusal.OLD: (
        'the reference was stamped or sent more than stale_timeout_s ago; check for pauses and '
        'load, synchronise the clocks, or leave its stamp zero'
    ),
    Refusal.SUPERSEDED: (
        'references came faster than they are answered, only the newest is; send fewer a second'
    ),
    Refusal.SEVERAL_PUBLISHERS: (
        'references or joint states come from several publishers; end all but one, or set '
        'several_publishers'
    ),
    Refusal.NO_UPDATE: (
        'the message is no update of the model of an arm; check its publisher, and that both '
        'nodes are of one version'
    ),
    Refusal.NOT_FINITE_UPDATE: 'the numbers of an update must be finite; restart its publisher',
    Refusal.OTHER_MODEL: (
        'the update is of another model; give the same model_path to both nodes, and restart or '
        'reload the one whose model is older'
    ),
    Refusal.OTHER_SOURCE: (
        'updates must come from one node, another one is followed; end one of them, or remap its '
        'topic'
    ),
    Refusal.NOT_NEWER_UPDATE: (
        'the stamp of the update lies before that of the last one; check the clock of its '
        'publisher, or wait until adaptation_timeout_s has passed'
    ),
    Refusal.OLD_UPDATE: (
        'the stamp of an update must be within adaptation_timeout_s of now, or what it says of '
        'payloads may be over; start adapt, or set the clocks of the computers'
    ),
    Refusal.IMPOSSIBLE_ARM: 'no bodies can have the links of the update; restart its publisher',
    Refusal.BEYOND_TRUST: (
        'the update changes torques by more than adaptation_limit, or friction by more than is '
        'followed; look at the arm, or fit a new model'
    ),
    Refusal.FAILED: 'the message led to an error of this node; see its log',
}


class RefusedError(LipIdError):
    """A message that is not used. `reason`: the message is its sentence."""

    def __init__(self, reason: Refusal) -> None:
        super().__init__(f'{_SENTENCES[reason]}.')
        self.reason = reason


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


class JointOrder:
    """
    Where the joints of a model, base to tip, are in a message.

    The order of names may change with every message; the last one is remembered, so that a steady
    stream costs one comparison.
    """

    def __init__(self, joint_names: Sequence[str]) -> None:
        self.joint_names = tuple(joint_names)
        self._last_names = self.joint_names
        self._last_columns = self._look_up(self.joint_names)

    def columns(self, names: Sequence[str]) -> IndexArray:
        """
        Return columns (n,) such that ``names[columns[i]]`` is the model's joint i.

        RefusedError if a joint is missing or named twice.
        """
        key = tuple(names)
        if key != self._last_names:
            self._last_columns = self._look_up(key)
            self._last_names = key
        return self._last_columns

    def states(self, names: Sequence[str], points: Sequence[Point]) -> Array:
        """
        Return positions, velocities and accelerations of points of named joints, (3, points, n).

        RefusedError if a joint is missing or named twice, there is no point, or an array is
        absent, short, long or not finite, be it of a joint that the model does not know.
        """
        columns = self.columns(names)
        if not points:
            raise RefusedError(Refusal.NO_POINTS)
        rows = [(point.positions, point.velocities, point.accelerations) for point in points]
        if any(len(values) != len(names) for row in rows for values in row):
            raise RefusedError(Refusal.WRONG_LENGTH)
        stacked = np.empty((3, len(rows), len(names)))
        for index, row in enumerate(rows):
            for kind, values in enumerate(row):
                stacked[kind, index] = values
        if not np.isfinite(stacked).all():
            raise RefusedError(Refusal.NOT_FINITE)
        return stacked.take(columns, axis=2)

    def _look_up(self, names: tuple[str, ...]) -> IndexArray:
        place = {name: column for column, name in enumerate(names)}
        if len(place) != len(names):
            raise RefusedError(Refusal.REPEATED_NAME)
        if not all(name in place for name in self.joint_names):
            raise RefusedError(Refusal.MISSING_JOINT)
        return np.array([place[name] for name in self.joint_names], dtype=np.intp)


def require_unique(setting: str, names: Sequence[str]) -> None:
    """
    Refuse a setting that names a joint twice: of values per joint the last would silently hold.

    ConfigError if a joint comes twice.
    """
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f'{setting} must name each joint once, but {name!r} comes twice.')


def by_joint(
    name: str,
    values: Sequence[float],
    named: Sequence[str],
    joint_names: Sequence[str],
    default: float,
) -> Array:
    """
    Return the values of a setting in the order of the model's joints, shape (n,).

    One per named joint (the model's by default), one for all, or none for the default; else
    ConfigError.
    """
    if len(values) <= 1:
        return np.full(len(joint_names), values[0] if values else default)
    names = tuple(named) or tuple(joint_names)
    if len(values) != len(names):
        raise ConfigError(
            f'{name} must hold one value per joint ({len(names)}), one for all or none, '
            f'but holds {len(values)}: give them in the order of {", ".join(names)}.'
        )
    value_of = dict(zip(names, values, strict=True))
    return np.array([value_of[joint] for joint in joint_names])


def require_joints(
    found: Sequence[str], expected: Sequence[str], path: str | os.PathLike[str]
) -> None:
    """
    Refuse a model file of another robot: of other joints than expected, in any order, if any are.

    ModelError if the joints differ.
    """
    if expected and set(found) != set(expected):
        raise ModelError(
            f'{os.fspath(path)} must be a model of the joints {", ".join(expected)}, but has '
            f'{", ".join(found)}; fit one for this robot or correct the parameter joints.'
        )


def increasing_times(points: Sequence[PlannedPoint]) -> Array:
    """
    Return when each point of a plan is reached [s].

    RefusedError if they do not increase from 0 or later.
    """
    after = [point.time_from_start for point in points]
    t = np.array([each.sec + 1e-9 * each.nanosec for each in after])
    if (len(t) and t[0] < 0.0) or not (np.diff(t) > 0.0).all():
        raise RefusedError(Refusal.NOT_INCREASING)
    return t
