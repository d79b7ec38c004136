"""
Torques that are selected like friction, but are none (maths.md, section 12).

Springs and ripples over the position q of a drive, and curves of any shape over q or its velocity
v: sums of smooth steps, flat where the data are silent, as smoothed random walks (Wahba, Spline
Models for Observational Data, 1990).
"""

from __future__ import annotations

import numpy as np

from lip_id_ros.friction.primitives import (
    COSINE,
    LEVER,
    ONE,
    POSITION,
    Primitive,
    SINE,
    STEP,
    STEP_AT,
)
from lip_id_ros.friction.terms import FREE, single, Term

ECCENTRICITIES, SHAPE_STEP = (0.02, 0.98), 1e-4
"""
Least and largest of a lever; steps of eccentricities and dead centres [rad], for their slopes.
"""

CURVE_SHARE = 0.03
"""Prior deviation of a step of a curve, as a share of that of other coefficients."""

OVERLAP = 0.75
"""Width of a step, in distances of steps."""

NARROWEST = 1e-12
"""Least width of a step [rad, m, rad/s or m/s]."""


def ripple(harmonic: int) -> Term:
    """
    Return the torque of h periods a turn, as of a counterweight, a gear or a cogging motor.

    cos(h q) and sin(h q) (Holtz and Springob, IEEE Trans. Industrial Electronics 1996; of strain
    wave gears: Ghorbel, Gandhi and Alpeter, J. Mechanical Design 2001).
    """
    often = {1: 'periodic once', 2: 'periodic twice'}.get(harmonic, f'ripple {harmonic} times')
    columns = tuple(
        single(Primitive(ONE, position=wave, harmonic=float(harmonic))) for wave in (COSINE, SINE)
    )
    return Term(ripple, f'{often} a turn', columns, FREE, {'harmonic': harmonic})


def spring() -> Term:
    """Return a linear spring, q, as a counterbalance has; its rest position is in `offset`."""
    return Term(spring, 'joint spring', (single(Primitive(ONE, position=POSITION)),), FREE)


def lever_spring(eccentricity: float, dead_centre: float) -> Term:
    """
    Return a coil or gas spring between a point of the link and one of the link before.

    Points at distances a and b from the axis are l = c sqrt(1 - e cos(q - q0)) apart, where c^2 =
    a^2 + b^2 and the eccentricity e = 2 a b / c^2; at the dead centre q0 they are nearest. A
    spring of force k (l - l0) has the torque k c^2 e / 2 sin(q - q0) (1 - (l0 / c) / sqrt(1 - e
    cos(q - q0))), one of constant force F along the line the second part alone: the features are
    sin(q - q0) / sqrt(1 - e cos(q - q0)), of the constant force, and sin(q - q0), of the
    stiffness. ValueError where the points always or never are as far apart.
    """
    low, high = ECCENTRICITIES
    if not low <= eccentricity <= high:
        raise ValueError(f'a lever whose eccentricity is not between {low} and {high}')
    columns = single(_lever(eccentricity, dead_centre)), single(_sine(dead_centre))
    parameters = {'eccentricity': eccentricity, 'dead_centre': dead_centre}
    return Term(lever_spring, 'lever spring', columns, FREE, parameters)


def lever_shape(eccentricity: float, dead_centre: float) -> Term:
    """
    Return slopes of `lever_spring` by its eccentricity and dead centre, as central differences.

    Directions of the fit and of the posterior, whose coefficients are zero: of the constant force
    by both, and of the stiffness by the dead centre.
    """
    h, e, centre = SHAPE_STEP, eccentricity, dead_centre
    ends = (
        (_lever(e + h, centre), _lever(e - h, centre)),
        (_lever(e, centre + h), _lever(e, centre - h)),
        (_sine(centre + h), _sine(centre - h)),
    )
    columns = tuple(((0.5 / h, more), (-0.5 / h, less)) for more, less in ends)
    parameters = {'eccentricity': eccentricity, 'dead_centre': dead_centre}
    return Term(lever_shape, 'lever shape', columns, FREE, parameters)


def _lever(eccentricity: float, centre: float) -> Primitive:
    return Primitive(ONE, position=LEVER, harmonic=eccentricity, centre=centre)


def _sine(centre: float) -> Primitive:
    return Primitive(ONE, position=SINE, centre=centre)


def position_curve(low: float, high: float, count: int) -> Term:
    """
    Return torque over the joint's own position, as of cables, cogging or a torque sensor.

    tanh((q - c) / b) for centres c from low to high [rad or m], and of the breadth b.
    """
    harmonic = 1.0 / _breadth(low, high, count)
    columns = tuple(
        single(Primitive(ONE, position=STEP_AT, harmonic=harmonic, centre=c))
        for c in np.linspace(low, high, count).tolist()
    )
    parameters = {'low': low, 'high': high, 'count': count}
    return Term(
        position_curve, 'curve over position', columns, FREE, parameters, prior_share=CURVE_SHARE
    )


def velocity_curve(low: float, high: float, count: int) -> Term:
    """
    Return torque over the joint's own velocity, as of drives whose effort falls with speed.

    tanh((v - c) / b) for centres c from low to high [rad/s or m/s], and of the breadth b.
    """
    breadth = _breadth(low, high, count)
    columns = tuple(
        single(Primitive(STEP, breadth, centre=c)) for c in np.linspace(low, high, count).tolist()
    )
    parameters = {'low': low, 'high': high, 'count': count}
    return Term(
        velocity_curve, 'curve over velocity', columns, FREE, parameters, prior_share=CURVE_SHARE
    )


def _breadth(low: float, high: float, count: int) -> float:
    """Return the width of each step of a curve; ValueError where there are none."""
    breadth = OVERLAP * (high - low) / (count - 1) if count > 1 else 0.0
    if not NARROWEST <= breadth < np.inf:
        raise ValueError('a curve that has no steps')
    return breadth
