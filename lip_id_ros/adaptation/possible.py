"""The nearest arm that can exist: links with mass and inertia, friction that never drives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.identification.levenberg_marquardt import minimise
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import (
    link_parameter_jacobian,
    link_parameters,
    LinkScale,
    log_cholesky,
    moved,
    pseudo_inertia,
)

EXISTS = 1e-3
"""Least share of a link's inertia in any direction with which it begins to be looked for."""

TOLERANCE, EVALUATIONS = 1e-4, 30

WEAK = 1e-3
"""Precision that keeps numbers which change no torque where they are."""


def scale_of_links(links: Array) -> LinkScale:
    """Return the scale in which the log-Cholesky numbers of links (n, 11) are zero."""
    factors = np.linalg.cholesky(pseudo_inertia(links))
    return LinkScale(factors, np.maximum(links[:, -1], np.finfo(np.float64).tiny))


def can_exist(links: Array) -> bool:
    """Return whether bodies can have the parameters (n, 11)."""
    return bool(
        (links[:, -1] > 0.0).all() and (np.linalg.eigvalsh(pseudo_inertia(links)) > 0).all()
    )


@dataclass(frozen=True, eq=False)
class _Point:
    """`numbers`, shape (n, 11), of links, `cost`, and `residual` of the torques, shape (M,)."""

    numbers: Array
    cost: float
    residual: Array


class NearestLinks:
    """
    The links that can exist whose torques are nearest, for `minimise`.

    `links`, shape (n, 11): any parameters. `slopes`, shape (M, 11 n): of torques by them, in
    deviations with which these are known. `scale`: of links that can exist.

    """

    def __init__(self, links: Array, slopes: Array, scale: LinkScale) -> None:
        self._links, self._slopes, self._scale = links, slopes, scale

    def found(self) -> Array:
        """Return the parameters of the links, shape (n, 11)."""
        start = self._at(log_cholesky(self._links, self._scale, EXISTS))
        best = minimise(self, start, EVALUATIONS, TOLERANCE)
        return link_parameters(best.numbers, self._scale)

    def normal_equations(self, point: _Point) -> tuple[Array, Array]:
        """Return J^T J and the gradient of steps of the numbers."""
        by_numbers = link_parameter_jacobian(point.numbers, self._scale)
        jacobian = np.empty_like(self._slopes)
        for j, each in enumerate(by_numbers):
            own = slice(LINK_PARAMETERS * j, LINK_PARAMETERS * (j + 1))
            jacobian[:, own] = self._slopes[:, own] @ each
        hessian = jacobian.T @ jacobian
        hessian.flat[:: len(hessian) + 1] += WEAK
        return hessian, jacobian.T @ point.residual + WEAK * point.numbers.ravel()

    def stepped(self, point: _Point, step: Array) -> _Point:
        """Return the point that a step leads to."""
        return self._at(moved(point.numbers, step.reshape(point.numbers.shape)))

    def _at(self, numbers: Array) -> _Point:
        with np.errstate(over='ignore', invalid='ignore'):
            change = link_parameters(numbers, self._scale) - self._links
            residual = self._slopes @ change.ravel()
            cost = 0.5 * float(residual @ residual + WEAK * np.sum(numbers**2))
        return _Point(numbers, cost if np.isfinite(cost) else np.inf, residual)
