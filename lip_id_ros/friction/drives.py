"""Terms of the drives of an arm, coupled motors included (maths.md, section 12)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from inspect import signature
from typing import Any

import numpy as np

from lip_id_ros.errors import ModelError
from lip_id_ros.friction import conservative_terms, terms
from lip_id_ros.friction.terms import Term

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


@dataclass(frozen=True)
class DriveTerm:
    """One term of one drive."""

    drive: Drive
    term: Term

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return len(self.term.lower)

    def to_json(self) -> dict[str, Any]:
        """Return the term for a model file."""
        drive = {name: list(value) for name, value in vars(self.drive).items()}
        return {**drive, 'term': NAMES[self.term.kind], **self.term.parameters}

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


KINDS: dict[str, Callable[..., Term]] = {
    'Viscous': terms.viscous,
    'Lag': terms.lag,
    'Coulomb': terms.coulomb,
    'Offset': terms.offset,
    'Stribeck': terms.stribeck,
    'SaturatingViscous': terms.saturating,
    'QuadraticViscous': terms.quadratic,
    'LoadCoulomb': terms.load_coulomb,
    'LoadViscous': terms.load_viscous,
    'Presliding': terms.presliding,
    'Asymmetric': terms.asymmetric,
    'PositionCoulomb': terms.position_coulomb,
    'Ripple': conservative_terms.ripple,
    'Spring': conservative_terms.spring,
    'LeverSpring': conservative_terms.lever_spring,
    'PositionCurve': conservative_terms.position_curve,
    'VelocityCurve': conservative_terms.velocity_curve,
    'Dahl': terms.dahl,
    'LoadTorque': terms.load_torque,
    'SharedFriction': terms.shared_friction,
}
"""What makes a term, by its name in model files."""

NAMES = {kind: name for name, kind in KINDS.items()}
"""Names in model files by what makes the term."""


def _term_from_json(entry: dict[str, float | str]) -> Term:
    parameters = {name: value for name, value in entry.items() if name != 'term'}
    kind = KINDS.get(str(entry.get('term')))
    if kind is None or set(parameters) != set(signature(kind).parameters):
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
