"""Conservative torques that are selected like friction (maths.md, section 12)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.primitives import (
    Column,
    COSINE,
    LEVER,
    ONE,
    POSITION,
    Primitive,
    SINE,
)
from lip_id_ros.friction.terms import DriveState, FREE

ECCENTRICITIES, SHAPE_STEP = (0.02, 0.98), 1e-4
"""
Least and largest of a lever; steps of eccentricities and dead centres [rad], for their slopes.
"""


@dataclass(frozen=True)
class Ripple:
    """
    Torque of so many periods a turn, as of a counterweight, a gear or a cogging motor.

    Holtz and Springob, IEEE Trans. Industrial Electronics 1996; of strain wave gears: Ghorbel,
    Gandhi and Alpeter, J. Mechanical Design 2001. It is conservative, not friction.
    """

    harmonic: int
    lower: ClassVar[tuple[float, ...]] = (FREE, FREE)

    @property
    def name(self) -> str:
        """Return what the literature calls it."""
        return {1: 'periodic once a turn', 2: 'periodic twice a turn'}.get(
            self.harmonic, f'ripple {self.harmonic} times a turn'
        )

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 2)."""
        angle = self.harmonic * state.q
        return np.column_stack([np.cos(angle), np.sin(angle)])

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return tuple(
            ((1.0, Primitive(ONE, position=each, harmonic=float(self.harmonic))),)
            for each in (COSINE, SINE)
        )


@dataclass(frozen=True)
class Spring:
    """A linear spring of the joint, as a counterbalance has; its rest position is in `Offset`."""

    name: ClassVar[str] = 'joint spring'
    lower: ClassVar[tuple[float, ...]] = (FREE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return state.q[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(ONE, position=POSITION)),),)


@dataclass(frozen=True)
class LeverSpring:
    """
    A coil or gas spring between a point of the link and one of the link before.

    Points at distances a and b from the axis are l = c sqrt(1 - e cos(q - q0)) apart, where c^2 =
    a^2 + b^2 and the eccentricity e = 2 a b / c^2; at the dead centre q0 they are nearest. A
    spring of force k (l - l0) has the torque k c^2 e / 2 sin(q - q0) (1 - (l0 / c) / sqrt(1 - e
    cos(q - q0))), one of constant force F along the line the second part alone. It is
    conservative, not friction.
    """

    eccentricity: float
    dead_centre: float
    name: ClassVar[str] = 'lever spring'
    lower: ClassVar[tuple[float, ...]] = (FREE, FREE)

    def __post_init__(self) -> None:
        """Check the shape; ValueError where the points always or never are as far apart."""
        low, high = ECCENTRICITIES
        if not low <= self.eccentricity <= high:
            raise ValueError(f'a lever whose eccentricity is not between {low} and {high}')

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 2): of the constant force, and of the stiffness."""
        return lever_features(state.q, self.eccentricity, self.dead_centre)

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return ((1.0, _lever_at(self.eccentricity, self.dead_centre)),), (
            (1.0, _sine_at(self.dead_centre)),
        )


@dataclass(frozen=True)
class LeverShape:
    """
    Slopes of `LeverSpring` by its eccentricity and its dead centre, as central differences.

    Directions of the fit and of the posterior, whose coefficients are zero: of the constant force
    by both, and of the stiffness by the dead centre.
    """

    eccentricity: float
    dead_centre: float
    name: ClassVar[str] = 'lever shape'
    lower: ClassVar[tuple[float, ...]] = (FREE, FREE, FREE)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 3)."""
        h, e, centre = SHAPE_STEP, self.eccentricity, self.dead_centre
        by_eccentricity = lever_features(state.q, e + h, centre) - lever_features(
            state.q, e - h, centre
        )
        by_centre = lever_features(state.q, e, centre + h) - lever_features(state.q, e, centre - h)
        return np.column_stack([by_eccentricity[:, 0], by_centre]) / (2.0 * h)

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        h, e, centre = SHAPE_STEP, self.eccentricity, self.dead_centre
        ends = (
            (_lever_at(e + h, centre), _lever_at(e - h, centre)),
            (_lever_at(e, centre + h), _lever_at(e, centre - h)),
            (_sine_at(centre + h), _sine_at(centre - h)),
        )
        return tuple(((0.5 / h, more), (-0.5 / h, less)) for more, less in ends)


def lever_features(q: Array, eccentricity: float, dead_centre: float) -> Array:
    """Return the features of `LeverSpring` at positions (N,) [rad], shape (N, 2)."""
    sine = np.sin(q - dead_centre)
    length = np.sqrt(1.0 - eccentricity * np.cos(q - dead_centre))
    return np.column_stack([sine / length, sine])


def _lever_at(eccentricity: float, dead_centre: float) -> Primitive:
    return Primitive(ONE, position=LEVER, harmonic=eccentricity, centre=dead_centre)


def _sine_at(centre: float) -> Primitive:
    return Primitive(ONE, position=SINE, centre=centre)
