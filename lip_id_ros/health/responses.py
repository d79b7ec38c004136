"""
Efforts that answer to the wrong joint, or with the wrong sign.

The inertia matrix is symmetric and positive definite, and friction brakes its own joint. So the
mean responses of all efforts to all accelerations, and to all velocities, are matrices with
positive diagonals, whose pairs of off-diagonal elements are smaller than those of the diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass
import math

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.motion import (
    effort_segments,
    LEAST_VARIATION,
    SAMPLES_PER_SECOND,
    shifted,
    SIGN_WIDTH,
    SmoothMotion,
)

RIDGE = 1e-4
"""Of terms with a mean square of 1, since joints may move in step."""


@dataclass(frozen=True, eq=False)
class Responses:
    """Mean responses (n, n) of efforts (rows) to a signal of all joints, with standard errors."""

    value: Array
    error: Array

    @property
    def own(self) -> Array:
        """Return the responses to the own joint in standard errors, shape (n,)."""
        own: Array = np.diag(self.value) / np.diag(self.error)
        return own

    @property
    def crossed(self) -> Array:
        """
        Return in standard errors by how much pairs answer rather to each other, (n, n).

        Negative where they answer rather to their own motion.
        """
        value, error, own = self.value, self.error, np.diag(self.value)
        excess = value * value.T - np.outer(own, own)
        across, along = value * error.T, np.outer(own, np.diag(self.error))
        deviation = np.sqrt(across**2 + across.T**2 + along**2 + along.T**2)
        each, rather = value / error, np.nan_to_num(excess / deviation)
        both = np.maximum(np.nan_to_num(np.minimum(each, each.T)), 0.0)
        return np.asarray(np.minimum(both, rather))


def responses(motion: SmoothMotion, lag_s: float) -> tuple[Responses, Responses]:
    """
    Regress all efforts on accelerations, velocities, and sines and cosines of positions.

    `motion` is long enough for `motion.effort_regression`; efforts come late by `lag_s`, 0 where
    it is not finite. Returns responses to accelerations [N m s^2], and mean friction along the
    velocity.
    """
    segments, reach = effort_segments(motion)
    lag = round(lag_s * motion.rate_hz) if math.isfinite(lag_s) else 0
    names = ('position', 'velocity', 'acceleration')
    position, velocity, acceleration = (shifted(segments, name, reach, 0) for name in names)
    effort = shifted(segments, 'effort', reach, lag)
    n = effort.shape[1]
    speed = _size(velocity)
    sign = np.tanh(velocity / (SIGN_WIDTH * speed))
    terms = np.hstack([acceleration, velocity, sign, np.sin(position), np.cos(position)])
    terms = terms - terms.mean(axis=0)
    size = _size(terms)
    terms /= size
    inverse = np.linalg.inv(terms.T @ terms / len(terms) + RIDGE * np.eye(terms.shape[1]))
    effort = effort - effort.mean(axis=0)
    weights = inverse @ (terms.T @ effort) / len(terms)
    variance = np.var(effort - terms @ weights, axis=0)
    free = len(terms) / motion.rate_hz * min(SAMPLES_PER_SECOND, motion.rate_hz) - len(inverse)
    error = np.sqrt(np.outer(variance / max(free, 1.0), np.diag(inverse)))
    along = (velocity / speed)[:, np.newaxis] * _pairs(terms, n)
    friction = np.einsum('sk,isk->ik', along.mean(axis=0), _pairs(weights.T, n))
    worst = np.maximum(error[:, n : 2 * n], error[:, 2 * n : 3 * n])
    inertia = Responses(weights[:n].T / size[:n], error[:, :n] / size[:n])
    return inertia, Responses(friction, worst)


def _pairs(columns: Array, n: int) -> Array:
    """Return the columns (., m) of velocity and sign of each joint, shape (., 2, n)."""
    return columns[:, n : 3 * n].reshape(-1, 2, n)


def _size(terms: Array) -> Array:
    return np.maximum(np.sqrt(np.mean(np.square(terms), axis=0)), LEAST_VARIATION)
