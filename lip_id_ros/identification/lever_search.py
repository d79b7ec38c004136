"""
The shape of a spring between two points that explains most of a joint's torque.

On a grid and by descents from its best places, links and friction solved for at each (variable
projection: Golub and Pereyra, SIAM J. Numerical Analysis 1973).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
import math

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.friction.conservative_terms import ECCENTRICITIES, lever_spring
from lip_id_ros.friction.terms import Term
from lip_id_ros.linear_algebra import normal_factor

TRIED = (12, 36)
"""Eccentricities and dead centres of the grid."""

DESCENTS, EVALUATIONS = 3, 200
"""Places of the grid that descents start from, and most evaluations of one."""

APART = 2
"""Least distance of these places on the grid."""

ROUNDS, SAME, LEAST_NOISE = 10, 0.95, 1e-5
"""
Rounds with noise estimated anew, at most and while it falls to this share; and the least noise,
as a share of the torque's deviation.
"""

NEGLIGIBLE = 1e-14
"""Squares of what features share, in the largest, that count for nothing."""

PRECISION = 1e-9
"""Of eccentricities, as logits, and of dead centres at the end of a descent [rad]."""


@dataclass(frozen=True, eq=False)
class Explained:
    """Torques that are explained by links and friction, linear in P parameters."""

    rows: list[Array]  # (N, p_i) of every joint
    columns: Sequence[IndexArray]  # parameters (p_i,) of every joint
    tau: Array  # (N, n) [N m or N]
    weights: Array  # (N, n), of squared residuals
    noise_std: Array  # (n,) [N m or N]
    prior_std: Array  # (P,)


def best_lever(explained: Explained, joint: int, q: Array) -> Term:
    """
    Return the spring that explains most of the torque of a joint at positions (N,) [rad].

    In rounds with the noise that the spring of the round before leaves: with that of a fit without
    one, priors would decide.
    """
    least = LEAST_NOISE * float(np.std(explained.tau[:, joint]))
    search = LeverSearch(explained, joint, q)
    lever = search.best()
    for _ in range(ROUNDS):
        before, left = float(explained.noise_std[joint]), max(search.left(lever), least)
        if left > SAME * before:
            break
        noise = explained.noise_std.copy()
        noise[joint] = left
        explained = replace(explained, noise_std=noise)
        search = LeverSearch(explained, joint, q)
        lever = search.best()
    return lever


class LeverSearch:
    """One round of the search for a joint, with given noise (see `best_lever`)."""

    def __init__(self, explained: Explained, joint: int, q: Array) -> None:
        precision = np.sqrt(explained.weights) / explained.noise_std
        scaled = [rows * precision[:, [j]] for j, rows in enumerate(explained.rows)]
        torque = explained.tau * precision
        normal, right = np.diag(explained.prior_std**-2.0), np.zeros(explained.prior_std.size)
        for rows, column, own in zip(scaled, explained.columns, torque.T, strict=True):
            normal[column[:, None], column] += rows.T @ rows
            right[column] += rows.T @ own
        factor = normal_factor(normal)
        found = solve_triangular(factor, right, lower=True)
        found = solve_triangular(factor, found, lower=True, trans=1)
        column = explained.columns[joint]
        self._residual = torque[:, joint] - scaled[joint] @ found[column]
        self._precision = precision[:, joint]
        self._noise_std = float(explained.noise_std[joint])
        # what of a feature links and friction can stand for
        own = np.zeros((normal.shape[0], len(q)))
        own[column] = scaled[joint].T
        self._shared = _independent(solve_triangular(factor, own, lower=True))
        self._prior = len(q) * max(float(np.std(explained.tau[:, joint])), 1e-150) ** 2
        self._sine, self._cosine = np.sin(q), np.cos(q)

    def gain(self, eccentricity: float, dead_centre: float) -> float:
        """Return by how much a spring decreases half the penalised squares."""
        _, ((a, b), (_, c)), (x, y) = self._system(eccentricity, dead_centre)
        return float(0.5 * (c * x * x - 2.0 * b * x * y + a * y * y) / (a * c - b * b))

    def left(self, lever: Term) -> float:
        """Return the noise that a spring leaves, as a standard deviation [N m]."""
        rows, normal, right = self._system(**lever.parameters)
        torque = np.linalg.solve(normal, right) @ rows
        residual = self._residual - torque + self._shared.T @ (self._shared @ torque)
        count = np.sum((self._noise_std * self._precision) ** 2)
        return self._noise_std * float(np.sqrt(np.sum(residual**2) / count))

    def _system(self, eccentricity: float, dead_centre: float) -> tuple[Array, Array, Array]:
        """Return the rows of a spring, and normal equations with all else solved for."""
        features = self._features(eccentricity, dead_centre)
        rows = features * self._precision
        shared = rows @ self._shared.T
        normal = rows @ rows.T - shared @ shared.T
        normal.flat[::3] += np.einsum('kn,kn->k', features, features) / self._prior
        return rows, normal, rows @ self._residual

    def _features(self, eccentricity: float, dead_centre: float) -> Array:
        """Return features of `lever_spring`, shape (2, N), without trigonometric functions."""
        sine, cosine = math.sin(dead_centre), math.cos(dead_centre)
        out = np.empty((2, self._sine.size))
        np.subtract(cosine * self._sine, sine * self._cosine, out=out[1])
        length = 1.0 - eccentricity * (cosine * self._cosine + sine * self._sine)
        np.divide(out[1], np.sqrt(length), out=out[0])
        return out

    def best(self) -> Term:
        """Return the spring that explains most."""
        found = [self._descended(*start) for start in self._starts()]
        _, eccentricity, centre = max(found)
        turned = float((centre + np.pi) % (2.0 * np.pi) - np.pi)
        return lever_spring(float(eccentricity), turned)

    def _starts(self) -> Iterator[tuple[float, float]]:
        """Yield the best places of the grid that are apart."""
        eccentricities = _eccentricity(np.linspace(-1.0, 1.0, TRIED[0] + 2)[1:-1] * 3.0)
        centres = np.linspace(-np.pi, np.pi, TRIED[1], endpoint=False)
        gains = np.array([[self.gain(e, c) for c in centres] for e in eccentricities])
        for _ in range(DESCENTS):
            i, k = np.unravel_index(np.argmax(gains), gains.shape)
            yield float(eccentricities[i]), float(centres[k])
            around = (k + np.arange(-APART, APART + 1)) % centres.size
            gains[max(0, int(i) - APART) : int(i) + APART + 1, around] = -np.inf

    def _descended(self, eccentricity: float, dead_centre: float) -> tuple[float, float, float]:
        """Return the gain and the shape that a descent without slopes ends in."""
        first = np.array([_logit(eccentricity), dead_centre])
        result = minimize(
            lambda x: -self.gain(float(_eccentricity(x[0])), x[1]),
            first,
            method='Nelder-Mead',
            options={
                'maxfev': EVALUATIONS,
                'xatol': PRECISION,
                'fatol': 0.0,
                'initial_simplex': first + np.array([[0.0, 0.0], [0.3, 0.0], [0.0, 0.1]]),
            },
        )
        return -float(result.fun), float(_eccentricity(result.x[0])), float(result.x[1])


def _independent(rows: Array) -> Array:
    """Return orthogonal rows (r, N) of the same R^T R, without those that are rounding."""
    squares, turned = np.linalg.eigh(rows @ rows.T)
    return np.asarray(turned[:, squares > NEGLIGIBLE * squares[-1]].T @ rows)


def _eccentricity(logit: Array | float) -> Array:
    """Return eccentricities between the least and the most."""
    low, high = ECCENTRICITIES
    return np.asarray(low + (high - low) / (1.0 + np.exp(-np.asarray(logit))))


def _logit(eccentricity: float) -> float:
    low, high = ECCENTRICITIES
    return float(np.log((eccentricity - low) / (high - eccentricity)))
