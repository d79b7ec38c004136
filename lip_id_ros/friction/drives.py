"""Terms of the drives of an arm, coupled motors included (maths.md, section 12)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
import math
from typing import Any, ClassVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.friction import terms
from lip_id_ros.friction.conservative_terms import LeverSpring, Ripple, Spring
from lip_id_ros.friction.curves import PositionCurve, VelocityCurve
from lip_id_ros.friction.dahl import Dahl
from lip_id_ros.friction.primitives import Column, LOAD, Primitive, SIGN, VELOCITY
from lip_id_ros.friction.terms import DriveState, FREE, FrictionTerm, smooth_sign

WIDTH_STEP = 1e-2
"""Of the logarithm of a width, for its slope."""

LARGEST, MOST = 1e9, 1000
"""No parameter of a term in a file is larger; none that is an integer."""

INTEGERS = ('count', 'harmonic')
LOWEST = {'width': 1e-9, 'acceleration': 1e-9, 'displacement': 1e-9, 'smoothing': 0.0}
"""Least values of parameters that divide, or that cannot be negative."""


@dataclass(frozen=True)
class Drive:
    """
    A motor that turns with one joint, or with several that are coupled.

    Its speed is the sum of `ratios` times the joints' velocities; by virtual work its torque acts
    on each joint times that joint's ratio. Efforts of coupled motors that are not those of the
    joints have other shares in it.
    """

    joints: tuple[int, ...]  # from 0; the drive bears the load of the first
    ratios: tuple[float, ...]
    shares: tuple[float, ...] = ()  # in the effort of each joint; empty for `ratios`

    @classmethod
    def of_joint(cls, joint: int) -> Drive:
        """Return the drive of one joint alone."""
        return cls((joint,), (1.0,))

    @classmethod
    def transmitted(cls, joint: int, to: int) -> Drive:
        """Return the drive of one joint, as far as the effort of another one contains it."""
        return cls((joint, to), (1.0, 0.0), (0.0, 1.0))

    @property
    def efforts(self) -> tuple[tuple[int, float], ...]:
        """The joints whose efforts contain its torque, each with its share."""
        shares = zip(self.joints, self.shares or self.ratios, strict=True)
        return tuple((joint, share) for joint, share in shares if share != 0.0)

    def state(
        self,
        q: Array,
        dq: Array,
        ddq: Array,
        load: Array,
        rise_time: float,
        discrepancy: Array | float = 0.0,
        dahl: Array | None = None,
    ) -> DriveState:
        """Return the state of the drive at joint states and loads of shape (N, n)."""
        joints, ratios = list(self.joints), np.array(self.ratios)
        position, speed, acceleration = (x[:, joints] @ ratios for x in (q, dq, ddq))
        smoothing = rise_time * np.abs(acceleration)
        own = np.broadcast_to(discrepancy, dq.shape) @ self.signs(dq.shape[1])
        states = dahl[:, joints[0]] if dahl is not None and len(joints) == 1 else None
        return DriveState(
            position, speed, acceleration, load[:, joints[0]], smoothing, own, states
        )

    def signs(self, n_joints: int) -> Array:
        """Return the sign with which a joint turns the drive alone, shape (n,); else zeros."""
        signs = np.zeros(n_joints)
        signs[list(self.joints)] = np.sign(self.ratios)
        return signs if np.count_nonzero(signs) == 1 else np.zeros(n_joints)


@dataclass(frozen=True)
class DriveTerm:
    """One term of one drive."""

    drive: Drive
    term: FrictionTerm

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.term.lower)

    def to_json(self) -> dict[str, Any]:
        """Return the term for a model file."""
        drive = {name: list(value) for name, value in vars(self.drive).items()}
        return {**drive, 'term': type(self.term).__name__, **vars(self.term)}

    @classmethod
    def from_json(cls, entry: Mapping[str, Any], n_joints: int) -> DriveTerm:
        """
        Return the term that `to_json` gave.

        ModelError where it does not fit. KeyError, TypeError, ValueError where the drive is
        damaged.
        """
        joints = tuple(int(joint) for joint in entry['joints'])
        ratios = tuple(float(ratio) for ratio in entry['ratios'])
        shares = tuple(float(share) for share in entry.get('shares', ()))
        known = all(0 <= joint < n_joints for joint in joints)
        if not joints or len(joints) != len(ratios) or not known:
            raise ValueError('joints and ratios of a drive do not fit')
        if shares and len(shares) != len(joints):
            raise ValueError('joints and shares of a drive do not fit')
        if not np.abs([*ratios, *shares]).max() <= LARGEST:
            raise ValueError('ratios or shares of a drive that no drive has')
        of_drive = {each.name for each in fields(Drive)}
        rest = {name: value for name, value in entry.items() if name not in of_drive}
        return cls(Drive(joints, ratios, shares), _term_from_json(rest))


@dataclass(frozen=True)
class LoadTorque:
    """
    A share of the torque of another joint's links.

    Efforts are those of motors that turn more than one joint each, as in a coupled wrist: the
    coupling matrix times the torques of the joints. The drive is `Drive.transmitted`.
    """

    name: ClassVar[str] = 'torque'
    lower: ClassVar[tuple[float, ...]] = (FREE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return state.load[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(LOAD)),),)


@dataclass(frozen=True)
class SharedFriction:
    """
    Shares of the viscous and Coulomb friction of another joint, of any sign (see `LoadTorque`).

    Such a share may drive the joint: it is part of the coupling, not friction of that joint.
    """

    width: float
    name: ClassVar[str] = 'friction'
    lower: ClassVar[tuple[float, ...]] = (FREE, FREE)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 2)."""
        return np.column_stack([state.dq, smooth_sign(state, self.width)])

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return ((1.0, Primitive(VELOCITY)),), ((1.0, Primitive(SIGN, self.width)),)


@dataclass(frozen=True)
class SignWidth:
    """
    Slope of Coulomb friction by the logarithm of its width, as a central difference.

    A direction of the posterior: the width was selected, and its deviation is that of the
    coefficient, which is zero, in units of the coefficient of Coulomb friction.
    """

    width: float
    name: ClassVar[str] = 'sign width'
    lower: ClassVar[tuple[float, ...]] = (FREE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        (column,) = self.columns()
        signs = [factor * smooth_sign(state, sign.width) for factor, sign in column]
        return np.sum(signs, axis=0)[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        steps = WIDTH_STEP, -WIDTH_STEP
        return (tuple((0.5 / h, Primitive(SIGN, self.width * math.exp(h))) for h in steps),)


_TERMS: dict[str, type[FrictionTerm]] = {
    each.__name__: each
    for each in (
        terms.Viscous,
        terms.Lag,
        terms.Coulomb,
        terms.Offset,
        terms.Stribeck,
        terms.SaturatingViscous,
        terms.QuadraticViscous,
        terms.LoadCoulomb,
        terms.LoadViscous,
        terms.Presliding,
        terms.Asymmetric,
        terms.PositionCoulomb,
        Ripple,
        Spring,
        LeverSpring,
        PositionCurve,
        VelocityCurve,
        Dahl,
        LoadTorque,
        SharedFriction,
    )
}
"""All terms by the name of their class, as model files have it."""


def _term_from_json(entry: dict[str, float | str]) -> FrictionTerm:
    parameters = {name: value for name, value in entry.items() if name != 'term'}
    kind = _TERMS.get(str(entry.get('term')))
    if kind is None or set(parameters) != {each.name for each in fields(kind)}:  # type: ignore[arg-type]
        raise ModelError(
            f'a friction term of this version was expected, but the file has {entry}; '
            'fit the model again.'
        )
    for name, value in parameters.items():
        _check_parameter(name, value)
    return kind(**parameters)


def _check_parameter(name: str, value: Any) -> None:
    """Raise ValueError where the parameter of a term is none that a fit gives."""
    integer = name in INTEGERS
    known = type(value) is int or (type(value) is float and not integer)
    lowest, largest = (1, MOST) if integer else (-LARGEST, LARGEST)
    lowest = LOWEST.get(name, lowest)
    if not known or not lowest <= value <= largest:
        raise ValueError(f'the {name} of a friction term is {value}')
