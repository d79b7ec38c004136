"""The coefficients of an arm's friction, with units and standard deviations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction import conservative_terms, terms
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.drives import DriveTerm
from lip_id_ros.joint_types import PRISMATIC
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

HEADER = ('', 'term', 'coefficient', 'unit')
TORQUE, VISCOUS = 'N m', 'N m s/rad'
BOTH = ('viscous', VISCOUS), ('Coulomb', TORQUE)

COEFFICIENTS: Mapping[Callable[..., terms.Term], tuple[tuple[str, str], ...]] = {
    terms.viscous: (('', VISCOUS),),
    terms.lag: (('', 'N m s²/rad'),),
    terms.coulomb: (('', TORQUE),),
    terms.offset: (('', TORQUE),),
    terms.quadratic: (('', 'N m s²/rad²'),),
    terms.load_coulomb: (('', '1'),),
    terms.load_viscous: (('', 's/rad'),),
    terms.presliding: (('', TORQUE),),
    terms.asymmetric: tuple(
        (f'{name} {way}', unit) for way in ('forwards', 'backwards') for name, unit in BOTH
    ),
    terms.position_coulomb: tuple(
        (f'largest at {degrees:g} deg', TORQUE) for degrees in np.degrees(terms.PHASES)
    ),
    conservative_terms.ripple: (('cosine', TORQUE), ('sine', TORQUE)),
    conservative_terms.spring: (('', 'N m/rad'),),
    terms.dahl: (('', TORQUE),),
    terms.load_torque: (('', '1'),),
    terms.shared_friction: BOTH,
}
"""What each coefficient of a term is, beside its name, and its unit at a revolute joint."""

CURVES = {
    conservative_terms.position_curve: 'rad',
    conservative_terms.velocity_curve: 'rad/s',
}
"""Units of what curves are over."""


class Coefficient(NamedTuple):
    """
    One coefficient of the friction of a joint, with its standard deviation.

    None where the model has no deviation of it: where other parameters can stand for it, and of
    Dahl's friction, whose whole force counts as unknown near rest.
    """

    joint: str
    term: str
    value: float
    std: float | None
    unit: str

    def cells(self) -> tuple[str, ...]:
        """Return it as text, for `HEADER`."""
        deviation = '' if self.std is None else f' ± {self.std:.2g}'
        return self.joint, self.term, f'{self.value:.4g}{deviation}', self.unit


def friction_table(model: InverseDynamicsModel) -> tuple[Coefficient, ...]:
    """Return the coefficients of an arm's friction, joint by joint; else nothing."""
    arm = model.arm
    if arm is None:
        return ()
    basis = arm.friction.basis
    first = len(arm.links) * (DIRECTIONS + LINK_PARAMETERS)
    std = np.linalg.norm(arm.covariance_root[first : first + basis.size], axis=1)
    names = labels(basis, model.joint_names, model.joint_types)
    found = (
        Coefficient(joint, term, value, deviation or None, unit)
        for (joint, term, unit), value, deviation in zip(
            names, arm.friction.coefficients.tolist(), std.tolist(), strict=True
        )
    )
    return tuple(sorted(found, key=lambda each: model.joint_names.index(each.joint)))


def friction_curves(
    model: InverseDynamicsModel, joint: str, velocity: Array
) -> list[tuple[str, Array]]:
    """
    Return name and torque (N,) of each term of a joint's friction, as `model.friction` has them.

    Velocities (N,) are constant, positions are the mean of the training data, and the other joints
    rest.
    """
    arm = model.arm
    if arm is None:
        return []
    index = model.joint_names.index(joint)
    dq = np.zeros((len(velocity), model.n_joints))
    dq[:, index] = velocity
    terms, curves = arm.friction.basis.terms, []
    for part in terms:
        if index in (k for k, _ in part.drive.efforts):
            friction = arm.friction.with_terms([each is part for each in terms])
            alone = replace(model, arm=replace(arm, friction=friction))
            curves.append((part.term.name, alone.friction(dq)[:, index]))
    return curves


def labels(
    basis: FrictionBasis, joint_names: Sequence[str], joint_types: Sequence[str]
) -> list[tuple[str, str, str]]:
    """Return joint, term and unit of each coefficient of friction."""
    return [label for part in basis.terms for label in _labels(part, joint_names, joint_types)]


def _labels(
    part: DriveTerm, joint_names: Sequence[str], joint_types: Sequence[str]
) -> list[tuple[str, str, str]]:
    joint = part.drive.efforts[0][0]
    others = [joint_names[k] for k in part.drive.joints if k != joint]
    name = part.term.name + f' coupled with {" and ".join(others)}' * bool(others)
    linear = joint_types[joint] == PRISMATIC
    found = []
    for more, unit in coefficients_of(part.term):
        label = f'{name}, {more}' if more else name
        if linear:
            label, unit = label.replace(' rad', ' m'), unit.replace('N m', 'N').replace('rad', 'm')
        found.append((joint_names[joint], label, unit))
    return found


def coefficients_of(term: terms.Term) -> tuple[tuple[str, str], ...]:
    """Return what each coefficient of a term is beside its name, and its unit."""
    known, lasts = term.parameters, [column[-1][1] for column in term.columns if column]
    if term.kind in CURVES:
        unit = CURVES[term.kind]
        return tuple((f'step at {last.centre:.3g} {unit}', TORQUE) for last in lasts)
    if term.kind in (terms.stribeck, terms.saturating):
        return tuple((f'within {last.width:.2g} rad/s', TORQUE) for last in lasts)
    if term.kind is conservative_terms.lever_spring:
        e, centre = known['eccentricity'], known['dead_centre']
        at = f'eccentricity {e:.3g}, dead centre {centre:.3g} rad'
        return (f'constant force, {at}', TORQUE), (f'stiffness, {at}', TORQUE)
    return COEFFICIENTS[term.kind]
