"""
The links that can exist and explain torques best, at given placements: a convex problem.

Torques are linear in the parameters of links, and a link can exist where its pseudo-inertia is
positive definite (Wensing, Kim and Slotine 2018). A logarithmic barrier keeps it so while Newton's
method descends (Boyd and Vandenberghe, Convex Optimization, 2004, section 11.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import BODY, LinkScale, UNIT_INERTIAS

ITERATIONS, SHORTEST, ROUNDING = 2000, 1e-10, 1e-14
"""
Most Newton steps at a weight: nearly exact torques took hundreds, as the barrier cuts each short.
"""

BARRIERS = (1e4, 1e2, 1.0, 1e-2)
"""Weights of the barrier of a whole arm, in log likelihood, one after the other."""

CONVERGED = 1e-6
"""Gain that a step promises, in the weight of the barrier, where a descent ends."""


@dataclass(frozen=True, eq=False)
class BarrierProblem:
    """
    Minimise x^T H x / 2 - b^T x over bodies that can exist, and other parameters.

    The barrier is - log det J of each body and - log of each parameter that must be positive, plus
    `pull` x. With the slopes of these at a centre as pull it is least there: the log-determinant
    divergence (Lee, Wensing and Park, IEEE Transactions on Robotics 2020).
    """

    hessian: Array  # (m, m)
    right: Array  # (m,)
    bodies: IndexArray  # (n, 10), where their parameters are
    units: Array  # (n, 10, 4, 4), pseudo-inertias of unit parameters, in any scale
    positive: BoolArray  # (m,), those that must be positive
    pull: Array  # (m,)

    @classmethod
    def of_body(cls, hessian: Array, right: Array) -> BarrierProblem:
        """Return the problem of one body, with H (10, 10) and b (10,), that is pulled nowhere."""
        none = np.zeros(BODY, dtype=np.bool_)
        return cls(
            hessian, right, np.arange(BODY)[None], UNIT_INERTIAS[None], none, np.zeros(BODY)
        )

    @classmethod
    def of_arm(
        cls, hessian: Array, right: Array, scale: LinkScale, friction: tuple[Array, BoolArray]
    ) -> BarrierProblem:
        """
        Return the problem of links (n, 11), then friction (k,), pulled to their usual size.

        `scale` has usual links, `friction` usual coefficients and which of them must be positive.
        """
        size, positive = friction
        n = (right.size - size.size) // LINK_PARAMETERS
        bodies = LINK_PARAMETERS * np.arange(n)[:, None] + np.arange(BODY)
        inverse = np.linalg.inv(scale.factors)[:, None]
        units = np.broadcast_to(
            inverse @ UNIT_INERTIAS @ np.swapaxes(inverse, 2, 3), (n, BODY, 4, 4)
        )
        must, pull = np.zeros(right.size, dtype=np.bool_), np.zeros(right.size)
        must[bodies[:, -1] + 1] = True
        must[right.size - size.size :] = positive
        pull[bodies] = np.trace(units, axis1=2, axis2=3)
        pull[must] = 1.0 / np.append(np.broadcast_to(scale.rotors, n), size[positive])
        return cls(hessian, right, bodies, units, must, pull)

    @property
    def usual(self) -> Array:
        """Parameters where the barrier with its pull is least, others zero: a start, (m,)."""
        out = np.zeros(self.right.size)
        out[self.positive] = 1.0 / self.pull[self.positive]
        values = np.tile(np.eye(4), (len(self.bodies), 1, 1))
        flat = self.units.reshape(*self.units.shape[:2], 16)
        for own, units, value in zip(self.bodies, flat, values.reshape(-1, 16), strict=True):
            out[own] = np.linalg.lstsq(units.T, value, rcond=None)[0]
        return out

    def minimised(self, at: Array, barriers: tuple[float, ...]) -> Array:
        """Descend from parameters (m,) that can be, with ever smaller weights of the barrier."""
        for barrier in barriers:
            at = self._descended(at, barrier)
        return at

    def _descended(self, at: Array, barrier: float) -> Array:
        for _ in range(ITERATIONS):
            gradient, hessian = self._slopes(at, barrier)
            step = _newton_step(hessian, gradient)
            decrease = float(-gradient @ step)
            if decrease < CONVERGED * barrier:
                break
            at = at + self._length(at, step, decrease, barrier) * step
        return at

    def _slopes(self, at: Array, barrier: float) -> tuple[Array, Array]:
        """Return the gradient and Hessian of the cost with the barrier."""
        gradient = self.hessian @ at - self.right + barrier * self.pull
        hessian = self.hessian.copy()
        inverse = np.linalg.inv(np.linalg.cholesky(self._inertias(at)))
        inner = (np.swapaxes(inverse, 1, 2) @ inverse)[:, None] @ self.units
        gradient[self.bodies] -= barrier * np.trace(inner, axis1=2, axis2=3)
        curvature = np.einsum('nkab,nlba->nkl', inner, inner)
        hessian[self.bodies[:, :, None], self.bodies[:, None]] += barrier * curvature
        must = np.flatnonzero(self.positive)
        gradient[must] -= barrier / at[must]
        hessian[must, must] += barrier / at[must] ** 2
        return gradient, hessian

    def _inertias(self, at: Array) -> Array:
        return np.asarray(np.einsum('nk,nkab->nab', at[self.bodies], self.units))

    def _length(self, at: Array, step: Array, decrease: float, barrier: float) -> float:
        """Halve a step until it stays inside and gains what its slope promises."""
        value, length = self._value(at, barrier), 1.0
        while length > SHORTEST:
            if self._value(at + length * step, barrier) <= value - 0.1 * length * decrease:
                return length
            length *= 0.5
        return 0.0

    def _value(self, at: Array, barrier: float) -> float:
        if not (at[self.positive] > 0.0).all():
            return np.inf
        try:
            factors = np.linalg.cholesky(self._inertias(at))
        except np.linalg.LinAlgError:
            return np.inf
        logarithms = 2.0 * np.log(np.diagonal(factors, axis1=1, axis2=2)).sum()
        logarithms += np.log(at[self.positive]).sum()
        cost = at @ (0.5 * self.hessian @ at - self.right)
        return float(cost + barrier * (self.pull @ at - logarithms))


def _newton_step(hessian: Array, gradient: Array) -> Array:
    """Solve in units of the diagonal, with as much of it added as rounding takes away."""
    scale = np.sqrt(np.diagonal(hessian))
    scaled = hessian / np.multiply.outer(scale, scale) + ROUNDING * np.eye(len(hessian))
    return np.asarray(-np.linalg.solve(scaled, gradient / scale) / scale)
