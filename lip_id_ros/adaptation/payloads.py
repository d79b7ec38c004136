"""
Payloads as they come: disturbances that ten more numbers of the last link explain.

A generalised likelihood ratio test (Willsky and Jones, IEEE Transactions on Automatic Control
1976): torques since a disturbance began are those of the arm with a body more, or less, at its
last link. A contact leaves residuals that no body has.

"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.rigid_body.pseudo_inertia import BODY, pseudo_inertia

NUMBERS = 8
"""Of a payload: mass, centre of mass, and their deviations."""

PRIOR_STD = np.array([5.0, *3 * (1.0,), *6 * (0.3,)])
"""Of the parameters of a body [kg, kg m, kg m^2]."""

LEAST_S, SETTLED_S = 1.0, 5.0
"""Motion after which a payload may be found, and after which it is known [s]."""

SURE, CONSISTENT, UNEXPLAINED = 60.0, 3.0, 0.02
"""
Least log likelihood ratio, and largest mean square of what remains: in that of the noise, and
beside it, at most, in that of what is explained where places of joints are not sure. Contacts
leave a tenth and more.
"""

LONGEST_S = 2.0
"""Motion after which a disturbance that no payload explains is none [s]."""


MOST_MASS, MOST_CENTRE = 1000.0, 10.0
"""Of a payload that is announced [kg, m]: grams and millimetres are refused."""

ROUNDING = 1e-9
"""Of inertias, in squares of metres: a point mass has none."""


@dataclass(frozen=True, eq=False)
class Payload:
    """
    A body at the last link, in the frame of it that `lip_id export` writes.

    Negative numbers where it is lighter than in the fit.

    `mass`, `mass_std` [kg]; `centre`, `centre_std`, shape (3,) [m]: of mass, no number where the
    mass is less than its deviation.

    """

    mass: float
    mass_std: float
    centre: Array
    centre_std: Array

    def to_array(self) -> Array:
        """Return all numbers, shape (8,)."""
        return np.concatenate([[self.mass, self.mass_std], self.centre, self.centre_std])

    @classmethod
    def from_array(cls, numbers: Array) -> Payload:
        """Return what `to_array` made an array of."""
        return cls(float(numbers[0]), float(numbers[1]), numbers[2:5], numbers[5:8])

    @property
    def in_words(self) -> str:
        """Mass and centre of mass with their deviations."""
        mass = f'{self.mass:.3g} ± {self.mass_std:.2g} kg'
        if np.isnan(self.centre).any():
            return f'{mass}, its centre of mass unknown'
        pairs = zip(self.centre, self.centre_std, strict=True)
        centre = ', '.join(f'{x:.3f} ± {std:.2g}' for x, std in pairs)
        return f'{mass}, its centre of mass at ({centre}) m in the frame of the last link'


@dataclass(frozen=True)
class PayloadEvent:
    """
    A payload that was taken up, or None where the last link is as in the fit.

    `t`: time [s], no number before the first sample.
    """

    t: float
    payload: Payload | None

    def to_json(self) -> dict[str, Any]:
        """Return the figures for other programs, null where there is none."""
        own = self.payload
        if own is None:
            return {'t': self.t, 'mass': None}
        centre, std = (
            None if np.isnan(x).any() else x.tolist() for x in (own.centre, own.centre_std)
        )
        return {
            't': self.t,
            'mass': own.mass,
            'mass_std': own.mass_std,
            'centre': centre,
            'centre_std': std,
        }

    def sentence(self) -> str:
        """Return what happened."""
        payload = 'The payload' if np.isnan(self.t) else f'At {self.t:.1f} s the payload'
        return f'{payload} is {self.payload.in_words if self.payload else "gone"}.'


def known_payload(mass: float, centre: Array, inertia: Array | None = None) -> Array:
    """
    Return the numbers of a body, shape (10,), by its mass [kg] and centre of mass, (3,) [m].

    `inertia`, shape (6,): xx xy xz yy yz zz about the centre [kg m^2]; without it a point mass.
    """
    x, y, z = centre
    of_point = np.array([y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y])
    about_origin = mass * of_point + (0.0 if inertia is None else inertia)
    return np.concatenate([[mass], mass * np.asarray(centre), about_origin])


def parts_of(body: Array) -> tuple[float, Array, Array]:
    """Return what `known_payload` makes the numbers of a body of."""
    mass = float(body[0])
    centre = body[1:4] / mass if mass else np.zeros(3)
    return mass, centre, body[4:] - known_payload(mass, centre)[4:]


def announced_payload(mass: float, centre: Array, inertia: Array) -> Array:
    """Return the numbers of a body that is announced, as `known_payload`; DataError if none is."""
    if mass == 0.0:
        return np.zeros(BODY)
    if not (0.0 < mass <= MOST_MASS and (np.abs(centre) <= MOST_CENTRE).all()):
        raise DataError(
            f'a payload must have a mass of up to {MOST_MASS:g} kg, and a centre of mass within '
            f'{MOST_CENTRE:g} m of the last link, but has {mass:g} kg at {_vector(centre)} m; '
            'correct the message and its units.'
        )
    about_centre = pseudo_inertia(known_payload(mass, np.zeros(3), inertia))
    shares = np.linalg.eigvalsh(about_centre) / mass if np.isfinite(about_centre).all() else np.inf
    if np.min(shares) < -ROUNDING or np.max(shares) > MOST_CENTRE**2:
        raise DataError(
            'a payload must have an inertia about its centre of mass that a body can have, or '
            f'none at all, but has {_vector(inertia)} kg m^2; correct the message.'
        )
    return known_payload(mass, centre, inertia)


def _vector(values: Array) -> str:
    return f'({", ".join(f"{value:g}" for value in values)})'


class PayloadWatch:
    """
    Statistics of the torques since a disturbance began, for the body that explains them.

    `unsure`: share of the squared torques of a body that the arm leaves open.

    """

    def __init__(self, n_joints: int, unsure: float) -> None:
        self._n, self.unsure = n_joints, min(unsure, UNEXPLAINED)
        self.clear()

    def clear(self) -> None:
        """Begin anew."""
        self.seconds, self._counts, self._squares = 0.0, np.zeros(self._n), np.zeros(self._n)
        self._informations = np.zeros((self._n, BODY, BODY))
        self._targets = np.zeros((self._n, BODY))

    def add(
        self, seconds: float, slopes: Array, residual: Array, variance: Array, inflation: Array
    ) -> None:
        """
        Take samples of motion.

        `slopes`, shape (N, n, 10): of torques by the numbers of the last link. `residual`, shape
        (N, n): measured torques minus those without the body. `variance`, same shape: of these,
        infinite where a joint rests. `inflation`, shape (N,): of it, since noise lasts.

        """
        weights = 1.0 / (variance * inflation[:, None])
        rows = slopes * weights[..., None]
        self.seconds += seconds
        self._counts += (1.0 / inflation) @ np.isfinite(variance)
        self._squares += np.sum(residual**2 * weights, axis=0)
        self._informations += np.einsum('tjk,tjl->jkl', rows, slopes)
        self._targets += np.einsum('tjk,tj->jk', rows, residual)

    @property
    def body(self) -> Array:
        """The numbers of the body that explains most, shape (10,)."""
        return np.asarray(np.linalg.solve(self.information, self._targets.sum(axis=0)))

    @property
    def covariance(self) -> Array:
        """Their covariance with what remains as noise, shape (10, 10)."""
        return np.asarray(max(self._left, 1.0) * np.linalg.inv(self.information))

    @property
    def information(self) -> Array:
        """The inverse of their covariance with the noise alone, shape (10, 10)."""
        return np.asarray(self._informations.sum(axis=0) + np.diag(PRIOR_STD**-2.0))

    @property
    def _left(self) -> float:
        """Mean square of what remains, in that of the noise."""
        count = max(self._counts.sum() - BODY, 1)
        return float((self._squares.sum() - self._explained) / count)

    @property
    def _explained(self) -> float:
        return float(self._targets.sum(axis=0) @ self.body)

    @property
    def left_of_joints(self) -> Array:
        """Mean squares of what remains at each joint, in those of the noise, shape (n,)."""
        body = self.body
        fitted = 2.0 * self._targets @ body - self._informations @ body @ body
        return np.asarray((self._squares - fitted) / np.maximum(self._counts, 1))

    def mean_square(self, body: Array) -> float:
        """Return the mean square of the torques of a body, in that of the noise."""
        seen = self._informations.sum(axis=0)
        return float(body @ seen @ body) / max(self._counts.sum(), 1)

    @property
    def is_payload(self) -> bool:
        """Whether a body explains the torques, surely and wholly."""
        explained = self._explained
        most = CONSISTENT + self.unsure * explained / max(self._counts.sum(), 1)
        return bool(explained > 2.0 * SURE and self._left < most)

    @property
    def is_long_enough(self) -> bool:
        """Whether there is enough motion to find a payload."""
        return self.seconds >= LEAST_S and bool(self._counts.sum() > BODY)

    @property
    def is_settled(self) -> bool:
        """Whether the payload is known."""
        return self.seconds >= SETTLED_S


def payload_of(body: Array, covariance: Array) -> Payload:
    """Return mass and centre of a body with their deviations (first order)."""
    mass, std = float(body[0]), np.sqrt(np.diagonal(covariance))
    if abs(mass) < std[0]:
        return Payload(mass, float(std[0]), np.full(3, np.nan), np.full(3, np.nan))
    centre = body[1:4] / mass
    slopes = np.column_stack([-centre, np.eye(3)]) / mass
    spread = slopes @ covariance[:4, :4] @ slopes.T
    return Payload(mass, float(std[0]), centre, np.sqrt(np.diagonal(spread)))
