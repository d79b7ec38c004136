"""Links that can exist and mean friction, by descent on the triangular system of a fleet."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_triangular

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.arm_problem import LOG_PRIOR, SMALLEST
from lip_id_ros.identification.levenberg_marquardt import minimise
from lip_id_ros.identification.statistics import triangular
from lip_id_ros.rigid_body.pseudo_inertia import (
    LEAST_LEFT,
    link_parameter_jacobian,
    link_parameters,
    log_cholesky,
    moved,
)

EVALUATIONS, TOLERANCE = 1000, 1e-9
"""
Most evaluations, and the share of the cost at which steps end: what they still move are numbers
that change no torque and slowly follow the prior, at costs of less than a thousandth.
"""


@dataclass(frozen=True, eq=False)
class LinkState:
    """
    Parameters of links and mean friction.

    Attributes
    ----------
    friction : array, shape (K,)
        Coefficients, those that must be positive as logarithms.
    numbers : array, shape (n, 11)
        Log-Cholesky numbers.
    cost : float
    residual : array
        Of the system and the prior.

    """

    friction: Array
    numbers: Array
    cost: float = np.inf
    residual: Array | None = None


class LinkProblem:
    """
    Least squares over log-Cholesky numbers and friction, for `levenberg_marquardt.minimise`.

    Parameters
    ----------
    system : array, shape (m, K + 11 n + 1)
        Rows of friction, links and torque in units of the noise.
    prior : ArmPrior
        Of which that of the links is used.
    positive : bool array, shape (K,)
        Which coefficients of friction must be positive.
    friction_std : array, shape (K,)
        Deviations of the prior of the others around zero, and centre of that of logarithms.

    """

    def __init__(
        self, system: Array, prior: ArmPrior, positive: BoolArray, friction_std: Array
    ) -> None:
        self._features, self._torque = system[:, :-1], system[:, -1]
        self._scale, self._positive, self._friction_std = prior.scale, positive, friction_std
        links = prior.precision[len(prior.precision) - self._features.shape[1] + positive.size :]
        friction = np.where(positive, LOG_PRIOR, 1.0 / friction_std)
        self._precision = np.concatenate([friction, links])

    def solved(self, links: Array, friction: Array) -> LinkState:
        """Descend from parameters that are near."""
        return minimise(self, self.start(links, friction), EVALUATIONS, TOLERANCE)

    def start(self, links: Array, friction: Array) -> LinkState:
        """Return the state of links and friction that can exist."""
        smallest = SMALLEST * self._friction_std
        numbers = np.where(self._positive, np.log(np.maximum(friction, smallest)), friction)
        return self._evaluated(LinkState(numbers, log_cholesky(links, self._scale, 1e-9)))

    def links(self, state: LinkState) -> Array:
        """Return the parameters of the links, shape (n, 11)."""
        return link_parameters(state.numbers, self._scale)

    def friction(self, state: LinkState) -> Array:
        """Return the coefficients of friction, shape (K,)."""
        exponents = np.where(self._positive, state.friction, 0.0)
        return np.where(self._positive, np.exp(exponents), state.friction)

    def stepped(self, state: LinkState, step: Array) -> LinkState:
        """Return the state that a step leads to; parameters move along straight lines."""
        own = step[: state.friction.size]
        straight = self._positive & (own > LEAST_LEFT - 1.0)
        friction = np.where(straight, np.log1p(np.where(straight, own, 0.0)), own)
        numbers = moved(state.numbers, step[own.size :].reshape(state.numbers.shape))
        return self._evaluated(LinkState(state.friction + friction, numbers))

    def normal_equations(self, state: LinkState) -> tuple[Array, Array]:
        """Return J^T J and J^T r of steps at a state."""
        assert state.residual is not None
        jacobian = self._jacobian(state)
        return jacobian.T @ jacobian, jacobian.T @ state.residual

    def covariance_root(self, state: LinkState) -> Array:
        """Return a square root of the covariance of friction and links, (K + 11 n, K + 11 n)."""
        jacobian = self._jacobian(state)
        root: Array = solve_triangular(triangular(jacobian), np.eye(jacobian.shape[1]))
        return self._slopes(state) @ root

    def _evaluated(self, state: LinkState) -> LinkState:
        with np.errstate(over='ignore', invalid='ignore'):
            parameters = np.concatenate([self.friction(state), self.links(state).ravel()])
            fit = self._features @ parameters - self._torque
            centre = np.where(self._positive, np.log(self._friction_std), 0.0)
            prior = np.concatenate([state.friction - centre, state.numbers.ravel()])
            residual = np.concatenate([fit, self._precision * prior])
            cost = 0.5 * float(residual @ residual)
        return replace(state, cost=cost if np.isfinite(cost) else np.inf, residual=residual)

    def _slopes(self, state: LinkState) -> Array:
        """Differentiate friction and links by the numbers of a state."""
        size, first = self._features.shape[1], state.friction.size
        out = np.zeros((size, size))
        slopes = np.where(self._positive, self.friction(state), 1.0)
        out[np.arange(first), np.arange(first)] = slopes
        for j, each in enumerate(link_parameter_jacobian(state.numbers, self._scale)):
            own = slice(first + len(each) * j, first + len(each) * (j + 1))
            out[own, own] = each
        return out

    def _jacobian(self, state: LinkState) -> Array:
        return np.vstack([self._features @ self._slopes(state), np.diag(self._precision)])
