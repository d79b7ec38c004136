"""Placements, links and friction fitted together, M(q) positive definite (maths.md, 13)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import FitError
from lip_id_ros.identification.arm_coordinates import (
    friction_coefficients,
    friction_numbers,
    moved_chain,
    straight_step,
)
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.kinematic_calibration import NOT_FINITE, Samples
from lip_id_ros.identification.levenberg_marquardt import minimise
from lip_id_ros.identification.possible_links import BarrierProblem
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.numba_jit import in_threads
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import (
    link_parameter_jacobian,
    link_parameters,
    LinkScale,
    log_cholesky,
    moved,
)
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives

SMALLEST = 1e-3
"""Friction coefficients that must be positive start at this share of their prior, or above."""

TOLERANCE = 1e-6

CHUNK = 125
"""Samples whose Jacobian one thread has in memory."""

REGRESSOR_CHUNK = 1000
"""Samples whose regressor is in memory at one time."""

BARRIERS = (1e4, 1e2, 10.0)
"""Weights of the barrier of a start, in log likelihood, one after the other."""

LEAST_SCALED = 1e-9
"""Least eigenvalue of scaled pseudo-inertias of such a start."""


@dataclass(frozen=True, eq=False)
class ArmState:
    """Parameters of an arm."""

    chain: Chain
    numbers: Array  # (n, 11), log-Cholesky numbers of the links
    friction: Array  # (k,), the positive ones as logarithms
    cost: float = np.inf
    residual: Array | None = None  # (N, n), in units of the noise


class ArmProblem:
    """
    Least squares over all parameters of an arm, for `levenberg_marquardt.minimise`.

    A step holds the placements as in `PlacementProblem`, log-Cholesky numbers (n, 11) and friction
    (k,), of which `positive` marks those that must be. `noise_std`, shape (n,), is of residuals [N
    m or N].
    """

    def __init__(
        self,
        samples: Samples,
        noise_std: Array,
        positive: BoolArray,
        prior: ArmPrior,
        geometry: Geometry | None = None,
    ) -> None:
        self._samples, self._positive, self._prior = samples, positive, prior
        self._scale = np.sqrt(samples.weights) / noise_std
        self.geometry = geometry or Geometry.free(samples.tau.shape[1])
        self._projected: tuple[Chain, Array] | None = None

    @property
    def link_scale(self) -> LinkScale:
        """Links whose log-Cholesky numbers are zero."""
        return self._prior.scale

    @property
    def size(self) -> int:
        """Number of entries of a step, m."""
        samples = self._samples
        placements = DIRECTIONS * len(samples.link_std)
        return placements + samples.link_std.size + samples.friction_std.size

    def start(self, chain: Chain, links: Array, friction: Array, least: float = 1e-3) -> ArmState:
        """
        Return the state nearest to a linear fit.

        Links (n, 11), friction (k,). `least` bounds the eigenvalues of scaled pseudo-inertias from
        below. Raises FitError where parameters are not finite.
        """
        if not (np.isfinite(links).all() and np.isfinite(friction).all()):
            raise FitError(NOT_FINITE)
        numbers = log_cholesky(links, self.link_scale, least)
        return self.evaluated(ArmState(chain, numbers, self.friction_numbers(friction)))

    def most_likely(self, chain: Chain) -> ArmState:
        """
        Return the state of most likely links and friction with the joints in given places.

        The prior counts as quadratic, and `BARRIERS` keep links from vanishing: this is where a
        descent starts. Raises FitError where parameters are not finite.
        """
        centre, precision = self._prior.of_links()
        size = self._samples.friction_std
        hessian = block_diag(*precision, np.diag(size**-2.0))
        right = hessian @ np.append(centre, np.zeros(size.size))
        for some in _chunks(len(self._samples.tau)):
            features = self._features(chain, some)
            hessian += features.T @ features
            right += features.T @ (self._samples.tau[some] * self._scale[some]).ravel()
        if not (np.isfinite(hessian).all() and np.isfinite(right).all()):
            raise FitError(NOT_FINITE)
        problem = BarrierProblem.of_arm(hessian, right, self.link_scale, (size, self._positive))
        at = np.append(centre, np.where(self._positive, size, 0.0))
        found = problem.minimised(at, BARRIERS)
        links = found[: centre.size].reshape(centre.shape)
        return self.start(chain, links, found[centre.size :], LEAST_SCALED)

    def _features(self, chain: Chain, some: slice) -> Array:
        """Return what links and friction are multiplied with, (N n, 11 n + k)."""
        motion = (x[some] for x in self._samples.state)
        features = [torque_regressor(chain, *motion), self._samples.friction[some]]
        scaled = np.concatenate(features, axis=2) * self._scale[some, :, None]
        return np.asarray(scaled.reshape(-1, scaled.shape[2]))

    def friction_numbers(self, coefficients: Array) -> Array:
        """Return the numbers that a state has for coefficients of friction, shape (k,)."""
        smallest = SMALLEST * self._samples.friction_std
        return friction_numbers(coefficients, self._positive, smallest)

    def minimised(self, start: ArmState, evaluations: int, least_gain: float = 0.0) -> ArmState:
        """Descend from a state, until steps gain less than `least_gain` of log likelihood."""
        at = self.evaluated(start)
        return minimise(self, at, evaluations, max(TOLERANCE, least_gain / max(at.cost, 1.0)))

    def evaluated(self, state: ArmState) -> ArmState:
        """Return a state with its cost and residuals."""
        with np.errstate(over='ignore', invalid='ignore'):
            residual = (self._samples.tau - self.torque(state)) * self._scale
            prior = self.prior_residual(state)
            cost = 0.5 * float(np.sum(residual**2) + prior @ prior)
        return replace(state, cost=cost if np.isfinite(cost) else np.inf, residual=residual)

    def links(self, state: ArmState) -> Array:
        """Return the parameters of the links, shape (n, 11)."""
        return link_parameters(state.numbers, self.link_scale)

    def coefficients(self, state: ArmState) -> Array:
        """Return the coefficients of friction, shape (k,)."""
        return friction_coefficients(state.friction, self._positive)

    def coefficient_slopes(self, state: ArmState) -> Array:
        """Return the slopes of the coefficients of friction by the numbers of a state, (k,)."""
        return np.where(self._positive, self.coefficients(state), 1.0)

    def projector(self, chain: Chain) -> Array:
        """Return the projection of steps on those that keep the geometry, shape (6 n, 6 n)."""
        if self._projected is None or self._projected[0] is not chain:
            self._projected = chain, self.geometry.projector(chain)
        return self._projected[1]

    def torque(self, state: ArmState) -> Array:
        """Return the torques of all samples, shape (N, n) [N m or N]."""
        torque = np.asarray(self._samples.friction @ self.coefficients(state))
        links = self.links(state).ravel()
        for some in _chunks(len(torque)):
            motion = (x[some] for x in self._samples.state)
            torque[some] += torque_regressor(state.chain, *motion) @ links
        return torque

    def jacobian(self, state: ArmState) -> Array:
        """
        Differentiate the torques at given loads, shape (N, n, m) [N m or N].

        By placements, log-Cholesky numbers and coefficients of friction.
        """
        return self._jacobian(state, slice(None))

    def _jacobian(self, state: ArmState, rows: slice) -> Array:
        samples, shape = self._samples, self._samples.tau[rows].shape
        links, motion = self.links(state), [x[rows] for x in samples.state]
        placements = placement_derivatives(state.chain, links, *motion).reshape(*shape, -1)
        regressor = torque_regressor(state.chain, *motion)
        regressor = regressor.reshape(*shape, len(links), LINK_PARAMETERS)
        out = np.empty((*shape, self.size))
        first, last = placements.shape[2], placements.shape[2] + links.size
        np.matmul(placements, self.projector(state.chain), out=out[..., :first])
        by_numbers = link_parameter_jacobian(state.numbers, self.link_scale)
        for j, each in enumerate(by_numbers):
            own = slice(first + LINK_PARAMETERS * j, first + LINK_PARAMETERS * (j + 1))
            out[..., own] = regressor[:, :, j] @ each
        out[..., last:] = samples.friction[rows]
        return out

    def normal_equations(self, state: ArmState) -> tuple[Array, Array]:
        """Return J^T J and J^T r of steps at a state."""
        assert state.residual is not None
        projector, residual = self.projector(state.chain), state.residual
        by_numbers = self.coefficient_slopes(state)
        first = self.size - by_numbers.size
        count = len(residual)
        chunks = [slice(k, k + CHUNK) for k in range(0, count, CHUNK)]
        hessians, gradients = ([np.empty(0)] * len(chunks) for _ in range(2))

        def gather(some: slice) -> None:
            for k in range(len(chunks))[some]:
                jacobian = self._jacobian(state, chunks[k])
                jacobian *= self._scale[chunks[k], :, None]
                jacobian[..., first:] *= by_numbers
                rows = jacobian.reshape(-1, jacobian.shape[2])
                hessians[k] = rows.T @ rows
                gradients[k] = rows.T @ residual[chunks[k]].ravel()

        # summed in one order, whatever the number of threads
        in_threads(gather, len(chunks), few=1)
        hessian, gradient = np.sum(hessians, axis=0), -np.sum(gradients, axis=0)
        precision = self.prior_precision()
        precision[first:] *= by_numbers
        hessian.flat[:: len(hessian) + 1] += precision**2
        gradient += precision * self.prior_residual(state)
        gradient[: len(projector)] = projector @ gradient[: len(projector)]
        return hessian, gradient

    def stepped(self, state: ArmState, step: Array) -> ArmState:
        """Return the state that a step leads to."""
        count = DIRECTIONS * len(state.numbers)
        chain = moved_chain(state.chain, self.projector(state.chain) @ step[:count])
        links = step[count : count + state.numbers.size].reshape(state.numbers.shape)
        change = straight_step(step[count + state.numbers.size :], self._positive)
        friction = state.friction + change
        return self.evaluated(
            ArmState(self.geometry.projected(chain), moved(state.numbers, links), friction)
        )

    def prior_precision(self) -> Array:
        """Return inverse deviations of the prior, (m,), in the coordinates of `jacobian`."""
        return np.append(self._prior.precision, 1.0 / self._samples.friction_std)

    def prior_residual(self, state: ArmState) -> Array:
        """Return how far a state is from the prior's centre, in standard deviations, (m,)."""
        arm = self._prior.precision * self._prior.deviation(state.chain, state.numbers)
        return np.append(arm, self.coefficients(state) / self._samples.friction_std)


def _chunks(count: int) -> Iterator[slice]:
    """Yield slices of samples whose regressors are in memory together."""
    return (slice(k, k + REGRESSOR_CHUNK) for k in range(0, count, REGRESSOR_CHUNK))
