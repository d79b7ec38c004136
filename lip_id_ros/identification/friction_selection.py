"""
Which friction terms drives have, selected by the prediction of left-out blocks.

Greedy forward selection on training data alone (Hastie, Tibshirani and Friedman, The Elements of
Statistical Learning, 3.3.2 and 7.10; maths.md, section 12).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import (
    estimate_noise,
    leverage_weights,
    outlier_weights,
    TorqueNoise,
)
from lip_id_ros.friction.terms import Term
from lip_id_ros.identification.folds import recurrent_folds
from lip_id_ros.identification.friction_candidates import (
    Candidate,
    candidates,
    lever_candidate,
    plain_candidates,
    presliding_candidates,
    ripple_candidates,
    rise_time,
    stands_for_lever,
)
from lip_id_ros.identification.friction_shapes import (
    resolved_harmonics,
    SignWidths,
    strongest_harmonic,
)
from lip_id_ros.identification.left_out import LeftOutBlocks, LeftOutFit
from lip_id_ros.identification.lever_search import best_lever, Explained
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import torque_regressor

BLOCKS = 6
MOST_SAMPLES = 20_000
"""Samples that the selection looks at; of more, so many evenly chosen."""

LEVER_SAMPLES = 1500
"""Samples with which springs between two points are searched for."""

LOAD_ROUNDS = 3
NOISE_ROUNDS = 2
MOST_TERMS = 40

SHOWN = 0.5
"""Least share of its gain that a term must have with nothing left out to be judged at all."""

SAME_GAIN = 1e-6
"""Difference of gains that rounding may make."""


TIE_ERRORS = 1.0
"""
Standard errors by which a term has to predict better than one of the same drive that is earlier on
the list, as it is more usual: else chance decides, and a rounding error changes the fit.
"""


class Offer(NamedTuple):
    """Terms on offer beside viscous and Coulomb friction and offsets."""

    candidates: Callable[[Array, Dataset], list[Candidate]]
    """Returns them for the widths of the joints' signs and the data set."""
    levers: bool
    """Whether springs between two points of neighbouring links are on offer too."""


EVERY_TERM = Offer(candidates, levers=True)


@dataclass(frozen=True, eq=False)
class SelectedFriction:
    """Friction and links, fitted together to all samples."""

    friction: FrictionModel
    link_parameters: Array  # (n, 11)
    noise: TorqueNoise  # of left-out samples

    def weights(self, dataset: Dataset, chain: Chain) -> Array:
        """
        Return weights in a fit, (N, n), for any data of the arm.

        Less near rest, and for bad samples.
        """
        state = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
        links = torque_regressor(chain, *state) @ self.link_parameters.ravel()
        friction = self.friction.torque(dataset.q, dataset.dq, dataset.ddq, links, dataset.history)
        residuals = dataset.tau - links - friction
        outliers = outlier_weights(residuals, self.noise.std_at(dataset.dq))
        return np.asarray(self.noise.weights(dataset.dq) * outliers)


def select_friction(
    dataset: Dataset, chain: Chain, link_std: Array, offer: Offer = EVERY_TERM
) -> SelectedFriction:
    """
    Select the widths of signs, then terms, in rounds with the links' torques of the round before.

    The links' parameters have prior deviations `link_std`, shape (n, 11), around zero.
    """
    selection = _Selection(dataset, chain, link_std)
    for _ in range(NOISE_ROUNDS):
        widths = selection.widths.beside([], selection.no_load)
        plain = plain_candidates(widths)
        # what pre-sliding explains near rest is not noise
        terms = [*plain, *presliding_candidates(widths, dataset)]
        selection.reweight(terms, selection.fitted(terms, selection.no_load), selection.no_load)
    ripples = ripple_candidates(selection.harmonics(terms))
    fit, chosen = selection.fitted(plain, selection.no_load), list[Candidate]()
    for _ in range(LOAD_ROUNDS):
        load, before = selection.links_torque(fit), chosen
        widths = selection.widths.beside(chosen, load)
        widths = selection.widths.beside_saturation(widths, chosen, load)
        plain = plain_candidates(widths)
        chosen = selection.chosen(plain, [*offer.candidates(widths, dataset), *ripples], load)
        if offer.levers:
            chosen = selection.with_levers(plain, chosen, load)
        fit = selection.fitted([*plain, *chosen], load)
        noise = selection.reweight([*plain, *chosen], fit, load)
        if chosen == before:
            break
    fit = selection.fitted([*plain, *chosen], load)
    return selection.outcome([*plain, *chosen], fit, noise)


class _Selection:
    """Samples with the links' features, and the statistics of whatever terms are on offer."""

    def __init__(self, dataset: Dataset, chain: Chain, link_std: Array) -> None:
        self._dataset = dataset = _thinned(dataset, MOST_SAMPLES)
        self._fold = recurrent_folds(dataset, BLOCKS)
        self._rise_time = rise_time(dataset)
        self._link_std = link_std
        state = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
        self._links = torque_regressor(chain, *state)
        self._used = [
            np.flatnonzero(self._links[:, joint].any(axis=0)) for joint in range(dataset.n_joints)
        ]
        self.no_load = np.zeros_like(dataset.tau)
        self._leverage = leverage_weights(
            [self._links[:, joint, used] for joint, used in enumerate(self._used)]
        )
        self._weights = self._leverage
        self.n_links = link_std.size
        self.widths = SignWidths(self._blocks, dataset.dq, link_std.size)

    def chosen(
        self, plain: list[Candidate], offers: Sequence[Candidate], load: Array
    ) -> list[Candidate]:
        """Add terms one by one while left-out blocks are predicted better, then drop idle ones."""
        blocks, groups = self._blocks([*plain, *offers], load)
        fixed = np.concatenate([np.arange(self.n_links), *groups[: len(plain)]])
        ballot = _Ballot(blocks, fixed, groups[len(plain) :], offers)
        taken: list[int] = []
        named = [index for index, offer in enumerate(offers) if not offer.comes_last]
        for some in (named, range(len(offers))):
            while len(taken) < MOST_TERMS:
                more = ballot.best_addition(taken, some)
                if more is None:
                    break
                taken.append(more)
        while (idle := ballot.idle(taken)) is not None:
            taken.remove(idle)
        return [offers[index] for index in taken]

    def with_levers(
        self, plain: list[Candidate], chosen: list[Candidate], load: Array
    ) -> list[Candidate]:
        """Put springs between two points where they predict better than what stands for them."""
        for joint in np.flatnonzero(~self._dataset.prismatic).tolist():
            stand_ins = [each for each in chosen if stands_for_lever(each, joint)]
            if not stand_ins:
                continue
            others = [each for each in chosen if each not in stand_ins]
            lever = self._best_lever([*plain, *others], load, joint)
            spring = lever_candidate(joint, lever, stand_ins)
            blocks, groups = self._blocks([*plain, *others, *stand_ins, spring], load)
            last = len(groups) - 1
            now, other = (
                np.concatenate([np.arange(self.n_links), *some])
                for some in (groups[:last], [*groups[: len(plain) + len(others)], groups[last]])
            )
            noise = blocks.noise(now)
            if _gain(blocks.fit(now, noise), blocks.fit(other, noise), spring) > 0.0:
                chosen = [*others, spring]
        return chosen

    def _best_lever(self, terms: Sequence[Candidate], load: Array, joint: int) -> Term:
        """Return the spring between two points that explains most beside links and some terms."""
        dataset, rows = self._dataset, evenly(self._dataset.n_samples, LEVER_SAMPLES)
        blocks, groups = self._blocks(terms, load)
        noise = blocks.noise(np.concatenate([np.arange(self.n_links), *groups]))
        features, columns = self._rows(self._basis(terms), load)
        # these samples stand for all of them
        weights = self._weights[rows] * (dataset.n_samples / rows.size)
        explained = Explained(
            [each[rows] for each in features],
            columns,
            dataset.tau[rows],
            weights,
            noise,
            blocks.prior_std,
        )
        return best_lever(explained, joint, dataset.q[rows, joint])

    def fitted(self, terms: Sequence[Candidate], load: Array) -> LeftOutFit:
        """Fit all of some terms."""
        blocks, groups = self._blocks(terms, load)
        selected = np.concatenate([np.arange(self.n_links), *groups])
        return blocks.fit(selected, blocks.noise(selected))

    def reweight(self, terms: Sequence[Candidate], fit: LeftOutFit, load: Array) -> TorqueNoise:
        """Estimate the noise from left-out residuals, and weight the samples by it from now on."""
        dataset, basis = self._dataset, self._basis(terms)
        number = self._fold
        residuals = np.empty_like(dataset.tau)
        features = basis.features_of_joints(
            dataset.q, dataset.dq, dataset.ddq, load, dataset.history
        )
        columns = basis.columns()
        for joint, (rows, column) in enumerate(zip(features, columns, strict=True)):
            thetas = np.array(fit.left_out)[number]
            links = np.sum(self._links[:, joint] * thetas[:, : self.n_links], axis=1)
            own = np.sum(rows * thetas[:, self.n_links + column], axis=1)
            residuals[:, joint] = dataset.tau[:, joint] - links - own
        noise = estimate_noise(residuals, dataset.dq)
        outliers = outlier_weights(residuals, noise.std_at(dataset.dq))
        self._weights = noise.weights(dataset.dq) * outliers * self._leverage
        return noise

    def harmonics(self, terms: Sequence[Candidate]) -> dict[int, int]:
        """Return the strongest harmonic of every joint beside links and some terms."""
        dataset, basis = self._dataset, self._basis(terms)
        features = basis.features_of_joints(
            dataset.q, dataset.dq, dataset.ddq, self.no_load, dataset.history
        )
        found = {}
        for joint, (used, own) in enumerate(zip(self._used, features, strict=True)):
            harmonics = resolved_harmonics(dataset, joint)
            if harmonics.size:
                root = np.sqrt(self._weights[:, joint])
                links = self._links[:, joint, used]
                rows = root[:, None] * np.column_stack([links, own, np.ones_like(root)])
                torque = root * dataset.tau[:, joint]
                found[joint] = strongest_harmonic(dataset.q[:, joint], torque, rows, harmonics)
        return found

    def links_torque(self, fit: LeftOutFit) -> Array:
        """Return the torques of the links, shape (N, n)."""
        return np.asarray(self._links @ fit.parameters[: self.n_links])

    def outcome(
        self,
        terms: Sequence[Candidate],
        fit: LeftOutFit,
        noise: TorqueNoise,
    ) -> SelectedFriction:
        """Return what was fitted to all samples."""
        basis = self._basis(terms)
        return SelectedFriction(
            FrictionModel(basis, np.maximum(fit.parameters[self.n_links :], basis.lower)),
            fit.parameters[: self.n_links].reshape(self._link_std.shape),
            noise,
        )

    def _basis(self, terms: Sequence[Candidate]) -> FrictionBasis:
        every = tuple(term for candidate in terms for term in candidate.terms)
        return FrictionBasis(self._dataset.n_joints, every, self._rise_time)

    def _blocks(
        self, terms: Sequence[Candidate], load: Array | None = None
    ) -> tuple[LeftOutBlocks, list[IndexArray]]:
        """Gather statistics by blocks, and the parameters of every candidate."""
        dataset, basis = self._dataset, self._basis(terms)
        load = self.no_load if load is None else load
        rows, columns = self._rows(basis, load)
        empty = TorqueStatistics.empty(columns)
        blocks = []
        for k in range(int(self._fold.max()) + 1):
            inside = self._fold == k
            some = [each[inside] for each in rows]
            weights = self._weights[inside]
            blocks.append(empty.update(some, dataset.tau[inside], weights, weights))
        torque_std = dataset.tau.std(axis=0)
        features = [each[:, used.size :] for each, used in zip(rows, self._used, strict=True)]
        prior = np.append(self._link_std, _prior_std(basis, features, torque_std))
        lower = np.append(np.full(self.n_links, -np.inf), basis.lower)
        ends = np.cumsum([0, *(sum(term.size for term in each.terms) for each in terms)])
        groups = [self.n_links + np.arange(a, b) for a, b in pairwise(ends)]
        return LeftOutBlocks(blocks, prior, lower, torque_std), groups

    def _rows(self, basis: FrictionBasis, load: Array) -> tuple[list[Array], list[IndexArray]]:
        """Return the features of links and friction of every joint, and their parameters."""
        dataset = self._dataset
        features = basis.features_of_joints(
            dataset.q, dataset.dq, dataset.ddq, load, dataset.history
        )
        parts = list(zip(self._used, features, basis.columns(), strict=True))
        rows = [
            np.hstack([self._links[:, joint, used], own])
            for joint, (used, own, _) in enumerate(parts)
        ]
        return rows, [np.append(used, self.n_links + column) for used, _, column in parts]


class _Ballot:
    """Gains of single candidates, given those that are taken."""

    def __init__(
        self,
        blocks: LeftOutBlocks,
        fixed: IndexArray,
        groups: Sequence[IndexArray],
        offers: Sequence[Candidate],
    ) -> None:
        self._blocks, self._fixed, self._groups, self._offers = blocks, fixed, groups, offers

    def best_addition(self, taken: list[int], among: Sequence[int]) -> int | None:
        """Return which of some candidates gains most beside those taken, if any does for sure."""
        selected = self._selected(taken)
        noise = self._blocks.noise(selected)
        now = self._blocks.fit(selected, noise)
        rest = [index for index in among if index not in taken]
        shown = self._blocks.explained(selected, [self._groups[index] for index in rest], noise)
        least = SHOWN * np.array([self._offers[index].least_gain for index in rest])
        rest = [index for index, hopeful in zip(rest, shown > least, strict=True) if hopeful]
        if not rest:
            return None
        fits = self._blocks.with_each(selected, [self._groups[index] for index in rest], noise)
        gains = np.array(
            [_gain(now, fit, self._offers[index]) for index, fit in zip(rest, fits, strict=True)]
        )
        most = gains.max(initial=0.0)
        if most == 0.0:
            return None
        # A term at its bound changes nothing but by rounding: those with fewer terms go first.
        best = int(np.argmax(gains > most - SAME_GAIN))
        drive = self._offers[rest[best]].terms[0].drive
        for index, gain, fit in zip(rest[:best], gains, fits, strict=False):
            if gain > 0.0 and self._offers[index].terms[0].drive == drive:
                more = fit.gain(fits[best])
                if more.mean <= TIE_ERRORS * more.error:
                    return index
        return rest[best]

    def idle(self, taken: list[int]) -> int | None:
        """Return the candidate without which nothing is lost for sure, if there is one."""
        selected = self._selected(taken)
        noise = self._blocks.noise(selected)
        now = self._blocks.fit(selected, noise)
        for index in taken:
            without = self._selected([other for other in taken if other != index])
            if not _gain(self._blocks.fit(without, noise), now, self._offers[index]) > 0.0:
                return index
        return None

    def _selected(self, taken: list[int]) -> IndexArray:
        return np.concatenate([self._fixed, *(self._groups[index] for index in taken)])


def _gain(now: LeftOutFit, fit: LeftOutFit, candidate: Candidate) -> float:
    """Return what a candidate gains, or zero where that may be chance."""
    gain = now.gain(fit)
    return gain.mean if gain.is_sure(candidate.least_gain, candidate.least_errors) else 0.0


def _prior_std(basis: FrictionBasis, features: Sequence[Array], torque_std: Array) -> Array:
    """Return deviations with which every feature makes torques of the measured size, (K,)."""
    prior = np.ones(basis.size)
    for rows, column, std in zip(features, basis.columns(), torque_std, strict=True):
        size = np.sqrt(np.mean(rows**2, axis=0))
        prior[column] = max(std, 1e-300) / np.where(size > 0.0, size, 1.0)
    return basis.prior_shares * prior


def _thinned(dataset: Dataset, most: int) -> Dataset:
    if dataset.n_samples <= most:
        return dataset
    return dataset.select(evenly(dataset.n_samples, most))
