"""
Which friction terms the drives of an arm have, elected by the prediction of left-out blocks.

Greedy forward selection by cross-validation (Hastie, Tibshirani and Friedman, The Elements of
Statistical Learning, 3.3.2 and 7.10), on training data alone (docs/maths.md, section 12).

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.model import (
    Drive,
    DriveTerm,
    FrictionBasis,
    FrictionModel,
    plain_friction,
)
from lip_id_ros.friction.terms import (
    Asymmetric,
    Coulomb,
    FrictionTerm,
    LoadCoulomb,
    LoadViscous,
    PositionCoulomb,
    QuadraticViscous,
    Ripple,
    SaturatingViscous,
    Spring,
    Stribeck,
    Viscous,
)
from lip_id_ros.identification.left_out import LeftOutBlocks, LeftOutFit
from lip_id_ros.identification.noise import estimate_noise, TorqueNoise
from lip_id_ros.identification.statistics import contiguous_blocks, TorqueStatistics
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import torque_regressor

BLOCKS = 6
MOST_SAMPLES = 20_000
"""Samples that the election looks at; of more, so many evenly chosen."""

SIGN_WIDTHS = (0.01, 0.02, 0.05, 0.1, 0.2)
"""Widths of smooth signs that are tried, as shares of each joint's root mean square velocity."""

COMMON_GAIN = 0.03
"""
Least relative decrease of left-out mean squares, summed over joints, for a term that gears have.
"""

RARE_GAIN = 0.3
"""The same for terms that few drives have, or for which the links' parameters can stand in."""

LOAD_ROUNDS = 3
NOISE_ROUNDS = 2
MOST_TERMS = 40


@dataclass(frozen=True)
class Candidate:
    """
    Terms that are elected together.

    Attributes
    ----------
    terms : tuple of DriveTerm
    least_gain : float
        By which left-out blocks must be predicted better.

    """

    terms: tuple[DriveTerm, ...]
    least_gain: float = field(default=COMMON_GAIN, compare=False)


@dataclass(frozen=True, eq=False)
class ElectedFriction:
    """
    Friction and links, fitted together to all samples.

    Attributes
    ----------
    friction : FrictionModel
    link_parameters : array, shape (n, 11)
    noise : TorqueNoise
        Of left-out samples.
    plain_std : array, shape (n,)
        Root mean squares of left-out residuals in motion with viscous and Coulomb friction and
        offsets alone [N m or N].

    """

    friction: FrictionModel
    link_parameters: Array
    noise: TorqueNoise
    plain_std: Array


def elect_friction(dataset: Dataset, chain: Chain, link_std: Array) -> ElectedFriction:
    """
    Elect the widths of signs, then terms, in rounds with the links' torques of the round before.

    Parameters
    ----------
    dataset : Dataset
        In the order of time.
    chain : Chain
        Where the joints are.
    link_std : array, shape (n, 11)
        Prior standard deviations of the links' parameters around zero.

    """
    election = _Election(dataset, chain, link_std)
    for _ in range(NOISE_ROUNDS):
        widths = election.sign_widths()
        plain = [Candidate((term,)) for term in plain_friction(dataset.n_joints, widths).terms]
        fit = election.fitted(plain, election.no_load)
        noise = election.reweight(plain, fit, election.no_load)
    plain_fit = election.fitted(plain, election.no_load)
    chosen: list[Candidate] = []
    for _ in range(LOAD_ROUNDS):
        load = election.links_torque(fit)
        before, chosen = chosen, election.chosen(plain, chosen, candidates(widths, dataset), load)
        fit = election.fitted([*plain, *chosen], load)
        noise = election.reweight([*plain, *chosen], fit, load)
        if chosen == before:
            break
    fit = election.fitted([*plain, *chosen], load)
    return election.outcome([*plain, *chosen], fit, plain_fit, noise)


def candidates(widths: Array, dataset: Dataset) -> list[Candidate]:
    """
    Return the terms on offer beside viscous and Coulomb friction and offsets.

    Parameters
    ----------
    widths : array, shape (n,)
        Of each joint's smooth sign [rad/s or m/s].
    dataset : Dataset
        Terms that are periodic in a position are on offer where it covers the period.

    """
    offers: list[Candidate] = []
    turned = np.ptp(dataset.q, axis=0)
    for j, width in enumerate(float(each) for each in widths):
        common: list[FrictionTerm] = [
            Stribeck(width),
            SaturatingViscous(width),
            QuadraticViscous(),
            LoadCoulomb(width),
            LoadViscous(),
        ]
        rare: list[FrictionTerm] = [Asymmetric(width), Spring()]
        if dataset.joint_types[j] == 'revolute':
            rare += [Ripple(k) for k in (1, 2) if turned[j] > 2.0 * np.pi / k]
            rare += [PositionCoulomb(width)] if turned[j] > np.pi else []
        own = Drive.of_joint(j)
        offers += [Candidate((DriveTerm(own, term),)) for term in common]
        offers += [Candidate((DriveTerm(own, term),), RARE_GAIN) for term in rare]
    return offers + _coupled(widths)


def _coupled(widths: Array) -> list[Candidate]:
    """Return friction of motors that turn with two neighbouring joints, as in coupled wrists."""
    offers = []
    for j in range(1, len(widths)):
        for ratio in (1.0, -1.0):
            drive = Drive((j, j - 1), (1.0, ratio))
            terms = (Viscous(), Coulomb(float(np.hypot(widths[j], widths[j - 1]))))
            offers.append(Candidate(tuple(DriveTerm(drive, term) for term in terms), RARE_GAIN))
    return offers


class _Election:
    """Samples with the links' features, and the statistics of whatever terms are on offer."""

    def __init__(self, dataset: Dataset, chain: Chain, link_std: Array) -> None:
        self._dataset = dataset = _thinned(dataset, MOST_SAMPLES)
        self._link_std = link_std
        state = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
        self._links = torque_regressor(chain, *state)
        self._used = [
            np.flatnonzero(self._links[:, joint].any(axis=0)) for joint in range(dataset.n_joints)
        ]
        self.no_load = np.zeros_like(dataset.tau)
        self._weights = np.ones_like(dataset.tau)
        self.n_links = link_std.size

    def sign_widths(self) -> Array:
        """Elect the width of every joint's smooth sign, shape (n,) [rad/s or m/s]."""
        n = self._dataset.n_joints
        speed = np.sqrt(np.mean(self._dataset.dq**2, axis=0))
        speed[speed == 0.0] = 1.0
        plain = [plain_friction(n, share * speed).terms for share in SIGN_WIDTHS]
        others = [term for term in plain[0] if not isinstance(term.term, Coulomb)]
        signs = [term for terms in plain for term in terms if isinstance(term.term, Coulomb)]
        blocks, groups = self._blocks([Candidate((term,)) for term in (*others, *signs)])
        fixed = np.concatenate([np.arange(self.n_links), *groups[: len(others)]])
        sign = np.array(groups[len(others) :]).reshape(len(SIGN_WIDTHS), n)
        index = np.full(n, len(SIGN_WIDTHS) // 2)
        for _ in range(2):
            noise = blocks.noise(np.append(fixed, sign[index, np.arange(n)]))
            for j in range(n):
                rest = np.delete(sign[index, np.arange(n)], j)
                fits = blocks.with_each(np.append(fixed, rest), list(sign[:, j : j + 1]), noise)
                index[j] = np.argmin([np.log(fit.mean_squares).sum() for fit in fits])
        return np.asarray(np.array(SIGN_WIDTHS)[index] * speed)

    def chosen(
        self,
        plain: list[Candidate],
        chosen: list[Candidate],
        offers: Sequence[Candidate],
        load: Array,
    ) -> list[Candidate]:
        """Add candidates one by one while left-out blocks are predicted better."""
        offers = [*chosen, *(each for each in offers if each not in chosen)]
        blocks, groups = self._blocks([*plain, *offers], load)
        fixed = np.concatenate([np.arange(self.n_links), *groups[: len(plain)]])
        groups = groups[len(plain) :]
        taken: list[int] = []
        while len(taken) < MOST_TERMS:
            selected = np.concatenate([fixed, *(groups[index] for index in taken)])
            noise = blocks.noise(selected)
            now = blocks.fit(selected, noise)
            rest = [index for index in range(len(offers)) if index not in taken]
            fits = blocks.with_each(selected, [groups[index] for index in rest], noise)
            gains = [_gain(now, fit, offers[index]) for index, fit in zip(rest, fits, strict=True)]
            if not gains or max(gains) <= 0.0:
                break
            taken.append(rest[int(np.argmax(gains))])
        return [offers[index] for index in taken]

    def fitted(self, terms: Sequence[Candidate], load: Array) -> LeftOutFit:
        """Fit all of some terms."""
        blocks, groups = self._blocks(terms, load)
        selected = np.concatenate([np.arange(self.n_links), *groups])
        return blocks.fit(selected, blocks.noise(selected))

    def reweight(self, terms: Sequence[Candidate], fit: LeftOutFit, load: Array) -> TorqueNoise:
        """Estimate the noise from left-out residuals, and weight the samples by it from now on."""
        dataset, basis = self._dataset, self._basis(terms)
        number = contiguous_blocks(dataset.n_samples, BLOCKS)
        residuals = np.empty_like(dataset.tau)
        features, columns = basis.features(dataset.q, dataset.dq, load), basis.columns()
        for joint, (rows, column) in enumerate(zip(features, columns, strict=True)):
            thetas = np.array(fit.left_out)[number]
            links = np.sum(self._links[:, joint] * thetas[:, : self.n_links], axis=1)
            own = np.sum(rows * thetas[:, self.n_links + column], axis=1)
            residuals[:, joint] = dataset.tau[:, joint] - links - own
        noise = estimate_noise(residuals, dataset.dq)
        self._weights = noise.weights(dataset.dq)
        return noise

    def links_torque(self, fit: LeftOutFit) -> Array:
        """Return the torques of the links, shape (N, n)."""
        return np.asarray(self._links @ fit.parameters[: self.n_links])

    def outcome(
        self,
        terms: Sequence[Candidate],
        fit: LeftOutFit,
        plain: LeftOutFit,
        noise: TorqueNoise,
    ) -> ElectedFriction:
        """Return what was fitted to all samples."""
        basis = self._basis(terms)
        return ElectedFriction(
            FrictionModel(basis, np.maximum(fit.parameters[self.n_links :], basis.lower)),
            fit.parameters[: self.n_links].reshape(self._link_std.shape),
            noise,
            np.sqrt(plain.mean_squares),
        )

    def _basis(self, terms: Sequence[Candidate]) -> FrictionBasis:
        every = tuple(term for candidate in terms for term in candidate.terms)
        return FrictionBasis(self._dataset.n_joints, every)

    def _blocks(
        self, terms: Sequence[Candidate], load: Array | None = None
    ) -> tuple[LeftOutBlocks, list[IndexArray]]:
        """Gather statistics by blocks, and the parameters of every candidate."""
        dataset, basis = self._dataset, self._basis(terms)
        load = self.no_load if load is None else load
        features = basis.features(dataset.q, dataset.dq, load)
        columns = basis.columns()
        rows = [
            np.hstack([self._links[:, joint, used], own])
            for joint, (used, own) in enumerate(zip(self._used, features, strict=True))
        ]
        empty = TorqueStatistics.empty(
            [
                np.append(used, self.n_links + own)
                for used, own in zip(self._used, columns, strict=True)
            ]
        )
        number = contiguous_blocks(dataset.n_samples, BLOCKS)
        blocks = []
        for k in range(int(number[-1]) + 1):
            inside = number == k
            some = [each[inside] for each in rows]
            blocks.append(empty.update(some, dataset.tau[inside], self._weights[inside]))
        torque_std = dataset.tau.std(axis=0)
        prior = np.append(self._link_std, _prior_std(basis, features, torque_std))
        lower = np.append(np.full(self.n_links, -np.inf), basis.lower)
        ends = np.cumsum([0, *(sum(term.size for term in each.terms) for each in terms)])
        groups = [self.n_links + np.arange(a, b) for a, b in pairwise(ends)]
        return LeftOutBlocks(blocks, prior, lower, torque_std), groups


def _gain(now: LeftOutFit, fit: LeftOutFit, candidate: Candidate) -> float:
    """Return what a candidate gains, or zero where that may be chance."""
    mean, least, error = now.gain(fit)
    errors = 1.0 if candidate.least_gain == COMMON_GAIN else 2.0
    convincing = mean > max(candidate.least_gain, errors * error) and least > -COMMON_GAIN
    return mean if convincing else 0.0


def _prior_std(basis: FrictionBasis, features: Sequence[Array], torque_std: Array) -> Array:
    """Return deviations with which every feature makes torques of the measured size, (K,)."""
    prior = np.ones(basis.size)
    for rows, column, std in zip(features, basis.columns(), torque_std, strict=True):
        size = np.sqrt(np.mean(rows**2, axis=0))
        prior[column] = max(std, 1e-300) / np.where(size > 0.0, size, 1.0)
    return prior


def _thinned(dataset: Dataset, most: int) -> Dataset:
    if dataset.n_samples <= most:
        return dataset
    return dataset.select(np.linspace(0, dataset.n_samples - 1, most).astype(np.intp))
