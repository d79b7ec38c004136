"""
Curves of any shape over a joint's position or velocity (maths.md, section 12).

Sums of smooth steps, flat where the data are silent: smoothed random walks (Wahba, Spline Models
for Observational Data, 1990).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.primitives import Column, ONE, Primitive, STEP, STEP_AT
from lip_id_ros.friction.terms import DriveState, FREE

OVERLAP = 0.75
"""Width of a step, in distances of steps."""

NARROWEST = 1e-12
"""Least width of a step [rad, m, rad/s or m/s]."""


@dataclass(frozen=True)
class _Curve:
    """A curve of `count` steps from `low` to `high` [rad or m, rad/s or m/s]."""

    low: float
    high: float
    count: int
    prior_share: ClassVar[float] = 0.03

    def __post_init__(self) -> None:
        """Check the steps; ValueError where there are none."""
        if not (self.count >= 2 and NARROWEST <= self.breadth < np.inf):
            raise ValueError('a curve that has no steps')

    @property
    def lower(self) -> tuple[float, ...]:
        """Return the lower bounds of the coefficients."""
        return (FREE,) * self.count

    @property
    def centres(self) -> Array:
        """Where the steps are, shape (k,)."""
        return np.linspace(self.low, self.high, self.count)

    @property
    def breadth(self) -> float:
        """The width of each step."""
        return OVERLAP * (self.high - self.low) / (self.count - 1)

    def _steps(self, x: Array) -> Array:
        return np.asarray(np.tanh((x[:, None] - self.centres) / self.breadth))


@dataclass(frozen=True)
class PositionCurve(_Curve):
    """Torque over the joint's own position, as of cables, cogging or a torque sensor."""

    name: ClassVar[str] = 'curve over position'

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, k)."""
        return self._steps(state.q)

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        step = Primitive(ONE, position=STEP_AT, harmonic=1.0 / self.breadth)
        return tuple(((1.0, step._replace(centre=float(c))),) for c in self.centres)


@dataclass(frozen=True)
class VelocityCurve(_Curve):
    """Torque over the joint's own velocity, as of drives whose effort falls with speed."""

    name: ClassVar[str] = 'curve over velocity'

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, k)."""
        return self._steps(state.dq)

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        step = Primitive(STEP, width=self.breadth)
        return tuple(((1.0, step._replace(centre=float(c))),) for c in self.centres)
