"""
An arm whose links can exist from the triangular system of all torques: a convex problem.

Parameters are coefficients of friction, steps of placements and links. The barrier of its last
weight stays as a prior: links are pulled to usual ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from lip_id_ros.arrays import Array
from lip_id_ros.friction.terms import lag
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.possible_links import BarrierProblem, BARRIERS
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.statistics import triangular
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.pseudo_inertia import (
    link_parameter_jacobian,
    link_parameters,
    log_cholesky,
)

NEAR = 0.02
"""
Deviation of steps of placements [rad, m]: a linearisation holds no farther. Where links can make
up for a step, their prior would move it as far as it likes.
"""

EXISTS = 1e-12
"""Least scaled eigenvalue of links that exist already."""

LEAST_SHAPE = 1e-9
"""Least prior deviation of the coefficient of a shape, in those of other coefficients."""


@dataclass(frozen=True, eq=False)
class SystemState:
    """Parameters of an arm."""

    friction: Array  # (K,), coefficients
    placements: Array  # (r,), steps that keep the geometry
    numbers: Array  # (n, 11), log-Cholesky numbers of the links


class ArmSystem:
    """
    Least squares.

    The system, shape (m, K + W + 17 n + 1), has rows of features and torque in units of the noise.
    `friction_std`, shape (K,), are prior deviations around zero; `inflation` is of the noise's
    variance, since residuals are correlated.
    """

    def __init__(
        self,
        around: Linearisation,
        system: Array,
        prior: ArmPrior,
        geometry: Geometry,
        friction_std: Array,
        inflation: float = 1.0,
    ) -> None:
        self._prior = prior = prior.beside(inflation)
        self._usual = 1.0 / np.sqrt(inflation)
        self._around, self._system, self._scale = around, system, prior.scale
        self._positive, self._friction_std = around.friction.basis.is_positive, friction_std
        self._shapes = around.basis.size - around.n_friction
        count = around.n_placements
        self._allowed = _range_of(geometry.projector(around.chain))
        self._away = prior.deviation(around.chain, np.zeros_like(around.links))[:count]
        self._of_placements, self._of_links = prior.precision[:count], prior.precision[count:]

    def start(self) -> SystemState:
        """Return the state of the present parameters."""
        links = log_cholesky(self._around.links, self._scale, EXISTS)
        none = np.zeros(self._allowed.shape[1])
        return SystemState(self._around.friction.coefficients, none, links)

    def at(self, step: Array, state: SystemState) -> SystemState:
        """Return a state with the parameters of one that has other placements free."""
        return replace(state, placements=self._allowed.T @ step)

    def solved(self) -> SystemState:
        """Return the most likely state; the prior of described links is quadratic."""
        hessian, right = self._quadratic()
        size = np.append(self._friction_std, np.ones(self._allowed.shape[1]))
        positive = np.pad(self._positive, (0, self._allowed.shape[1]))
        problem = BarrierProblem.of_arm(hessian, right, self._scale, (size, positive))
        links, rest = np.split(
            problem.minimised(problem.usual, BARRIERS), [self._around.links.size]
        )
        friction, placements = np.split(rest, [self._positive.size])
        links = links.reshape(self._around.links.shape)
        self._settle_lags(links, friction)
        return SystemState(friction, placements, log_cholesky(links, self._scale, EXISTS))

    def _settle_lags(self, links: Array, friction: Array) -> None:
        """Have a rotor or late friction, not both: only their difference moves the arm."""
        basis = self._around.friction.basis
        for part, place in zip(basis.terms, basis.slices, strict=True):
            if part.term.kind is lag:
                joint = part.drive.joints[0]
                net = links[joint, ROTOR] - friction[place.start]
                links[joint, ROTOR] = max(net, EXISTS * links[joint, ROTOR])
                friction[place.start] = max(-net, 0.0)

    def _quadratic(self) -> tuple[Array, Array]:
        """Return H and b of x^T H x / 2 - b^T x, of links, friction, steps of placements."""
        count, n_links = self._positive.size, self._around.links.size
        first = count + self._shapes
        friction, _, steps, links, torque = np.split(
            self._system,
            [count, first, first + len(self._allowed), first + len(self._allowed) + n_links],
            axis=1,
        )
        rows = np.hstack([links, friction, steps @ self._allowed])
        placements = self._of_placements[:, None] * self._allowed
        centre, precision = self._prior.of_links()
        near = np.eye(self._allowed.shape[1]) / NEAR**2
        hessian = rows.T @ rows + block_diag(
            *precision, np.diag(self._of_friction**2), placements.T @ placements + near
        )
        right = rows.T @ torque[:, 0]
        right[:n_links] += (precision @ centre[..., None]).ravel()
        right[n_links + count :] -= placements.T @ (self._of_placements * self._away)
        return hessian, right

    def links(self, state: SystemState) -> Array:
        """Return the parameters of the links, shape (n, 11)."""
        return link_parameters(state.numbers, self._scale)

    def step(self, state: SystemState) -> Array:
        """Return the step of the placements, shape (6 n,)."""
        return np.asarray(self._allowed @ state.placements)

    def parameters(self, state: SystemState) -> Array:
        """Return all parameters of the linearisation, shape (K + W + 17 n,)."""
        shapes, links = np.zeros(self._shapes), self.links(state).ravel()
        return np.concatenate([state.friction, shapes, self.step(state), links])

    def slopes(self, state: SystemState) -> Array:
        """
        Differentiate the parameters, (K + W + 17 n, K + r + 11 n).

        By coefficients of friction, steps of placements and log-Cholesky numbers.
        """
        friction = np.eye(self._positive.size + self._shapes, self._positive.size)
        links = link_parameter_jacobian(state.numbers, self._scale)
        return np.asarray(block_diag(friction, self._allowed, *links))

    def prior_rows(self, state: SystemState) -> Array:
        """Return the rows of the prior in the coordinates of `slopes`, (m, K + r + 11 n + 1)."""
        friction, links = (np.diag(each) for each in (self._of_friction, self._of_links))
        placements = self._of_placements[:, None] * self._allowed
        matrix = block_diag(friction, placements, links)
        return np.column_stack([matrix, -self._prior_residual(state)])

    def covariance_root(self, state: SystemState) -> Array:
        """Return a root of the covariance as in `ArmPosterior`, shapes of friction included."""
        first, shapes = state.friction.size, self._shapes
        slopes = np.insert(self.slopes(state), [first] * shapes, 0.0, axis=1)
        slopes[first + np.arange(shapes), first + np.arange(shapes)] = 1.0
        shape_std = np.maximum(
            self._around.friction.shape_std, LEAST_SHAPE * self._friction_std.max()
        )
        prior = np.insert(self.prior_rows(state)[:, :-1], [first] * shapes, 0.0, axis=1)
        of_shapes = np.zeros((shapes, prior.shape[1]))
        of_shapes[np.arange(shapes), first + np.arange(shapes)] = self._usual / shape_std
        factor = triangular(self._system[:, :-1] @ slopes, prior, of_shapes)
        root = slopes @ solve_triangular(factor, np.eye(len(factor)))
        return np.asarray(np.roll(root, -(first + shapes), axis=0))

    @property
    def _of_friction(self) -> Array:
        return np.asarray(1.0 / self._friction_std)

    def _prior_residual(self, state: SystemState) -> Array:
        return np.concatenate(
            [
                self._of_friction * state.friction,
                self._of_placements * (self._away + self.step(state)),
                self._of_links * state.numbers.ravel(),
            ]
        )


def _range_of(projector: Array) -> Array:
    """Return an orthonormal basis of what a projection leaves, shape (m, rank)."""
    values, vectors = np.linalg.eigh(projector)
    return np.asarray(vectors[:, values > 0.5])
