"""
Fourier series that start and end at rest at a posture, as large as limits allow at every time.

docs/reference/excitation.md has them. A trigonometric polynomial u of degree H that is largest at
t* has |u(t)| >= max |u| cos(H w (t - t*)) near it (M. Riesz 1914). So no value between N
equidistant samples of a period exceeds the largest sample by more than a factor of 1 / cos(pi H /
N).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.joint_limits import JointLimits


@dataclass(frozen=True, eq=False)
class FourierMotion:
    """
    Joint positions q(t) = posture + sum_k a_k (cos k w t - 1) + b_k sin k w t.

    `posture`, shape (n,) [rad or m]. `coefficients`, shape (n, 2 H): a, then b [rad or m].
    `duration`: 2 pi / w [s], after which the motion is at the posture again.
    """

    posture: Array
    coefficients: Array
    duration: float

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.posture)

    @property
    def harmonics(self) -> int:
        """Number H of harmonics."""
        return int(self.coefficients.shape[1]) // 2

    def derivative(self, t: Array, order: int) -> Array:
        """Return a derivative of q by time, order 0 for q itself, at times (N,) [s], (N, n)."""
        moved = basis(t, self.duration, self.harmonics, order) @ self.coefficients.T
        return moved + self.posture if order == 0 else moved

    def sample(self, t: Array) -> tuple[Array, Array, Array]:
        """Return q, dq and ddq at times (N,) [s], each (N, n)."""
        return self.derivative(t, 0), self.derivative(t, 1), self.derivative(t, 2)

    def times(self, rate: float) -> Array:
        """Return times [s] from the start to the end, at about so many a second."""
        return np.linspace(0.0, self.duration, max(2, round(self.duration * rate) + 1))

    @property
    def fine_times(self) -> Array:
        """Times [s] between whose values none is larger by more than 0.03 %."""
        return np.linspace(0.0, self.duration, SAMPLES_PER_HARMONIC * self.harmonics + 1)

    def scaled(self, factor: float | Array) -> FourierMotion:
        """Return a motion whose joints go so many times as far, by a number or (n,)."""
        factors = np.broadcast_to(factor, self.posture.shape)
        return FourierMotion(self.posture, factors[:, None] * self.coefficients, self.duration)


def evenly(duration: float, count: int) -> Array:
    """Return so many times from zero on [s], evenly spaced over a period."""
    return np.linspace(0.0, duration, count, endpoint=False)


def basis(t: Array, duration: float, harmonics: int, order: int) -> Array:
    """Differentiate cos k w t - 1 and sin k w t at times (N,) [s], shape (N, 2 H)."""
    rates = 2.0 * np.pi / duration * np.arange(1, harmonics + 1)
    angles = np.multiply.outer(np.asarray(t, dtype=np.float64), rates) + 0.5 * np.pi * order
    out = np.concatenate([np.cos(angles), np.sin(angles)], axis=-1) * np.tile(rates**order, 2)
    if order == 0:
        out[..., :harmonics] -= 1.0
    return out


def at_rest(harmonics: int) -> Array:
    """
    Return orthonormal shapes (2 H, 2 H - 2) that start with zero velocity and acceleration.

    Velocity is zero where sum k b_k is, acceleration where sum k^2 a_k is.
    """
    k = np.arange(1.0, harmonics + 1.0)
    nothing = np.zeros(harmonics)
    return np.asarray(null_space([np.append(nothing, k), np.append(k**2, nothing)]))


SAMPLES_PER_HARMONIC = 128
"""The bound between samples exceeds the largest of them by 0.03 %."""

ROUNDING = 1e-12
ORDERS = 4
"""Positions, velocities, accelerations, jerks."""


class LimitedMotions:
    """
    Motions within limits, of any numbers x, shape (n, 2 H - 2).

    The series of each joint is scaled until the first of its limits is touched.
    """

    def __init__(
        self, limits: JointLimits, posture: Array, duration: float, harmonics: int
    ) -> None:
        limits.require_posture(posture)
        count = SAMPLES_PER_HARMONIC * harmonics
        times = evenly(duration, count)
        bases = [basis(times, duration, harmonics, order) for order in range(ORDERS)]
        self._basis = np.concatenate(bases)
        self._free = at_rest(harmonics)
        self._posture, self._duration = posture, duration
        share = np.cos(np.pi * harmonics / count) * (1.0 - ROUNDING)
        middle, half = 0.5 * (limits.lower + limits.upper), 0.5 * (limits.upper - limits.lower)
        derivatives = [share * each for each in limits.derivatives]
        self._above, self._below = (
            np.maximum(
                np.array([share * half + sign * (middle - posture), *derivatives]),
                0.0,
            ).repeat(count, axis=0)
            for sign in (1.0, -1.0)
        )

    def random(self, rng: np.random.Generator) -> FourierMotion:
        """Draw a motion without a preferred direction, as large as the limits allow."""
        # one number more is drawn than is used: docs/reference/excitation.md has these seeds
        return self.motion(rng.standard_normal((len(self._posture), self.free + 1))[:, :-1])

    @property
    def free(self) -> int:
        """Free numbers of each joint."""
        return int(self._free.shape[1])

    def motion(self, x: Array) -> FourierMotion:
        """Return the motion of x; a joint whose numbers are zero stays at its posture."""
        shapes = x @ self._free.T
        values = self._basis @ shapes.T
        need = np.where(values >= 0.0, 1.0 / self._above, -1.0 / self._below) * values
        largest = need.max(axis=0)
        scale = np.where(largest > 0.0, 1.0 / np.where(largest > 0.0, largest, 1.0), 0.0)
        return FourierMotion(self._posture, scale[:, None] * shapes, self._duration)


def peaks(motion: FourierMotion) -> Array:
    """Return bounds of |q - posture|, |dq|, |ddq| and |dddq| at every time, shape (4, n)."""
    count = SAMPLES_PER_HARMONIC * motion.harmonics
    times = evenly(motion.duration, count)
    found = [np.abs(motion.derivative(times, order)).max(axis=0) for order in range(1, ORDERS)]
    away = np.abs(motion.derivative(times, 0) - motion.posture).max(axis=0)
    return np.asarray(np.array([away, *found]) / np.cos(np.pi * motion.harmonics / count))
