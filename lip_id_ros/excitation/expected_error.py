"""
Expected error of torques on target motions, after a motion has been learned from.

Torques are linear in small changes of the coordinates of an arm, whose covariance before
the motion is S S^T. With Jacobian J of the torques at its states and noise of standard
deviation s, it is S A^-1 S^T after it, where A = I + sum (J S)^T s^-2 (J S). The expected squared
error of a torque at a target state is a row of its Jacobian times that (V-optimality: Atkinson,
Donev and Tobias, Optimum Experimental Designs, 2007, section 10.6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from lip_id_ros.arrays import Array

States = tuple[Array, Array, Array]
"""q, dq and ddq, each (N, n)."""


@dataclass(frozen=True, eq=False)
class Learner:
    """
    An arm as it is known before a motion, with p coordinates.

    `root`, shape (p, r): root S of their covariance. `noise`, shape (n,): standard deviations of
    measured torques [N m or N]. `jacobian`: of the torques at q, dq and ddq, shape (N, n, p).
    """

    root: Array
    noise: Array
    jacobian: Callable[[Array, Array, Array], Array]

    def rows(self, states: States) -> Array:
        """Return J S in standard deviations of the noise, shape (N, n, r)."""
        return np.asarray(self.jacobian(*states) @ self.root / self.noise[:, None])


class ExpectedError:
    """
    Criterion of a motion: mean over joints of the log of the share of variance not known after it.

    `targets`: states at which torques will be wanted. `measurements`: number of states in the
    motion at which torques are measured independently.
    """

    def __init__(self, learner: Learner, targets: States, measurements: float) -> None:
        self._learner, self._measurements = learner, measurements
        rows = learner.jacobian(*targets) @ learner.root
        moments = np.einsum('tjr,tjs->jrs', rows, rows) / len(rows)
        before = np.trace(moments, axis1=1, axis2=2)[:, None, None]
        self._moments = moments / np.where(before > 0.0, before, 1.0)

    def __call__(self, states: States) -> float:
        """Return the criterion; smaller is better."""
        return float(np.mean(np.log(self.shares(states))))

    def shares(self, states: States) -> Array:
        """Return the share of each joint's variance that is left after a motion, shape (n,)."""
        factor = self._factor(states)
        covariance = cho_solve(factor, np.eye(len(factor[0])))
        return np.asarray(np.einsum('jrs,rs->j', self._moments, covariance))

    def root_after(self, states: States) -> Array:
        """Return a root of the covariance of the coordinates after a motion, shape (p, r)."""
        lower, _ = self._factor(states)
        return np.asarray(solve_triangular(np.tril(lower), self._learner.root.T, lower=True).T)

    def _factor(self, states: States) -> tuple[Array, bool]:
        """Return the Cholesky factor of A; evenly spaced states stand for all measurements."""
        rows = self._learner.rows(states)
        flat = rows.reshape(-1, rows.shape[2])
        each = self._measurements / len(rows)
        lower, is_lower = cho_factor(np.eye(flat.shape[1]) + each * flat.T @ flat, lower=True)
        return np.asarray(lower), bool(is_lower)
