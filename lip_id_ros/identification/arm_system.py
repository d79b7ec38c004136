"""An arm whose links can exist from the triangular system of all torques."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag, solve_triangular

from lip_id_ros.arrays import Array
from lip_id_ros.identification.arm_coordinates import (
    friction_coefficients,
    friction_numbers,
    straight_step,
)
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.arm_problem import LOG_PRIOR, SMALLEST
from lip_id_ros.identification.levenberg_marquardt import minimise
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.statistics import triangular
from lip_id_ros.rigid_body.pseudo_inertia import (
    link_parameter_jacobian,
    link_parameters,
    log_cholesky,
    moved,
)

EVALUATIONS, LEAST_GAIN = 1000, 0.1
"""
Most evaluations, and the gain of log likelihood that is worth a step: what others move are numbers
that change no torque and slowly follow the prior.
"""

EXISTS = 1e-12
"""Least scaled eigenvalue of links that exist already."""

LEAST_SHAPE = 1e-9
"""Least prior deviation of the coefficient of a shape, in those of other coefficients."""


@dataclass(frozen=True, eq=False)
class SystemState:
    """Parameters of an arm."""

    friction: Array  # (K,), those that must be positive as logarithms
    placements: Array  # (r,), steps that keep the geometry
    numbers: Array  # (n, 11), log-Cholesky
    cost: float = np.inf
    residual: Array | None = None  # of the system and the prior


class ArmSystem:
    """
    Least squares for `levenberg_marquardt.minimise`.

    The system, shape (m, K + W + 17 n + 1), has rows of features and torque in units of the noise.
    `friction_std`, shape (K,), are deviations around zero and centres of logarithms; `inflation`
    is of the noise's variance, since residuals are correlated.
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
        prior = prior.beside(inflation)
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
        smallest = SMALLEST * self._friction_std
        friction = self._around.friction.coefficients
        numbers = friction_numbers(friction, self._positive, smallest)
        links = log_cholesky(self._around.links, self._scale, EXISTS)
        return self._evaluated(SystemState(numbers, np.zeros(self._allowed.shape[1]), links))

    def at(self, step: Array, state: SystemState) -> SystemState:
        """Return a state with the parameters of one that has other placements free."""
        return self._evaluated(replace(state, placements=self._allowed.T @ step))

    def solved(self, start: SystemState) -> SystemState:
        """Descend from a state that is near."""
        at = self._evaluated(start)
        tolerance = 0.1 * LEAST_GAIN / max(at.cost, 1.0)
        found = minimise(self, at, EVALUATIONS, tolerance)
        return found if at.cost - found.cost > LEAST_GAIN else at

    def links(self, state: SystemState) -> Array:
        """Return the parameters of the links, shape (n, 11)."""
        return link_parameters(state.numbers, self._scale)

    def friction(self, state: SystemState) -> Array:
        """Return the coefficients of friction, shape (K,)."""
        return friction_coefficients(state.friction, self._positive)

    def step(self, state: SystemState) -> Array:
        """Return the step of the placements, shape (6 n,)."""
        return np.asarray(self._allowed @ state.placements)

    def parameters(self, state: SystemState) -> Array:
        """Return all parameters of the linearisation, shape (K + W + 17 n,)."""
        shapes, links = np.zeros(self._shapes), self.links(state).ravel()
        return np.concatenate([self.friction(state), shapes, self.step(state), links])

    def slopes(self, state: SystemState) -> Array:
        """Differentiate the parameters by a step of the state, (K + W + 17 n, K + r + 11 n)."""
        friction = np.diag(np.where(self._positive, self.friction(state), 1.0))
        friction = np.pad(friction, ((0, self._shapes), (0, 0)))
        links = link_parameter_jacobian(state.numbers, self._scale)
        return np.asarray(block_diag(friction, self._allowed, *links))

    def prior_rows(self, state: SystemState) -> Array:
        """Return the rows of the prior of a step, (m, K + r + 11 n + 1)."""
        friction, links = (np.diag(each) for each in (self._of_friction, self._of_links))
        placements = self._of_placements[:, None] * self._allowed
        matrix = block_diag(friction, placements, links)
        return np.column_stack([matrix, -self._prior_residual(state)])

    def stepped(self, state: SystemState, step: Array) -> SystemState:
        """Return the state that a step leads to; parameters move along straight lines."""
        first, last = state.friction.size, state.friction.size + state.placements.size
        friction = straight_step(step[:first], self._positive)
        numbers = moved(state.numbers, step[last:].reshape(state.numbers.shape))
        placements = state.placements + step[first:last]
        return self._evaluated(SystemState(state.friction + friction, placements, numbers))

    def normal_equations(self, state: SystemState) -> tuple[Array, Array]:
        """Return J^T J and J^T r of steps at a state."""
        assert state.residual is not None
        jacobian = np.vstack(
            [self._system[:, :-1] @ self.slopes(state), self.prior_rows(state)[:, :-1]]
        )
        return jacobian.T @ jacobian, jacobian.T @ state.residual

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
        precision = np.where(self._positive, LOG_PRIOR, 1.0 / self._friction_std)
        return np.asarray(self._usual * precision)

    def _prior_residual(self, state: SystemState) -> Array:
        centre = np.where(self._positive, np.log(self._friction_std), 0.0)
        return np.concatenate(
            [
                self._of_friction * (state.friction - centre),
                self._of_placements * (self._away + self.step(state)),
                self._of_links * state.numbers.ravel(),
            ]
        )

    def _evaluated(self, state: SystemState) -> SystemState:
        with np.errstate(over='ignore', invalid='ignore'):
            fit = self._system[:, :-1] @ self.parameters(state) - self._system[:, -1]
            residual = np.concatenate([fit, self._prior_residual(state)])
            cost = 0.5 * float(residual @ residual)
        return replace(state, cost=cost if np.isfinite(cost) else np.inf, residual=residual)


def _range_of(projector: Array) -> Array:
    """Return an orthonormal basis of what a projection leaves, shape (m, rank)."""
    values, vectors = np.linalg.eigh(projector)
    return np.asarray(vectors[:, values > 0.5])
