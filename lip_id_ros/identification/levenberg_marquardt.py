"""Nonlinear least squares on manifolds by the method of Levenberg and Marquardt."""

from __future__ import annotations

from typing import Protocol, TypeVar

import numpy as np
from scipy.linalg import lapack

from lip_id_ros.arrays import Array

FIRST_DAMPING, LEAST_DAMPING, MOST_DAMPING = 1e-2, 1e-9, 1e6
FLOOR = 1e-3
"""Damping of directions that change nothing, as a share of that of the steepest one."""


class Evaluation(Protocol):
    """A point together with its cost."""

    @property
    def cost(self) -> float:
        """Half the sum of squares."""


Point = TypeVar('Point', bound=Evaluation)


class Problem(Protocol[Point]):
    """Half a sum of squares over points of a manifold."""

    def normal_equations(self, point: Point) -> tuple[Array, Array]:
        """Return J^T J, shape (m, m), and the gradient J^T r, shape (m,), of steps at a point."""

    def stepped(self, point: Point, step: Array) -> Point:
        """Return the point that a step, shape (m,), leads to; of infinite cost beyond numbers."""


def minimise(problem: Problem[Point], start: Point, evaluations: int, tolerance: float) -> Point:
    """
    Descend to the best point until steps gain less than a share `tolerance` of the cost.

    A step to a point whose cost or Jacobian is not finite is refused, and damping rises.
    """
    at, damping, left = start, FIRST_DAMPING, evaluations - 1
    safe: tuple[Point, Array, Array, float] | None = None
    while left > 0:
        hessian, gradient = problem.normal_equations(at)
        if not (np.isfinite(hessian).all() and np.isfinite(gradient).all()):
            if safe is None:
                return at
            at, hessian, gradient, damping = safe
        diagonal = np.diagonal(hessian)
        scale = np.maximum(diagonal, FLOOR * diagonal.max())
        before = at.cost
        while left > 0 and damping < MOST_DAMPING:
            step = _solved(hessian, damping * scale, -gradient)
            expected = -float(gradient @ step + 0.5 * step @ hessian @ step)
            if expected <= 0.01 * tolerance * before:
                return at
            tried, left = problem.stepped(at, step), left - 1
            if tried.cost < before:
                safe = at, hessian, gradient, 4.0 * damping
                damping = _relaxed(damping, (before - tried.cost) / expected)
                at = tried
                break
            damping *= 4.0
        if before - at.cost <= tolerance * before:
            return at
    return at


def _relaxed(damping: float, ratio: float) -> float:
    """Return the damping after a step that gained `ratio` of what was expected."""
    factor = 0.2 if ratio > 0.75 else 0.5 if ratio > 0.25 else 2.0
    return max(factor * damping, LEAST_DAMPING)


def _solved(hessian: Array, damping: Array, right: Array) -> Array:
    matrix = np.array(hessian, order='F')
    matrix.flat[:: len(matrix) + 1] += damping
    _, step, info = lapack.dposv(matrix, right, lower=1, overwrite_a=1)
    return np.asarray(step) if info == 0 else np.zeros_like(right)
