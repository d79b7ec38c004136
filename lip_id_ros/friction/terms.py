"""
Terms of joint friction, linear in their coefficients (maths.md, section 12).

All but offsets, lag and pre-sliding are dissipative: with features f(v) v >= 0 and coefficients
that are not negative they never drive a joint. `width` is that of `smooth_sign` [rad/s or m/s].
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import ClassVar, NamedTuple, Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.primitives import (
    ACCELERATION,
    Column,
    COSINE,
    ONE,
    Primitive,
    REVERSAL,
    SIGN,
    SINE,
    SQUARE,
    VELOCITY,
)

FREE, NOT_NEGATIVE = -np.inf, 0.0
"""Lower bounds of coefficients."""

PHASES = 0.5 * np.pi * np.arange(4)
"""Angles at which the friction that depends on position may be largest [rad]."""

WIDENINGS = (3.0, 10.0, 30.0)
"""Widths of the smooth signs of Stribeck and saturating friction, in widths of the joint's own."""


class DriveState(NamedTuple):
    """State of one drive at N samples, on the joint's side of the gear."""

    q: Array
    dq: Array
    ddq: Array
    load: Array  # (N,), transmitted to the links [N m or N]
    smoothing: Array | float = 0.0  # change of dq while a low-pass responds
    discrepancy: Array | float = 0.0  # of the low-passed sign to tanh(dq / smoothing)
    dahl: Array | None = None  # (N, D), see `JointHistory`; None if unknown


def smooth_sign(state: DriveState, width: float) -> Array:
    """
    Return the sign of the velocity as a low-pass leaves it, shape (N,).

    tanh(dq / w), where w^2 = width^2 + smoothing^2: a joint that reverses with acceleration ddq
    has the velocity ddq t, and tanh(t / rise_time) is nearly the low-pass of a step. What is known
    of the difference counts as far as the low-pass makes the width.
    """
    return _steady_sign(state, width) + state.discrepancy * (
        np.square(state.smoothing) / (width**2 + np.square(state.smoothing))
    )


def _steady_sign(state: DriveState, width: float) -> Array:
    return np.asarray(np.tanh(state.dq / np.hypot(width, state.smoothing)))


class FrictionTerm(Protocol):
    """A torque that is linear in k coefficients, each `FREE` or `NOT_NEGATIVE`."""

    @property
    def name(self) -> str:
        """Return what the literature calls the term."""

    @property
    def lower(self) -> tuple[float, ...]:
        """Return the lower bounds of the coefficients."""

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, k)."""

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""


@dataclass(frozen=True)
class Viscous:
    """Friction in proportion to velocity (Reynolds 1886)."""

    name: ClassVar[str] = 'viscous'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return state.dq[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(VELOCITY)),),)


@dataclass(frozen=True)
class Lag:
    """
    Viscous friction that answers late, to first order.

    F v(t - T) is F v - F T a, which no inertia stands for, as it has the other sign.
    """

    name: ClassVar[str] = 'lag'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return -state.ddq[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((-1.0, Primitive(ACCELERATION)),),)


@dataclass(frozen=True)
class Coulomb:
    """Dry friction (Coulomb 1785) with a smooth sign."""

    width: float
    name: ClassVar[str] = 'Coulomb'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return smooth_sign(state, self.width)[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(SIGN, self.width)),),)


@dataclass(frozen=True)
class Offset:
    """A constant torque: offset of a current or torque sensor, preload of a spring."""

    name: ClassVar[str] = 'offset'
    lower: ClassVar[tuple[float, ...]] = (FREE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return np.ones((len(state.dq), 1))

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(ONE)),),)


@dataclass(frozen=True)
class Stribeck:
    """
    Additional friction near rest, which decays with speed (Stribeck 1902).

    As differences of two smooth signs (Makkar, Dixon, Sawyer and Hu, AIM 2005, eq. 3), of
    `WIDENINGS`. A peak narrower than the sign's usual smoothing in the samples [rad/s or m/s]
    would be out of their sight, and could be of any height.
    """

    width: float
    smoothing: float = 0.0
    name: ClassVar[str] = 'Stribeck'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,) * len(WIDENINGS)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 3)."""
        narrow = smooth_sign(state, self._narrow)
        wide = [smooth_sign(state, times * self._narrow) for times in WIDENINGS]
        return np.column_stack([narrow - each for each in wide])

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        narrow = (1.0, Primitive(SIGN, self._narrow))
        wide = (Primitive(SIGN, times * self._narrow) for times in WIDENINGS)
        return tuple((narrow, (-1.0, each)) for each in wide)

    @property
    def _narrow(self) -> float:
        """The width of the narrow sign [rad/s or m/s]."""
        return math.hypot(self.width, self.smoothing)


@dataclass(frozen=True)
class SaturatingViscous:
    """
    Viscous friction that grows less and less with speed, as of greased gears.

    Wide smooth signs (sigmoids in Gaz, Cognetti, Oliva, Robuffo Giordano and De Luca, RA-L 2019,
    section IV; Makkar and others, AIM 2005), of `WIDENINGS`.
    """

    width: float
    name: ClassVar[str] = 'saturating viscous'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,) * len(WIDENINGS)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 3)."""
        return np.column_stack([smooth_sign(state, k * self.width) for k in WIDENINGS])

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return tuple(((1.0, Primitive(SIGN, k * self.width)),) for k in WIDENINGS)


@dataclass(frozen=True)
class QuadraticViscous:
    """Drag that grows with the square of velocity, as of fluid that is churned."""

    name: ClassVar[str] = 'quadratic viscous'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return (state.dq * np.abs(state.dq))[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(SQUARE)),),)


@dataclass(frozen=True)
class LoadCoulomb:
    """
    Dry friction of a gear that grows with the torque it transmits.

    Hamon, Gautier and Garrec, IROS 2010; Bittencourt and Gunnarsson, J. Dyn. Sys. 2012.
    """

    width: float
    name: ClassVar[str] = 'load-dependent Coulomb'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return (np.abs(state.load) * smooth_sign(state, self.width))[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(SIGN, self.width, loaded=True)),),)


@dataclass(frozen=True)
class LoadViscous:
    """Viscous friction of a gear that grows with the torque it transmits (as `LoadCoulomb`)."""

    name: ClassVar[str] = 'load-dependent viscous'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return (np.abs(state.load) * state.dq)[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(VELOCITY, loaded=True)),),)


@dataclass(frozen=True)
class Presliding:
    """
    Hysteresis of dry friction at a reversal.

    Asperities or gear teeth deform elastically before they slide (Dahl 1968; Armstrong-Helouvry,
    Dupont and Canudas de Wit, Automatica 1994, section 2.2), so that friction lags behind the sign
    of the velocity. A joint that accelerates forwards near rest has come from moving backwards,
    and the other way round: there it has -tanh(ddq / acceleration) / cosh(dq / width)^2 more
    friction. The work over a reversal of constant acceleration is zero, since what has been
    deformed springs back.
    """

    width: float
    acceleration: float
    name: ClassVar[str] = 'pre-sliding'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        near = 1.0 - _steady_sign(state, self.width) ** 2
        return (-near * np.tanh(state.ddq / self.acceleration))[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        reversal = Primitive(REVERSAL, self.width, acceleration=self.acceleration)
        return (((-1.0, reversal),),)


@dataclass(frozen=True)
class Asymmetric:
    """
    Viscous and Coulomb friction of one direction only.

    Armstrong-Helouvry, Control of Machines with Friction, 1991, section 4.
    """

    width: float
    name: ClassVar[str] = 'asymmetric'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,) * 4

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 4): forwards, then backwards."""
        both = np.column_stack([state.dq, smooth_sign(state, self.width)])
        return np.hstack([np.maximum(both, 0.0), np.minimum(both, 0.0)])

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return tuple(
            ((1.0, Primitive(shape, self.width, side)),)
            for side in (1, -1)
            for shape in (VELOCITY, SIGN)
        )


@dataclass(frozen=True)
class PositionCoulomb:
    """
    Dry friction that varies once a turn, as of an eccentric gear or bearing.

    Armstrong-Helouvry, Control of Machines with Friction, 1991, section 5.
    """

    width: float
    name: ClassVar[str] = 'position-dependent Coulomb'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,) * PHASES.size

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 4)."""
        share = 1.0 + np.cos(state.q[:, None] - PHASES)
        return smooth_sign(state, self.width)[:, None] * share

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        sign = Primitive(SIGN, self.width)
        return tuple(
            (
                (1.0, sign),
                (float(np.cos(phase)), sign._replace(position=COSINE)),
                (float(np.sin(phase)), sign._replace(position=SINE)),
            )
            for phase in PHASES
        )
