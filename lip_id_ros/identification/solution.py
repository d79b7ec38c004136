"""
An arm from the statistics of its recordings (maths.md, sections 13 and 14).

Parameters, deviations of friction between recordings, noise and inflation of the covariance are
found in turns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import coulomb, offset, viscous
from lip_id_ros.identification.arm_coordinates import coefficient_std, moved_chain
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.arm_system import ArmSystem, SystemState
from lip_id_ros.identification.friction_deviations import Effects
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.statistics import LeftOut, measure_left_out, TorqueStatistics
from lip_id_ros.identification.total import FrictionDeviations, Total
from lip_id_ros.rigid_body import Chain

ROUNDS = 4

INITIAL = 0.05
"""First deviation of a coefficient, as a share of its prior's."""

LEAST_NOISE = 1e-6
"""Least noise, as a share of each torque's deviation."""

VARYING = (viscous, coulomb, offset)
"""Terms that differ between recordings."""


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of an arm before its statistics are."""

    torque_std: Array  # (n,), of the measured torques [N m or N]
    prior: ArmPrior
    geometry: Geometry  # what of the placements is fixed


@dataclass(frozen=True, eq=False)
class RecordingFits:
    """What R recordings have with the arm of all."""

    residual_rms: Array  # (R, n), with own friction [N m or N]; nan without samples
    friction: Array  # (R, K), posterior means
    friction_std: Array  # (R, K)

    def among(self, kept: BoolArray, others: RecordingFits) -> RecordingFits:
        """Return these at the places of a mask, and others at the rest."""
        values = {}
        for name, own in vars(self).items():
            values[name] = np.empty((kept.size, own.shape[1]))
            values[name][kept], values[name][~kept] = own, getattr(others, name)
        return RecordingFits(**values)


@dataclass(frozen=True, eq=False)
class Solution:
    """Parameters of an arm."""

    chain: Chain
    links: Array  # (n, 11), of bodies that can exist
    numbers: Array  # (n, 11), their log-Cholesky numbers
    friction: FrictionModel  # with mean coefficients
    deviations: FrictionDeviations
    recordings: RecordingFits
    n_robots: int
    parameters: Array  # (K + W + 17 n,), of the linearisation solved
    friction_prior: Array  # (K,), deviations of torques of the measured size
    noise_std: Array  # (n,), within a recording [N m or N]
    left_out: LeftOut
    covariance_root: Array  # (17 n + K + W, r), coordinates of `ArmPosterior`

    @property
    def inflation(self) -> float:
        """Factor of the covariance for correlated residuals."""
        return self.left_out.inflation


def solve(total: Total, known: Known, moves: Geometry) -> Solution:
    """Solve for arm, friction and its deviations, and the noise."""
    solver = _Solver(total, known, moves)
    for _ in range(ROUNDS):
        solver.round()
    return solver.solution()


def solutions(total: Total, known: Known, moves: Geometry) -> Iterator[Solution]:
    """
    Yield the solution of every round.

    The last one is that of `solve`. Placements move in `moves`: the geometry of the arm, or a
    rigid one where they are fitted already. The covariance has those that the geometry of the arm
    leaves free.
    """
    solver = _Solver(total, known, moves)
    for _ in range(ROUNDS):
        solver.round()
        yield solver.solution()


def left_out_at_present(total: Total, known: Known) -> LeftOut:
    """Return what left-out parts show of the present parameters of a linearisation."""
    noise = total.around.noise.std
    none = FrictionDeviations.none(total.around.n_friction)
    problem = coordinates_of(total, known)
    state = problem.start()
    parts = parts_about(total, problem, state, noise, none)
    return measure_left_out(parts, problem.prior_rows(state), noise)


def fitted_alone(total: Total, solution: Solution) -> RecordingFits:
    """Return what recordings that are not in the fit have with its arm and any friction."""
    noise = np.sqrt(solution.inflation) * solution.noise_std
    found = total.effects(noise, solution.parameters).about_fleet(solution.friction_prior)
    return _fits(total, solution.parameters, found)


def _fits(total: Total, parameters: Array, effects: Effects) -> RecordingFits:
    basis = total.around.friction.basis
    own = np.maximum(parameters[: basis.size] + effects.centre + effects.mean, basis.lower)
    squares = total.residual_squares(parameters, own)
    counts = np.where(total.recording_counts > 0.0, total.recording_counts, np.nan)
    return RecordingFits(np.sqrt(squares / counts), own, effects.std)


class _Solver:
    """Rounds of parameters, deviations of friction and noise."""

    def __init__(self, total: Total, known: Known, moves: Geometry) -> None:
        self._total, self._known, self._moves = total, known, moves
        around = total.around
        self._friction_std = friction_std(total, known)
        self._least_noise = LEAST_NOISE * known.torque_std
        self._noise = np.maximum(around.noise.std, self._least_noise)
        self._start = INITIAL * self._friction_std * _varies(around.friction.basis)
        self._deviations = FrictionDeviations.none(around.n_friction)
        if len(total.recordings) > 1:
            self._deviations = replace(self._deviations, recordings=self._start)
        self._inflation = 1.0
        self._problem = self._moving()
        self._state = self._problem.start()
        self._measure()

    def round(self) -> None:
        """Solve once with the present deviations and noise, and estimate both anew."""
        self._problem = self._moving()
        self._state = self._problem.solved()
        self._measure()

    def _moving(self) -> ArmSystem:
        known = replace(self._known, geometry=self._moves)
        return system_of(self._total, known, self._noise, self._deviations, self._inflation)

    def _measure(self) -> None:
        """Estimate deviations of friction, noise and inflation with the present parameters."""
        total, parameters = self._total, self._problem.parameters(self._state)
        noise = np.sqrt(self._inflation) * self._noise
        effects = total.effects(noise, parameters).estimated(self._start)
        self._deviations = FrictionDeviations(effects.recordings, effects.groups)
        self._fits = _fits(total, parameters, effects)
        squares = total.merged(self._noise, self._deviations).squared_residuals(parameters)
        self._noise = np.maximum(np.sqrt(squares / total.counts), self._least_noise)
        free = coordinates_of(total, self._known)
        at = self._freed(free)
        parts = parts_about(total, free, at, self._noise, self._deviations)
        self._left_out = measure_left_out(parts, free.prior_rows(at), self._noise)
        self._inflation = self._left_out.inflation

    def solution(self) -> Solution:
        """Return what the last round has found."""
        around, problem, state = self._total.around, self._problem, self._state
        noise = self._left_out.unbiased_std
        free = system_of(self._total, self._known, noise, self._deviations, self._inflation)
        return Solution(
            chain=self._moves.projected(moved_chain(around.chain, problem.step(state))),
            links=problem.links(state),
            numbers=state.numbers,
            friction=FrictionModel(around.friction.basis, state.friction),
            deviations=self._deviations,
            recordings=self._fits,
            n_robots=int(self._total.group.max()) + 1,
            parameters=problem.parameters(state),
            friction_prior=self._friction_std,
            noise_std=np.maximum(self._left_out.noise_std, self._least_noise),
            left_out=self._left_out,
            covariance_root=free.covariance_root(self._freed(free)),
        )

    def _freed(self, problem: ArmSystem) -> SystemState:
        """Return the present state where all placements move that the geometry leaves free."""
        return problem.at(self._problem.step(self._state), self._state)


def coordinates_of(total: Total, known: Known) -> ArmSystem:
    """Return the problem of no rows: its parameters, their slopes and the prior alone."""
    none = np.zeros((0, total.around.size + 1))
    prior = known.prior, known.geometry, friction_std(total, known)
    return ArmSystem(total.around, none, *prior)


def system_of(
    total: Total,
    known: Known,
    noise_std: Array,
    deviations: FrictionDeviations,
    inflation: float = 1.0,
) -> ArmSystem:
    """Return the least-squares problem of all recordings."""
    noise_std = np.sqrt(inflation) * noise_std
    system = total.merged(noise_std, deviations).system(noise_std)
    prior = known.prior, known.geometry, friction_std(total, known)
    return ArmSystem(total.around, system, *prior, inflation)


def parts_about(
    total: Total,
    problem: ArmSystem,
    state: SystemState,
    noise_std: Array,
    deviations: FrictionDeviations,
) -> list[TorqueStatistics]:
    """Return the statistics of left-out parts, of residuals and their slopes at a state."""
    parameters, slopes = problem.parameters(state), problem.slopes(state)
    parts = total.folds(noise_std, deviations)
    return [_about(part, parameters, slopes) for part in parts]


def _about(statistics: TorqueStatistics, parameters: Array, slopes: Array) -> TorqueStatistics:
    """Return statistics of residuals, and of their slopes by a step of the parameters."""
    factors = []
    for column, factor in zip(statistics.columns, statistics.factors, strict=True):
        residual = factor[:, -1] - factor[:, :-1] @ parameters[column]
        factors.append(np.column_stack([factor[:, :-1] @ slopes[column], residual]))
    columns = tuple(np.arange(slopes.shape[1]) for _ in factors)
    return TorqueStatistics(columns, tuple(factors), statistics.counts)


def _varies(basis: FrictionBasis) -> BoolArray:
    """Return which coefficients deviate between recordings: of drives of one joint alone."""
    return np.array(
        [
            part.term.kind in VARYING and len(part.drive.joints) == 1
            for part in basis.terms
            for _ in range(part.size)
        ]
    )


def friction_std(total: Total, known: Known) -> Array:
    """Return deviations of coefficients that make torques of the measured size, (K,)."""
    size = np.sqrt(total.feature_squares / total.counts[:, None])
    return total.around.friction.basis.prior_shares * coefficient_std(size, known.torque_std)
