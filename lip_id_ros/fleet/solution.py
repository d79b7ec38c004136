"""Links, friction and deviations of a fleet from the statistics of its recordings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.fleet.friction_deviations import Effects
from lip_id_ros.fleet.link_problem import LinkProblem, LinkState
from lip_id_ros.fleet.sums import (
    components,
    FleetStatistics,
    FrictionDeviations,
    joined,
    part_of,
)
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.laplace import LeftOut, measure_left_out
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.rigid_body.pseudo_inertia import link_parameter_jacobian

ROUNDS = 4
"""Of links, deviations of friction and noise, each with what the others have found."""

INITIAL = 0.05
"""First deviation of a coefficient, as a share of its prior's."""

LEAST_NOISE = 1e-6
"""Least noise, as a share of each torque's deviation."""


@dataclass(frozen=True, eq=False)
class Sizes:
    """
    What the parameters of a fleet are measured with before it is solved.

    Attributes
    ----------
    torque_std : array, shape (n,)
        Of the measured torques [N m or N].
    prior : ArmPrior
        Of the links.
    inflation : float
        Factor of the covariance for correlated residuals, where there is one recording only.

    """

    torque_std: Array
    prior: ArmPrior
    inflation: float


@dataclass(frozen=True, eq=False)
class Solution:
    """
    Parameters of a fleet.

    Attributes
    ----------
    links : array, shape (n, 11)
        Of bodies that can exist.
    friction : array, shape (K,)
        Mean coefficients.
    deviations : FrictionDeviations
    recording_friction, recording_friction_std : arrays, shape (R, K)
        Posterior means and standard deviations of the coefficients of every recording.
    residual_rms : array, shape (R, n)
        Of every recording with its own friction [N m or N].
    noise_std : array, shape (n,)
        Within a recording [N m or N].
    left_out : array, shape (n,)
        Mean squared residuals of recordings that were left out [(N m)^2 or N^2].
    inflation : float
        Factor of the covariance for correlated residuals.
    covariance_root : array, shape (11 n + K, 11 n + K)
        Of links and mean friction with the placements given.

    """

    links: Array
    friction: Array
    deviations: FrictionDeviations
    recording_friction: Array
    recording_friction_std: Array
    residual_rms: Array
    noise_std: Array
    left_out: Array
    inflation: float
    covariance_root: Array


def solve(statistics: FleetStatistics, sizes: Sizes) -> Solution:
    """Solve for links, friction and its deviations, and the noise."""
    solver = _Solver(statistics, sizes)
    for _ in range(ROUNDS):
        solver.round()
    return solver.solution()


class _Solver:
    """Rounds of links, deviations of friction and noise."""

    def __init__(self, statistics: FleetStatistics, sizes: Sizes) -> None:
        regression = statistics.regression
        self._statistics, self._sizes = statistics, sizes
        self._links, self._friction = regression.links, regression.friction.coefficients
        self._lower = regression.friction.basis.lower
        self._friction_std = sizes.torque_std.max() / _feature_sizes(statistics, sizes)
        self._least_noise = LEAST_NOISE * sizes.torque_std
        self._noise = np.maximum(regression.noise.std, self._least_noise)
        self._start = INITIAL * self._friction_std
        several = len(statistics.recordings) > 1
        first = self._start if several else np.zeros_like(self._start)
        self._deviations = FrictionDeviations(first, np.zeros_like(first))
        self._inflation = sizes.inflation

    def round(self) -> None:
        """Solve once with the present deviations and noise, and estimate both anew."""
        statistics = self._statistics
        noise = np.sqrt(self._inflation) * self._noise
        system = statistics.system(noise, self._deviations)
        positive = statistics.regression.friction.basis.is_positive
        problem = LinkProblem(system, self._sizes.prior, positive, self._friction_std)
        state = problem.solved(self._links, self._friction)
        self._problem, self._state = problem, state
        self._links, self._friction = problem.links(state), problem.friction(state)
        effects = self._estimated(noise)
        self._deviations = FrictionDeviations(effects.recordings, effects.groups)
        own = self._friction + effects.centre + effects.mean
        self._own, self._own_std = np.maximum(own, self._lower), effects.std
        self._squares = statistics.residual_squares(self._links, self._own)
        variance = self._squares.sum(axis=0) / statistics.weights
        self._noise = np.maximum(np.sqrt(variance), self._least_noise)
        self._left_out = self._measured(state)
        self._inflation = self._left_out.inflation

    def solution(self) -> Solution:
        """Return what the last round has found."""
        statistics, n = self._statistics, self._links.size
        weights = np.array([each.weights for each in statistics.recordings])
        root = self._problem.covariance_root(self._state)
        order = np.roll(np.arange(len(root)), n)  # links first
        return Solution(
            links=self._links,
            friction=self._friction,
            deviations=self._deviations,
            recording_friction=self._own,
            recording_friction_std=self._own_std,
            residual_rms=np.sqrt(self._squares / weights),
            noise_std=np.maximum(self._left_out.noise_std, self._least_noise),
            left_out=self._left_out.mean_squares,
            inflation=self._inflation,
            covariance_root=root[order],
        )

    def _estimated(self, noise: Array) -> Effects:
        effects = self._statistics.effects(noise, self._links, self._friction)
        parts = [
            (some, part_of(effects, some).estimated(self._start[some]))
            for some in components(effects)
        ]
        return joined(parts, self._friction.size)

    def _measured(self, state: LinkState) -> LeftOut:
        """Predict each part of the recordings from the others."""
        statistics, numbers = self._statistics, state.numbers.ravel()
        slopes = link_parameter_jacobian(state.numbers, self._sizes.prior.scale)
        parts = [_about(part, self._links, slopes) for part in statistics.parts]
        precision = self._sizes.prior.precision[-numbers.size :]
        prior = np.column_stack([np.diag(precision), -precision * numbers])
        if len(parts) > 1:
            return measure_left_out(parts, prior, self._noise)
        squares = self._noise**2
        return LeftOut(squares, self._sizes.inflation, self._noise, self._noise)


def _about(statistics: TorqueStatistics, links: Array, slopes: Array) -> TorqueStatistics:
    """Return statistics of residuals, and of their slopes by log-Cholesky numbers."""
    size = links.size
    every = np.zeros((size, size))
    for j, each in enumerate(slopes):
        own = slice(len(each) * j, len(each) * (j + 1))
        every[own, own] = each
    factors = []
    for column, factor in zip(statistics.columns, statistics.factors, strict=True):
        residual = factor[:, -1] - factor[:, :-1] @ links.ravel()[column]
        factors.append(np.column_stack([factor[:, :-1] @ every[column], residual]))
    columns = tuple(np.arange(size) for _ in factors)
    return TorqueStatistics(columns, tuple(factors), statistics.weights)


def _feature_sizes(statistics: FleetStatistics, sizes: Sizes) -> Array:
    """Return sizes of features in units in which all joints have the largest torque, (K,)."""
    unit = sizes.torque_std / sizes.torque_std.max()
    squares = np.zeros((len(unit), statistics.n_friction))
    for r in range(len(statistics.recordings)):
        squares += statistics.feature_squares(r)
    size = np.sqrt(squares / statistics.weights[:, None]) / unit[:, None]
    largest = size.max(axis=0)  # of a drive that is coupled to several joints
    return np.where(largest > 0.0, largest, sizes.torque_std.max())
