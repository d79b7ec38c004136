"""Links, friction and deviations of a fleet from the statistics of its recordings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.fleet.fleet_statistics import FleetStatistics, FrictionDeviations
from lip_id_ros.fleet.link_problem import LinkProblem, LinkState
from lip_id_ros.friction.model import FrictionBasis
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.friction_deviations import Effects
from lip_id_ros.identification.laplace import LeftOut, measure_left_out
from lip_id_ros.identification.recording_effects import VARYING
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
class RecordingFits:
    """
    What recordings have with the links of a fleet.

    Attributes
    ----------
    residual_rms : array, shape (R, n)
        Of every recording with its own friction [N m or N].
    friction, friction_std : arrays, shape (R, K)
        Posterior means and standard deviations of the coefficients of every recording.

    """

    residual_rms: Array
    friction: Array
    friction_std: Array

    def among(self, kept: BoolArray, others: RecordingFits) -> RecordingFits:
        """Return these at the places of a mask, and others at the rest."""
        values = {}
        for name, own in vars(self).items():
            values[name] = np.empty((kept.size, own.shape[1]))
            values[name][kept], values[name][~kept] = own, getattr(others, name)
        return RecordingFits(**values)


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
    recordings : RecordingFits
    friction_prior : array, shape (K,)
        Deviations with which every coefficient makes torques of the measured size.
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
    recordings: RecordingFits
    friction_prior: Array
    noise_std: Array
    left_out: Array
    inflation: float
    covariance_root: Array


def solve(statistics: FleetStatistics, sizes: Sizes) -> Solution:
    """Solve for links, friction and its deviations, and the noise."""
    *_, last = solutions(statistics, sizes)
    return last


def solutions(statistics: FleetStatistics, sizes: Sizes) -> Iterator[Solution]:
    """Yield the solution of every round; the last one is that of `solve`."""
    solver = _Solver(statistics, sizes)
    for _ in range(ROUNDS):
        solver.round()
        yield solver.solution()


def fitted_alone(statistics: FleetStatistics, solution: Solution) -> RecordingFits:
    """
    Return what recordings have with given links and any friction.

    Parameters
    ----------
    statistics : FleetStatistics
        Of recordings that are not in the fit.
    solution : Solution

    """
    noise = np.sqrt(solution.inflation) * solution.noise_std
    effects = statistics.effects(noise, solution.links, solution.friction)
    found = effects.about_fleet(solution.friction_prior)
    return _fits(statistics, solution.links, solution.friction, found)


def _fits(
    statistics: FleetStatistics, links: Array, friction: Array, effects: Effects
) -> RecordingFits:
    own = np.maximum(
        friction + effects.centre + effects.mean, statistics.regression.friction.basis.lower
    )
    squares = statistics.residual_squares(links, own)
    return RecordingFits(np.sqrt(squares / statistics.recording_counts), own, effects.std)


class _Solver:
    """Rounds of links, deviations of friction and noise."""

    def __init__(self, statistics: FleetStatistics, sizes: Sizes) -> None:
        regression = statistics.regression
        self._statistics, self._sizes = statistics, sizes
        self._links, self._friction = regression.links, regression.friction.coefficients
        self._friction_std = _friction_std(statistics, sizes.torque_std)
        self._least_noise = LEAST_NOISE * sizes.torque_std
        self._noise = np.maximum(regression.noise.std, self._least_noise)
        self._start = INITIAL * self._friction_std * _varies(regression.friction.basis)
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
        effects = statistics.effects(noise, self._links, self._friction).estimated(self._start)
        self._deviations = FrictionDeviations(effects.recordings, effects.groups)
        self._fits = _fits(statistics, self._links, self._friction, effects)
        squares = statistics.links.squared_residuals(self._links.ravel())
        variance = squares / np.maximum(statistics.links.counts, 1.0)
        self._noise = np.maximum(np.sqrt(variance), self._least_noise)
        self._left_out = self._measured(state)
        self._inflation = self._left_out.inflation

    def solution(self) -> Solution:
        """Return what the last round has found."""
        root = self._problem.covariance_root(self._state)
        order = np.roll(np.arange(len(root)), self._links.size)  # links first
        return Solution(
            links=self._links,
            friction=self._friction,
            deviations=self._deviations,
            recordings=self._fits,
            friction_prior=self._friction_std,
            noise_std=np.maximum(self._left_out.noise_std, self._least_noise),
            left_out=self._left_out.mean_squares,
            inflation=self._inflation,
            covariance_root=root[order],
        )

    def _measured(self, state: LinkState) -> LeftOut:
        """Predict each part of the recordings from the others."""
        statistics, numbers = self._statistics, state.numbers.ravel()
        slopes = link_parameter_jacobian(state.numbers, self._sizes.prior.scale)
        parts = [_about(part, self._links, slopes) for part in statistics.parts]
        precision = self._sizes.prior.precision[-numbers.size :]
        prior = np.column_stack([np.diag(precision), -precision * numbers])
        if len(parts) > 1:
            return measure_left_out(parts, prior, self._noise)
        squares = self._noise[None] ** 2
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
    return TorqueStatistics(columns, tuple(factors), statistics.counts)


def _varies(basis: FrictionBasis) -> BoolArray:
    """Return which coefficients deviate between recordings: of drives of one joint alone."""
    return np.array(
        [
            isinstance(part.term, VARYING) and len(part.drive.joints) == 1
            for part in basis.terms
            for _ in range(part.size)
        ]
    )


def _friction_std(statistics: FleetStatistics, torque_std: Array) -> Array:
    """Return deviations of coefficients that make torques of the measured size, (K,)."""
    size = np.sqrt(statistics.feature_squares() / statistics.counts[:, None])
    ratio = torque_std[:, None] / np.where(size > 0.0, size, np.nan)
    # of a drive that is coupled to several joints, the smallest
    return np.nan_to_num(np.fmin.reduce(ratio, axis=0), nan=1.0)
