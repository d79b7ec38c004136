"""
Terms of joint friction, linear in their coefficients (maths.md, section 12).

All but offsets, lag, pre-sliding and shares of other joints are dissipative: with features
f(v) v >= 0 and coefficients that are not negative they never drive a joint. Of a drive q, v and a
are position, velocity and acceleration on the joint's side of the gear, L is the load that it
transmits to the links [N m or N], and S_w is the smooth sign of width w [rad/s or m/s] of
`drive_friction`. Coefficients have the unit of the torque in that of the feature.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
import math

from lip_id_ros.friction.primitives import (
    ACCELERATION,
    Column,
    COSINE,
    LOAD,
    ONE,
    Primitive,
    REVERSAL,
    SIGN,
    SINE,
    SQUARE,
    VELOCITY,
)
from lip_id_ros.joint_types import DISPLACEMENTS

FREE, NOT_NEGATIVE = -math.inf, 0.0
"""Lower bounds of coefficients."""

PHASES = tuple(0.5 * math.pi * k for k in range(4))
"""Angles at which the friction that depends on position may be largest [rad]."""

WIDENINGS = (3.0, 10.0, 30.0)
"""Widths of the smooth signs of Stribeck and saturating friction, in widths of the joint's own."""

WIDTH_STEP = 1e-2
"""Of the logarithm of a width, for its slope."""


@dataclass(frozen=True)
class Term:
    """
    A torque that is linear in k coefficients, with a lower bound that they share.

    `kind` is the function that makes the term of `parameters`, and `name` what the literature
    calls it. `prior_share` is the prior deviation of coefficients, as a share of the usual one.
    """

    kind: Callable[..., Term]
    name: str
    columns: tuple[Column, ...]  # the k features
    bound: float = NOT_NEGATIVE
    parameters: Mapping[str, float] = field(default_factory=dict, hash=False)
    prior_share: float = 1.0

    @property
    def lower(self) -> tuple[float, ...]:
        """The lower bounds of the coefficients."""
        return (self.bound,) * len(self.columns)

    def changed(self, **parameters: float) -> Term:
        """Return the term with some other parameters."""
        return self.kind(**{**self.parameters, **parameters})


def single(primitive: Primitive, factor: float = 1.0) -> Column:
    """Return a feature of one primitive."""
    return ((factor, primitive),)


def viscous() -> Term:
    """Return friction in proportion to velocity, v (Reynolds 1886)."""
    return Term(viscous, 'viscous', (single(Primitive(VELOCITY)),))


def lag() -> Term:
    """
    Return what makes viscous friction answer late, to first order: -a.

    F v(t - T) is F v - F T a, which no inertia stands for, as it has the other sign.
    """
    return Term(lag, 'lag', (single(Primitive(ACCELERATION), -1.0),))


def coulomb(width: float) -> Term:
    """Return dry friction with a smooth sign, S_w (Coulomb 1785)."""
    return Term(coulomb, 'Coulomb', (single(Primitive(SIGN, width)),), parameters={'width': width})


def sign_width(width: float) -> Term:
    """
    Return the slope of Coulomb friction by ln w, as a central difference.

    A direction of the posterior: the width was selected, and its deviation is that of the
    coefficient, which is zero, in units of the coefficient of Coulomb friction.
    """
    steps = WIDTH_STEP, -WIDTH_STEP
    column = tuple((0.5 / h, Primitive(SIGN, width * math.exp(h))) for h in steps)
    return Term(sign_width, 'sign width', (column,), FREE, {'width': width})


def offset() -> Term:
    """Return a constant torque, 1: offset of a current or torque sensor, preload of a spring."""
    return Term(offset, 'offset', (single(Primitive(ONE)),), FREE)


def stribeck(width: float, smoothing: float = 0.0) -> Term:
    """
    Return additional friction near rest, which decays with speed (Stribeck 1902).

    S_u - S_ku for the k of `WIDENINGS` (Makkar, Dixon, Sawyer and Hu, AIM 2005, eq. 3), where
    u^2 = w^2 + smoothing^2: a peak narrower than the sign's usual smoothing in the samples [rad/s
    or m/s] would be out of their sight, and could be of any height.
    """
    narrow = math.hypot(width, smoothing)
    columns = tuple(
        ((1.0, Primitive(SIGN, narrow)), (-1.0, Primitive(SIGN, k * narrow))) for k in WIDENINGS
    )
    parameters = {'width': width, 'smoothing': smoothing}
    return Term(stribeck, 'Stribeck', columns, parameters=parameters)


def saturating(width: float) -> Term:
    """
    Return viscous friction that grows less and less with speed, as of greased gears.

    Wide smooth signs S_kw for the k of `WIDENINGS` (sigmoids in Gaz, Cognetti, Oliva, Robuffo
    Giordano and De Luca, RA-L 2019, section IV; Makkar and others, AIM 2005).
    """
    columns = tuple(single(Primitive(SIGN, k * width)) for k in WIDENINGS)
    return Term(saturating, 'saturating viscous', columns, parameters={'width': width})


def quadratic() -> Term:
    """Return drag that grows with the square of velocity, v |v|, as of fluid that is churned."""
    return Term(quadratic, 'quadratic viscous', (single(Primitive(SQUARE)),))


def load_coulomb(width: float) -> Term:
    """
    Return dry friction of a gear that grows with the torque it transmits, |L| S_w.

    Hamon, Gautier and Garrec, IROS 2010; Bittencourt and Gunnarsson, J. Dyn. Sys. 2012.
    """
    columns = (single(Primitive(SIGN, width, loaded=True)),)
    return Term(load_coulomb, 'load-dependent Coulomb', columns, parameters={'width': width})


def load_viscous() -> Term:
    """Return viscous friction of a gear that grows with its load, |L| v (as `load_coulomb`)."""
    columns = (single(Primitive(VELOCITY, loaded=True)),)
    return Term(load_viscous, 'load-dependent viscous', columns)


def presliding(width: float, acceleration: float) -> Term:
    """
    Return the hysteresis of dry friction at a reversal, -tanh(a / acceleration) (1 - S_w^2).

    Asperities or gear teeth deform elastically before they slide (Dahl 1968; Armstrong-Helouvry,
    Dupont and Canudas de Wit, Automatica 1994, section 2.2), so that friction lags behind the sign
    of the velocity. A joint that accelerates forwards near rest has come from moving backwards,
    and the other way round. The work over a reversal of constant acceleration [rad/s^2 or m/s^2]
    is zero, since what has been deformed springs back.
    """
    columns = (single(Primitive(REVERSAL, width, acceleration=acceleration), -1.0),)
    parameters = {'width': width, 'acceleration': acceleration}
    return Term(presliding, 'pre-sliding', columns, parameters=parameters)


def dahl(width: float, displacement: float) -> Term:
    """
    Return dry friction whose state z turns with the displacement, not with the velocity: z - S_w.

    Dahl 1968; Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 1994. An arm that stands
    is held by what is left of its last motion. The difference to Coulomb friction's sign is
    nothing of single states, which show nothing of the past: `FrictionBasis` adds it where states
    (see `dahl_states`) are known. ValueError where none are kept for a displacement [rad or m].
    """
    if displacement not in DISPLACEMENTS:
        raise ValueError(f'a displacement of Dahl friction that is none of {DISPLACEMENTS}')
    parameters = {'width': width, 'displacement': displacement}
    return Term(dahl, 'Dahl hysteresis', ((),), parameters=parameters)


def asymmetric(width: float) -> Term:
    """
    Return viscous and Coulomb friction of one direction only: v and S_w forwards, then backwards.

    Armstrong-Helouvry, Control of Machines with Friction, 1991, section 4.
    """
    columns = tuple(
        single(Primitive(shape, width, side)) for side in (1, -1) for shape in (VELOCITY, SIGN)
    )
    return Term(asymmetric, 'asymmetric', columns, parameters={'width': width})


def position_coulomb(width: float) -> Term:
    """
    Return dry friction that varies once a turn, as of an eccentric gear or bearing.

    S_w (1 + cos(q - p)) for the p of `PHASES` (Armstrong-Helouvry, Control of Machines with
    Friction, 1991, section 5).
    """
    sign = Primitive(SIGN, width)
    columns = tuple(
        (
            (1.0, sign),
            (math.cos(phase), sign._replace(position=COSINE)),
            (math.sin(phase), sign._replace(position=SINE)),
        )
        for phase in PHASES
    )
    return Term(
        position_coulomb, 'position-dependent Coulomb', columns, parameters={'width': width}
    )


def load_torque() -> Term:
    """
    Return a share of the torque of another joint's links, L.

    Efforts are those of motors that turn more than one joint each, as in a coupled wrist: the
    coupling matrix times the torques of the joints. The drive is `Drive.transmitted`.
    """
    return Term(load_torque, 'torque', (single(Primitive(LOAD)),), FREE)


def shared_friction(width: float) -> Term:
    """
    Return shares of another joint's viscous and Coulomb friction, v and S_w (see `load_torque`).

    Of any sign: such a share may drive the joint, as part of the coupling, not friction of it.
    """
    columns = single(Primitive(VELOCITY)), single(Primitive(SIGN, width))
    return Term(shared_friction, 'friction', columns, FREE, {'width': width})
