"""Joints by name: where a model's joints stand in a message, a list or a file, and refusals."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
import os

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.errors import ConfigError, LipIdError, ModelError


class Refusal(StrEnum):
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


ON_PURPOSE = frozenset({Refusal.INACTIVE, Refusal.DISABLED})
"""Refused because somebody wanted it so: counted, but nothing to warn of."""

_SENTENCES = {
    Refusal.INACTIVE: 'the node is not active; activate it through its lifecycle',
    Refusal.DISABLED: 'the node is disabled; call its service enable',
    Refusal.NO_POINTS: 'a trajectory needs at least one point, this one has none',
    Refusal.REPEATED_NAME: 'joint_names must be unique, one is named twice',
    Refusal.MISSING_JOINT: 'joint_names must hold every joint of the model, one is missing',
    Refusal.FOREIGN_JOINT: 'a plan gets an effort for each of its joints, one is not in the model',
    Refusal.WRONG_LENGTH: (
        'every point needs positions, velocities and accelerations, each as long as joint_names'
    ),
    Refusal.NOT_INCREASING: 'the times of a plan must increase from point to point',
    Refusal.NOT_FINITE: 'positions, velocities and accelerations must be finite',
    Refusal.NOT_FINITE_TORQUE: (
        'the model gave a torque that is not finite, the reference is far from its training data'
    ),
}


class RefusedError(LipIdError):
    """
    A reference that cannot be answered.

    Attributes
    ----------
    reason : Refusal
        The message is its sentence.

    """

    def __init__(self, reason: Refusal) -> None:
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
            raise RefusedError(Refusal.REPEATED_NAME)
        if not all(name in place for name in self.joint_names):
            raise RefusedError(Refusal.MISSING_JOINT)
        return np.array([place[name] for name in self.joint_names], dtype=np.intp)


def by_joint(
    name: str,
    values: Sequence[float],
    named: Sequence[str],
    joint_names: Sequence[str],
    default: float,
) -> Array:
    """
    Bring a setting into the order of the model's joints.

    Parameters
    ----------
    name : str
        Of the setting, for the sentence.
    values : sequence of float
        One per joint, one for all joints, or none: the default.
    named : sequence of str
        The joints that they are given for; empty: the model's.
    joint_names : sequence of str
        The model's joints.
    default : float
        Where there is none.

    Returns
    -------
    ndarray, shape (n,)
        One per joint of the model.

    Raises
    ------
    ConfigError
        If their number is not that of the joints.

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
    Refuse a model of another robot.

    Parameters
    ----------
    found : sequence of str
        Joints of the model.
    expected : sequence of str
        Joints that it must have, in any order; empty for any.
    path : path
        The model's file, for the sentence.

    Raises
    ------
    ModelError
        If the joints differ.

    """
    if expected and set(found) != set(expected):
        raise ModelError(
            f'{os.fspath(path)} must be a model of the joints {", ".join(expected)}, but has '
            f'{", ".join(found)}; fit one for this robot or correct the parameter joints.'
        )
