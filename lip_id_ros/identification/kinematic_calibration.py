"""Placements of joints from torques by variable projection (Golub, Pereyra 1973; maths.md, 10)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import blas, lapack

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.errors import FitError
from lip_id_ros.identification.arm_coordinates import moved_chain
from lip_id_ros.identification.levenberg_marquardt import minimise
from lip_id_ros.linear_algebra import normal_factor
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS, placement_derivatives

REACH = 3.0
"""Standard deviation of the prior on distances between joints [m]."""

TOLERANCE = 1e-4
"""A descent of the search ends where a step gains less than this share of its cost."""

NOT_FINITE = (
    'the torques of the samples were expected to be finite in units of the noise but are not: '
    'check the data for values beyond what the robot can do.'
)


@dataclass(frozen=True, eq=False)
class Samples:
    """Joint states and torques (N, n) that links and friction have to explain."""

    q: Array
    dq: Array
    ddq: Array
    tau: Array
    prismatic: BoolArray
    gravity: Array  # (3,), in the base [m/s^2]
    couplings: Array  # (k, 3), of positions, as in `Chain`
    friction: Array  # (N, n, k), features
    link_std: Array  # (n, 11), deviations a priori
    friction_std: Array  # (k,), likewise
    weights: Array  # (N, n), of squared residuals, `outlier_weights`

    @property
    def state(self) -> tuple[Array, Array, Array]:
        """Positions, velocities, accelerations."""
        return self.q, self.dq, self.ddq

    def select(self, rows: IndexArray) -> Samples:
        """Return some of the samples."""
        names = ('q', 'dq', 'ddq', 'tau', 'friction', 'weights')
        return replace(self, **{name: getattr(self, name)[rows] for name in names})


@dataclass(frozen=True, eq=False)
class Placements:
    """Placements of the joints with the linear parameters that fit best."""

    chain: Chain
    parameters: Array  # (11 n + k,), links, then friction, in their deviations
    cost: float
    features: Array  # (N n, 11 n + k), in units of the noise
    factor: Array  # lower Cholesky factor of the normal equations
    residual: Array  # (N n,), in units of the noise

    def link_parameters(self, samples: Samples) -> Array:
        """Return the parameters of the links, shape (n, 11)."""
        links = self.parameters[: samples.link_std.size]
        return links.reshape(-1, LINK_PARAMETERS) * samples.link_std

    def friction_coefficients(self, samples: Samples) -> Array:
        """Return the coefficients of friction, shape (k,)."""
        return self.parameters[samples.link_std.size :] * samples.friction_std


class PlacementProblem:
    """
    Least squares over the placements, for `levenberg_marquardt.minimise`.

    A step holds, joint by joint, a small rotation about the axes of the joint's own frame and a
    translation in that of its parent. `noise_std`, shape (n,), is of the residuals [N m or N].
    """

    def __init__(self, samples: Samples, noise_std: Array) -> None:
        self.n_joints = samples.tau.shape[1]
        self._samples = samples
        self._scale = np.sqrt(samples.weights) / noise_std
        self._tau = (samples.tau * self._scale).ravel()
        count = samples.link_std.size
        self._features = np.empty((*samples.tau.shape, count + samples.friction_std.size))
        friction = samples.friction * samples.friction_std
        self._features[..., count:] = friction * self._scale[..., None]
        self._link_scale = self._scale[..., None] * samples.link_std.ravel()

    def at(self, rotations: Array, translations: Array) -> Placements:
        """
        Solve for the linear parameters at given placements, shapes (n, 3, 3) and (n, 3).

        Raises FitError if the data are not finite in units of the noise.
        """
        found = self._solved(rotations, translations)
        if found is None:
            raise FitError(NOT_FINITE)
        return found

    def _solved(self, rotations: Array, translations: Array) -> Placements | None:
        """Solve for the linear parameters, if they are finite."""
        samples = self._samples
        chain = Chain(
            np.ascontiguousarray(rotations),
            np.ascontiguousarray(translations),
            samples.prismatic,
            samples.gravity,
            samples.couplings,
        )
        features = self._features.copy()
        links = torque_regressor(chain, *samples.state)
        np.multiply(links, self._link_scale, out=features[..., : links.shape[2]])
        features = features.reshape(self._tau.size, -1)
        normal = blas.dsyrk(1.0, features.T, lower=1)
        normal.flat[:: len(normal) + 1] += 1.0
        factor = normal_factor(normal)
        if not np.isfinite(factor[-1, -1]):
            return None
        parameters, _ = lapack.dpotrs(factor, features.T @ self._tau, lower=1)
        residual = self._tau - features @ parameters
        squares = residual @ residual + parameters @ parameters
        cost = 0.5 * float(squares + np.sum((translations / REACH) ** 2))
        return Placements(chain, np.asarray(parameters), cost, features, factor, residual)

    def normal_equations(self, point: Placements) -> tuple[Array, Array]:
        """
        Return J^T J and J^T r with the approximation of Kaufman (1975); J^T r is exact.

        J has what of the slopes S the features F cannot explain, so that J^T J is S^T S without
        the part along F, and r is at right angles to F already.
        """
        samples, n = self._samples, len(point.chain.prismatic)
        links = point.link_parameters(samples)
        slopes = placement_derivatives(point.chain, links, *samples.state)
        slopes *= self._scale[..., None, None]
        along = slopes.reshape(len(point.features), -1)
        explained = blas.dtrsm(1.0, point.factor, point.features.T @ along, lower=1)
        hessian = along.T @ along - explained.T @ explained
        gradient = -(along.T @ point.residual)
        distances = np.tile([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], n) / REACH**2
        hessian.flat[:: len(hessian) + 1] += distances
        gradient.reshape(n, DIRECTIONS)[:, 3:] += point.chain.translations / REACH**2
        return hessian, gradient

    def stepped(self, point: Placements, step: Array) -> Placements:
        """Return the placements that a step leads to, of infinite cost beyond finite numbers."""
        with np.errstate(over='ignore', invalid='ignore'):
            chain = moved_chain(point.chain, step)
            found = self._solved(chain.rotations, chain.translations)
        return replace(point, chain=chain, cost=np.inf) if found is None else found

    def descend(
        self,
        rotations: Array,
        translations: Array,
        evaluations: int,
        tolerance: float = TOLERANCE,
    ) -> Placements:
        """Descend from given placements, until a step gains less than a share of the cost."""
        return minimise(self, self.at(rotations, translations), evaluations, tolerance)

    def residual_rms(self, point: Placements) -> Array:
        """Return the root mean square residual of each joint, shape (n,) [N m or N]."""
        weights = self._samples.weights
        weighted = weights * placements_residual(point, self._samples) ** 2
        sums: Array = weighted.sum(axis=0) / weights.sum(axis=0)
        return np.sqrt(sums)


def placements_residual(placements: Placements, samples: Samples) -> Array:
    """Return the residuals of samples, shape (N, n) [N m or N]."""
    links = placements.link_parameters(samples).ravel()
    torque = torque_regressor(placements.chain, *samples.state) @ links
    friction = samples.friction @ placements.friction_coefficients(samples)
    return np.asarray(samples.tau - torque - friction)
