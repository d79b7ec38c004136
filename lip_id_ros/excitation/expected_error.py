"""
Expected error of torques on target motions, after a motion has been learned from.

Torques are linear in small changes of the coordinates of an arm, whose covariance before
the motion is S S^T. With Jacobian J of the torques at its states and noise of standard
deviation s, it is S A^-1 S^T after it, where A = I + sum (J S)^T s^-2 (J S). The expected squared
error of a torque at a target state is a row of its Jacobian times that (V-optimality: Atkinson,
Donev and Tobias, Optimum Experimental Designs, 2007, section 10.6).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from lip_id_ros.arrays import Array

States = tuple[Array, Array, Array]
"""q, dq and ddq, each (N, n)."""


class Learner(Protocol):
    """An arm as it is known before a motion, with p coordinates."""

    @property
    def root(self) -> Array:
        """Root S of the covariance of the coordinates, shape (p, r)."""

    @property
    def noise(self) -> Array:
        """Standard deviations of measured torques, shape (n,) [N m or N]."""

    def jacobian(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the torques by the coordinates, shape (N, n, p)."""

    def pullback(self, weights: Array, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the sum of weights (N, n, p) times the Jacobian, shape (3, N, n)."""


class ExpectedError:
    """
    Criterion of a motion: mean over joints of the log of the share of variance not known after it.

    `targets`: states at which torques will be wanted. `measurements`: number of states in the
    motion at which torques are measured independently.
    """

    def __init__(
        self, learner: Learner, targets: States, measurements: float, n_samples: int
    ) -> None:
        self._learner, self.n_samples = learner, n_samples
        self._each = measurements / n_samples
        rows = learner.jacobian(*targets) @ learner.root
        moments = np.einsum('tjr,tjs->jrs', rows, rows) / len(rows)
        before = np.trace(moments, axis1=1, axis2=2)[:, None, None]
        self._moments = moments / np.where(before > 0.0, before, 1.0)

    def shares(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the share of each joint's variance that is left after a motion, shape (n,)."""
        inverse = self._covariance(_rows(self._learner, q, dq, ddq))
        return np.asarray(np.einsum('jrs,rs->j', self._moments, inverse))

    def __call__(self, q: Array, dq: Array, ddq: Array) -> tuple[float, Array]:
        """Return the criterion and its gradient by q, dq and ddq, shape (3, N, n)."""
        rows = _rows(self._learner, q, dq, ddq)
        inverse = self._covariance(rows)
        shares = np.einsum('jrs,rs->j', self._moments, inverse)
        n = len(shares)
        weighted = np.einsum('jrs,j->rs', self._moments, 1.0 / shares) / n
        by_rows = -2.0 * self._each * rows @ (inverse @ weighted @ inverse)
        weights = by_rows @ self._learner.root.T / self._learner.noise[:, None]
        value = float(np.mean(np.log(shares)))
        return value, self._learner.pullback(weights, q, dq, ddq)

    def root_after(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return a root of the covariance of the coordinates after a motion, shape (p, r)."""
        lower, _ = _factor(_rows(self._learner, q, dq, ddq), self._each)
        return np.asarray(solve_triangular(np.tril(lower), self._learner.root.T, lower=True).T)

    def _covariance(self, rows: Array) -> Array:
        """Return A^-1, shape (r, r)."""
        return np.asarray(cho_solve(_factor(rows, self._each), np.eye(rows.shape[2])))


def _rows(learner: Learner, q: Array, dq: Array, ddq: Array) -> Array:
    """Return J S in standard deviations of the noise, shape (N, n, r)."""
    return np.asarray(learner.jacobian(q, dq, ddq) @ learner.root / learner.noise[:, None])


def _factor(rows: Array, each: float) -> tuple[Array, bool]:
    """Return the Cholesky factor of A where every state is measured so many times."""
    flat = rows.reshape(-1, rows.shape[2])
    lower, is_lower = cho_factor(np.eye(flat.shape[1]) + each * flat.T @ flat, lower=True)
    return np.asarray(lower), bool(is_lower)


class Information:
    """Criterion of a motion: minus the mean log eigenvalue of A (D-optimality)."""

    def __init__(self, learner: Learner, measurements: float, n_samples: int) -> None:
        self._learner, self.n_samples = learner, n_samples
        self._each = measurements / n_samples

    def __call__(self, q: Array, dq: Array, ddq: Array) -> tuple[float, Array]:
        """Return the criterion and its gradient by q, dq and ddq, shape (3, N, n)."""
        rows = _rows(self._learner, q, dq, ddq)
        factor = _factor(rows, self._each)
        size = rows.shape[2]
        value = -2.0 * float(np.sum(np.log(np.diagonal(factor[0])))) / size
        by_rows = -2.0 * self._each / size * rows @ cho_solve(factor, np.eye(size))
        weights = by_rows @ self._learner.root.T / self._learner.noise[:, None]
        return value, self._learner.pullback(weights, q, dq, ddq)


class MeanCriterion:
    """The mean of criteria, as over arms that an unknown one may be."""

    def __init__(self, criteria: Sequence[ExpectedError]) -> None:
        self._criteria = tuple(criteria)
        self.n_samples = max(each.n_samples for each in criteria)

    def __call__(self, q: Array, dq: Array, ddq: Array) -> tuple[float, Array]:
        """Return the mean and its gradient by q, dq and ddq, shape (3, N, n)."""
        found = [each(q, dq, ddq) for each in self._criteria]
        values, gradients = zip(*found, strict=True)
        return float(np.mean(values)), np.mean(gradients, axis=0)
