"""Fourier series that start and end at rest at a posture (docs/reference/excitation.md)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from lip_id_ros.arrays import Array

LEAST_HARMONICS = 2
"""With fewer, no series of them starts at rest."""


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
