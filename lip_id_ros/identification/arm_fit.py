"""Parameters of an arm from samples: placements, then friction, then all (maths.md, 13)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.identification.arm_coordinates import coefficient_std
from lip_id_ros.identification.arm_prior import (
    ArmPrior,
    DescriptionSettings,
    link_prior_std,
    links_torque,
)
from lip_id_ros.identification.arm_problem import ArmProblem, ArmState
from lip_id_ros.identification.friction_selection import (
    EVERY_TERM,
    Offer,
    select_friction,
    SelectedFriction,
)
from lip_id_ros.identification.kinematic_calibration import (
    PlacementProblem,
    Samples,
)
from lip_id_ros.identification.placement_search import least_noise, LENGTH, torque_size
from lip_id_ros.identification.sample_selection import covering, evenly
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.rigid_body import Chain, STANDARD_GRAVITY
from lip_id_ros.rigid_body.chain import NO_COUPLINGS
from lip_id_ros.rigid_body.pseudo_inertia import scale_of

MOST_SAMPLES, SEARCH_SAMPLES, START_SAMPLES = 1000, 500, 150
"""Of the fit, of the refinement of placements, and of the comparison of starts."""

LIFTS = (1e-1, 1e-2)
"""Least eigenvalues of the scaled pseudo-inertias of the first links that can exist."""

EVALUATIONS = (60, 30, 30)
"""Most evaluations of the rounds of a fit."""

ROUND, MOST_ROUNDS, LEAST_GAIN = (30,), 12, 0.1
"""
Of a fit that converges: evaluations of a round, most rounds, and the least gain of one in log
likelihood.
"""

GROWTH, MOST_AT_ONCE = 4, 64_000
"""
Of a fit to all samples: how many times more come with each stage, and the most whose features are
in memory at one time.
"""

FIRST_ROUND, LAST_ROUNDS, KEPT = (40,), (30, 20), 2
"""Of starts: all go through the first round, the best through the last ones."""

Described = tuple[RobotDescription, DescriptionSettings]


@dataclass(frozen=True, eq=False)
class ArmFit:
    """Parameters of an arm that fit samples best."""

    state: ArmState
    links: Array  # (n, 11)
    friction: FrictionModel
    noise: TorqueNoise  # of the residuals
    geometry: Geometry  # what of the placements is fixed

    @property
    def chain(self) -> Chain:
        """Placements of the joints."""
        return self.state.chain

    @property
    def score(self) -> float:
        """Return the negative log likelihood per sample, up to a constant."""
        return float(np.log(self.noise.std).sum())


class ArmFitter:
    """
    Fits the parameters of arms to a data set in the order of time.

    `robots` has the robot of every number of a recording; couplings (k, 3) are those of `Chain`.
    """

    def __init__(
        self,
        dataset: Dataset,
        described: Described | None = None,
        robots: Sequence[str] | None = None,
        couplings: Array = NO_COUPLINGS,
    ) -> None:
        self.dataset, self._described, self.robots = dataset, described, robots
        self.couplings = couplings
        self.link_std = link_prior_std(dataset)
        usual = scale_of(float(self.link_std[0, 0]), LENGTH)
        if described is None:
            self.prior = ArmPrior.vague(dataset.n_joints, usual)
        else:
            self.prior = ArmPrior.described(*described, usual)
        self.torque_std = torque_size(dataset.tau)
        self._chosen: dict[int, Dataset] = {}
        self.least_noise = least_noise(dataset.tau)

    @property
    def is_described(self) -> bool:
        """Whether the placements of a robot description are taken as they are."""
        return self.prior.chain is not None

    def some(self, count: int) -> Dataset:
        """Return so many of the samples, well spread."""
        if count not in self._chosen:
            self._chosen[count] = self.dataset.select(covering(self.dataset, count))
        return self._chosen[count]

    def thinned(self, most: int) -> ArmFitter:
        """Return a fitter of at most so many samples, at even distances."""
        if self.dataset.n_samples <= most:
            return self
        return self.of(self.dataset.select(evenly(self.dataset.n_samples, most)))

    def of(self, dataset: Dataset) -> ArmFitter:
        """Return a fitter of other samples, with the same description and couplings."""
        return ArmFitter(dataset, self._described, self.robots, self.couplings)

    def coupled(self, couplings: Array) -> ArmFitter:
        """Return a fitter of the same samples with other couplings."""
        other = ArmFitter(self.dataset, self._described, self.robots, couplings)
        other._chosen = self._chosen
        return other

    def selected(self, chain: Chain, offer: Offer = EVERY_TERM) -> SelectedFriction:
        """Select friction terms with the joints in given places."""
        selected = select_friction(self.dataset, chain, self.link_std, offer)
        std = np.maximum(selected.noise.std, self.least_noise)
        return replace(selected, noise=replace(selected.noise, std=std))

    def best_start(self, chains: Sequence[Chain], selected: SelectedFriction) -> ArmFit:
        """Fit to some of the samples from several starts, and return the best."""
        some, free = self.some(START_SAMPLES), self._geometry()
        arm = selected.link_parameters, selected.friction, selected.noise
        starts = (start for chain in chains for start in self._starts(some, chain, *arm, free))
        fits = [self.refined(some, start, FIRST_ROUND) for start in starts]
        best = sorted(fits, key=lambda fit: fit.score)[:KEPT]
        return min(
            (self.refined(some, fit, LAST_ROUNDS) for fit in best), key=lambda fit: fit.score
        )

    def with_friction(self, fit: ArmFit, selected: SelectedFriction) -> ArmFit:
        """Return a start with friction terms and noise that have been selected anew."""
        changed = replace(fit, friction=selected.friction, noise=selected.noise)
        problem = self.problem(self.some(START_SAMPLES), changed)
        numbers = problem.friction_numbers(selected.friction.coefficients)
        return replace(changed, state=replace(fit.state, friction=numbers))

    def with_geometry(self, fit: ArmFit, geometry: Geometry) -> ArmFit:
        """Fit placements that have a geometry to some of the samples."""
        some, chain = self.some(START_SAMPLES), geometry.projected(fit.chain)
        moved = replace(fit, state=replace(fit.state, chain=chain), geometry=geometry)
        # The links of the fit have made up for a geometry that is gone.
        anew = self._starts(some, chain, fit.links, fit.friction, fit.noise, geometry)
        return min(
            (self.refined(some, start, FIRST_ROUND) for start in (moved, *anew)),
            key=lambda each: each.score,
        )

    def refined(
        self,
        dataset: Dataset,
        fit: ArmFit,
        rounds: Sequence[int] = EVALUATIONS,
        least_gain: float = 0.0,
    ) -> ArmFit:
        """
        Descend, each round with the noise and the loads that the one before has found.

        A round ends where steps gain less than `least_gain` in log likelihood.
        """
        for evaluations in rounds:
            problem = self.problem(dataset, fit)
            state = problem.minimised(fit.state, evaluations, least_gain)
            fit = self._measured(dataset, fit, problem, state)
        return fit

    def converged(self, dataset: Dataset, fit: ArmFit, least_gain: float = 0.0) -> ArmFit:
        """Descend until a round improves the likelihood by next to nothing."""
        for _ in range(MOST_ROUNDS):
            before, fit = fit.score, self.refined(dataset, fit, ROUND, least_gain)
            if (before - fit.score) * dataset.n_samples < LEAST_GAIN:
                break
        return fit

    def to_all_samples(self, fit: ArmFit) -> ArmFit:
        """Descend from a fit to `MOST_SAMPLES` on ever more samples, up to `MOST_AT_ONCE`."""
        most, count = min(self.dataset.n_samples, MOST_AT_ONCE), MOST_SAMPLES
        while count < most:
            count = most if 2 * GROWTH * count > most else GROWTH * count
            some = self.thinned(count).dataset
            problem = self.problem(some, fit)
            fit = self._measured(some, fit, problem, fit.state)
            fit = self.converged(some, fit, LEAST_GAIN)
        return fit

    def problem(self, dataset: Dataset, fit: ArmFit) -> ArmProblem:
        """Return the least-squares problem of samples around a fit."""
        basis, noise = fit.friction.basis, fit.noise
        arm = fit.chain, fit.links
        samples = self.samples(dataset, basis, arm, noise.weights(dataset.dq))
        return ArmProblem(samples, noise.std, basis.is_positive, self.prior, fit.geometry)

    def samples(
        self,
        dataset: Dataset,
        basis: FrictionBasis,
        arm: tuple[Chain, Array] | None,
        weights: Array,
    ) -> Samples:
        """Return what placements, links and friction have to explain; `arm` gives the loads."""
        down = 0.0 if dataset.gravity_compensated else -STANDARD_GRAVITY
        return Samples(
            q=np.ascontiguousarray(dataset.q),
            dq=np.ascontiguousarray(dataset.dq),
            ddq=np.ascontiguousarray(dataset.ddq),
            tau=dataset.tau,
            prismatic=dataset.prismatic,
            gravity=np.array([0.0, 0.0, down]),
            couplings=self.couplings,
            friction=_features(dataset, basis, arm),
            link_std=self.link_std,
            friction_std=self._friction_std(basis, arm),
            weights=weights,
        )

    def _friction_std(self, basis: FrictionBasis, arm: tuple[Chain, Array] | None) -> Array:
        """Return deviations of coefficients that make torques of the measured size, (K,)."""
        size = np.sqrt(np.mean(_features(self.some(SEARCH_SAMPLES), basis, arm) ** 2, axis=0))
        return basis.prior_shares * coefficient_std(size, self.torque_std)

    @staticmethod
    def at(fit: ArmFit, problem: ArmProblem, state: ArmState) -> ArmFit:
        """Return a fit whose parameters are those of a state."""
        friction = FrictionModel(fit.friction.basis, problem.coefficients(state))
        return replace(fit, state=state, links=problem.links(state), friction=friction)

    def _starts(
        self,
        dataset: Dataset,
        chain: Chain,
        links: Array,
        friction: FrictionModel,
        noise: TorqueNoise,
        geometry: Geometry,
    ) -> Iterator[ArmFit]:
        """Yield starts with the joints in given places, as many with a description as without."""
        arm, basis = (chain, links), friction.basis
        samples = self.samples(dataset, basis, arm, noise.weights(dataset.dq))
        problem = ArmProblem(samples, noise.std, basis.is_positive, self.prior, geometry)
        if self.is_described:
            likely = problem.most_likely(chain)
            described = replace(likely, numbers=np.zeros_like(likely.numbers))
            states = [likely, problem.evaluated(described)]
        else:
            linear = PlacementProblem(samples, noise.std).at(chain.rotations, chain.translations)
            found = linear.link_parameters(samples), linear.friction_coefficients(samples)
            states = [problem.start(chain, *found, lift) for lift in LIFTS]
        for state in states:
            yield self.at(ArmFit(state, links, friction, noise, geometry), problem, state)

    def _geometry(self) -> Geometry:
        free = Geometry.free(self.dataset.n_joints)
        rigid = self._described is not None and self._described[1].fixes_placements
        return replace(free, rigid=rigid)

    def _measured(
        self, dataset: Dataset, fit: ArmFit, problem: ArmProblem, state: ArmState
    ) -> ArmFit:
        residual = dataset.tau - problem.torque(state)
        squares = np.mean(fit.noise.weights(dataset.dq) * residual**2, axis=0)
        std = np.maximum(np.sqrt(squares), self.least_noise)
        return replace(self.at(fit, problem, state), noise=replace(fit.noise, std=std))


def _features(dataset: Dataset, basis: FrictionBasis, arm: tuple[Chain, Array] | None) -> Array:
    load = np.zeros_like(dataset.tau) if arm is None else links_torque(*arm, dataset)
    return basis.features(dataset.q, dataset.dq, dataset.ddq, load, dataset.history)
