"""
Errors of friction by terms that are all present and shrunk, relative to the selected ones.

On real recordings, with the joints where the default fit has them, without processes.

The coefficients of a term have a common prior deviation around zero. Two ways find it, and their
deviations are averaged, since an average is stabler than either. The evidence: the fixed point of
the marginal likelihood (MacKay, Neural Computation 1992), in which one sample in c counts, as
residuals are correlated, and a term earns a price in parameters before it counts. The folds: least
logarithms of the squares of left-out motions.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from benchmarks._real import ARMS, SPLITS
from benchmarks._results import line, short
from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.friction.basis import FrictionBasis, plain_friction
from lip_id_ros.friction.conservative_terms import lever_spring, position_curve, velocity_curve
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import (
    estimate_noise,
    leverage_weights,
    outlier_weights,
    TorqueNoise,
)
from lip_id_ros.friction.terms import (
    coulomb,
    dahl,
    lag,
    load_coulomb,
    load_torque,
    offset,
    presliding,
    saturating,
    stribeck,
    viscous,
)
from lip_id_ros.identification import fit
from lip_id_ros.identification.arm_coordinates import coefficient_std
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_prior import links_torque
from lip_id_ros.identification.folds import recurrent_folds
from lip_id_ros.identification.friction_candidates import (
    candidates,
    CURVE_STEPS,
    presliding_candidates,
    rise_time,
)
from lip_id_ros.identification.left_out import bounded_solutions
from lip_id_ros.identification.possible_links import BarrierProblem, BARRIERS
from lip_id_ros.identification.sample_selection import evenly, remembering, without_long_rests
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.pseudo_inertia import LinkScale
from lip_id_ros.rigid_body.regressor import torque_regressor

FOLDS, MOST_SAMPLES = 6, 12_000
"""Motions that are left out at most, and samples; of more, so many evenly chosen."""


WAYS = (2.0, 3.0), (5.0, 1.0), (10.0, 1.0)
"""Of the evidence: one sample in so many counts, and the parameters that a term has to earn."""

LEAST, MOST = np.exp(-9.0), np.exp(1.0)
"""Of prior deviations, where 1 makes a torque of the size of the measured one's deviation."""

FIRST_EVIDENCE, FIRST_FOLDS = np.exp(-1.0), np.exp(-3.0)
"""First deviations."""

EVIDENCE_ROUNDS, CONVERGED = 60, 0.02
"""Most rounds of the fixed point, and the change of a logarithm at which it ends."""

FOLD_ROUNDS, DESCENT, PRESSURE = 2, 60, 0.002
"""
Rounds of noise and descent of the folds, evaluations of a descent, and the slope of the cost by a
logarithm where left-out squares do not tell.
"""

ROUNDS, WEIGHT_ROUNDS, NOISE_ROUNDS = 3, 2, 3
"""Rounds of loads, of weights before the first, and of the noise of a prior."""

FIRST_NOISE, LEAST_NOISE = 0.05, 1e-4
"""Of residuals, in the deviation of each torque."""

LEAST_FREEDOM = 0.1
"""Least share of the samples that counts as left after the parameters."""

TINY = 1e-12
"""Least deviation or size of a feature that is one."""


class Prior(NamedTuple):
    """Deviations of the T terms in usual coefficients, and noise (n,) in the torques' own."""

    deviations: Array
    noise_std: Array


def shrunk_friction(
    dataset: Dataset,
    chain: Chain,
    link_std: Array,
    scale: LinkScale,
    selected: FrictionBasis,
) -> tuple[FrictionModel, Array]:
    """
    Return friction and links (n, 11) with the joints in given places, about some `scale`.

    Their parameters have prior deviations `link_std`, shape (n, 11), around zero. Widths of signs
    and springs between two points are those of a basis that has been `selected`. Loads and the
    weights of samples are those of the round before.
    """
    samples, widths = Samples.of(dataset, chain), sign_widths(selected)
    carried = [part for part in selected.terms if part.term.kind is lever_spring]
    plain, load = plain_terms(widths), np.zeros_like(samples.dataset.tau)
    first = [*plain, *presliding_terms(widths, samples.dataset)]
    for _ in range(WEIGHT_ROUNDS):  # what pre-sliding explains near rest is not noise
        grams = Grams(samples, first, link_std, load)
        prior = grams.plain
        samples = samples.reweighted(grams.left_out_residuals(prior))
    load = samples.links_torque(grams.solve(prior))
    every = [*plain, *carried, *offered_terms(widths, samples.dataset)]
    for _ in range(ROUNDS):
        grams = Grams(samples, every, link_std, load)
        prior = mean([*(grams.evidence(*way) for way in WAYS), grams.folds()])
        parameters = grams.solve(prior)
        load = samples.links_torque(parameters)
        samples = samples.reweighted(grams.left_out_residuals(prior))
    return grams.split(grams.possible(prior, scale))


def sign_widths(basis: FrictionBasis) -> Array:
    """Return the widths of the smooth signs of Coulomb friction, (n,) [rad/s or m/s]."""
    out = np.ones(basis.n_joints)
    for part in basis.terms:
        if part.term.kind is coulomb and len(part.drive.joints) == 1:
            out[part.drive.joints[0]] = part.term.parameters['width']
    return out


def mean(priors: Sequence[Prior]) -> Prior:
    """Return the mean of deviations, and the geometric mean of the noise."""
    deviations, noise = zip(*priors, strict=True)
    return Prior(np.mean(deviations, axis=0), np.exp(np.mean(np.log(noise), axis=0)))


@dataclass(frozen=True, eq=False)
class Samples:
    """Samples with what links are multiplied with, folds and weights."""

    dataset: Dataset
    links: Array  # (N, n, 11 n), features
    fold: IndexArray  # (N,)
    leverage: Array  # (N, n), weights of samples with absurd features
    noise: TorqueNoise
    weights: Array  # (N, n)

    @classmethod
    def of(cls, dataset: Dataset, chain: Chain) -> Samples:
        """Return at most `MOST_SAMPLES` of a data set, all with the same noise."""
        if dataset.n_samples > MOST_SAMPLES:
            dataset = dataset.select(evenly(dataset.n_samples, MOST_SAMPLES))
        state = (np.ascontiguousarray(x) for x in (dataset.q, dataset.dq, dataset.ddq))
        links = torque_regressor(chain, *state)
        used = [links[:, j, links[:, j].any(axis=0)] for j in range(dataset.n_joints)]
        leverage = leverage_weights(used)
        noise = TorqueNoise.constant(dataset.tau.std(axis=0))
        return cls(dataset, links, recurrent_folds(dataset, FOLDS), leverage, noise, leverage)

    def links_torque(self, parameters: Array) -> Array:
        """Return the torques of the links, which come first in parameters, (N, n) [N m or N]."""
        return np.asarray(self.links @ parameters[: self.links.shape[2]])

    def reweighted(self, residuals: Array) -> Samples:
        """Return them with the weights that left-out residuals (N, n) ask for [N m or N]."""
        dq = self.dataset.dq
        noise = estimate_noise(residuals, dq)
        outliers = outlier_weights(residuals, noise.std_at(dq))
        return replace(self, noise=noise, weights=noise.weights(dq) * outliers * self.leverage)


class Grams:
    """
    Sums of products of features and torques by fold and joint.

    Of P = 11 n + K parameters, of links and of terms, in units of their usual size; torques are in
    units of their deviation.
    """

    def __init__(
        self, samples: Samples, terms: Sequence[DriveTerm], link_std: Array, load: Array
    ) -> None:
        data = samples.dataset
        self._samples, self._terms = samples, terms
        self._basis = FrictionBasis(data.n_joints, tuple(terms), rise_time(data))
        self._n_links = link_std.size
        self._group = np.repeat(np.arange(len(terms)), [term.size for term in terms])
        self._shrinks = np.array([not is_plain(term) for term in terms])
        self._torque_std = np.maximum(data.tau.std(axis=0), TINY)
        friction = self._basis.features_of_joints(data.q, data.dq, data.ddq, load, data.history)
        links = np.arange(self._n_links)
        self._columns = [np.append(links, links.size + own) for own in self._basis.columns()]
        self._units = np.append(link_std, self._usual(friction))
        self._features = [
            np.hstack([samples.links[:, j], own]) * self._units[columns]
            for j, (own, columns) in enumerate(zip(friction, self._columns, strict=True))
        ]
        folds = range(int(samples.fold.max()) + 1)
        self._products = [
            [self._product(j, samples.fold == k) for j in self._joints] for k in folds
        ]
        self._counts = samples.weights.sum(axis=0)

    @property
    def _joints(self) -> range:
        return range(len(self._columns))

    def _usual(self, friction: Sequence[Array]) -> Array:
        """Return coefficients that make torques of the measured deviation, (K,)."""
        size, weights = np.zeros((len(friction), self._basis.size)), self._samples.weights
        for j, (own, rows) in enumerate(zip(self._basis.columns(), friction, strict=True)):
            size[j, own] = np.sqrt(np.average(rows**2, axis=0, weights=weights[:, j]))
        return coefficient_std(size, self._torque_std)

    def _product(self, joint: int, inside: BoolArray) -> Array:
        """Return the Gram matrix of features and torque of some samples, (p + 1, p + 1)."""
        torque = self._samples.dataset.tau[inside, joint, None]
        rows = np.hstack([self._features[joint][inside], torque]) / self._torque_std[joint]
        return np.asarray((rows * self._samples.weights[inside, joint, None]).T @ rows)

    def normal(self, noise_std: Array, without: int | None = None) -> Array:
        """Return the Gram matrix of all joints but for a fold, (P + 1, P + 1)."""
        size = self._units.size
        out = np.zeros((size + 1, size + 1))
        for j, columns in enumerate(self._columns):
            own = np.append(columns, size)
            parts = [each[j] for k, each in enumerate(self._products) if k != without]
            out[np.ix_(own, own)] += np.sum(parts, axis=0) / noise_std[j] ** 2
        return out

    def precision(self, deviations: Array) -> Array:
        """Return the inverse variances of the parameters, (P,)."""
        return np.append(np.ones(self._n_links), deviations[self._group] ** -2.0)

    def squares(self, parameters: Array, fold: int) -> Array:
        """Return the squared residuals of a fold, (n,)."""
        out = np.empty(len(self._columns))
        for j, columns in enumerate(self._columns):
            x = np.append(parameters[columns], -1.0)
            out[j] = x @ self._products[fold][j] @ x
        return np.maximum(out, TINY)

    def _seed(self, parameters: Array, fold: int, factors: Array) -> Array:
        """Return the slope of the squares of a fold, each times a factor, by parameters, (P,)."""
        out = np.zeros(self._units.size)
        for j, columns in enumerate(self._columns):
            x = np.append(parameters[columns], -1.0)
            out[columns] += 2.0 * factors[j] * (self._products[fold][j] @ x)[:-1]
        return out

    def without_folds(self, prior: Prior) -> list[tuple[tuple[Array, bool], Array]]:
        """Return a Cholesky factor and the parameters (P,) without each fold."""
        precision, found = self.precision(prior.deviations), []
        for k in range(len(self._products)):
            normal = self.normal(prior.noise_std, k if len(self._products) > 1 else None)
            matrix = normal[:-1, :-1]
            matrix.flat[:: len(matrix) + 1] += precision
            factor = cho_factor(matrix, lower=True, overwrite_a=True)
            found.append((factor, cho_solve(factor, normal[:-1, -1])))
        return found

    def left_out(self, prior: Prior) -> tuple[Array, Array]:
        """
        Return mean squares of left-out motions, (n,), and a slope of their logarithms, (T,).

        The slope of half their sum by the logarithms of the terms' deviations.
        """
        precision, found = self.precision(prior.deviations), self.without_folds(prior)
        sums = np.sum([self.squares(x, k) for k, (_, x) in enumerate(found)], axis=0)
        slope = np.zeros(len(self._terms))
        for k, (factor, x) in enumerate(found):
            change = cho_solve(factor, self._seed(x, k, 0.5 / sums))
            own = (2.0 * precision * change * x)[self._n_links :]
            slope += np.bincount(self._group, own, minlength=slope.size)
        return sums / self._counts, slope

    @cached_property
    def plain(self) -> Prior:
        """Prior in which the terms that shrink are nothing, with the noise of left-out motions."""
        noise = np.full(self._torque_std.size, FIRST_NOISE)
        prior = Prior(np.where(self._shrinks, LEAST, 1.0), noise)
        for _ in range(NOISE_ROUNDS):
            prior = self._measured(prior)
        return prior

    def _measured(self, prior: Prior) -> Prior:
        """Return a prior with the noise of left-out motions."""
        return prior._replace(noise_std=self._noise(self.left_out(prior)[0]))

    def _noise(self, mean_squares: Array) -> Array:
        return np.maximum(np.sqrt(mean_squares), LEAST_NOISE)

    def folds(self) -> Prior:
        """Return the prior that predicts left-out motions best."""
        shrinks = self._shrinks
        prior = self.plain._replace(deviations=np.where(shrinks, FIRST_FOLDS, 1.0))
        bounds = [(np.log(LEAST), np.log(MOST))] * int(shrinks.sum())

        def cost(logarithms: Array) -> tuple[float, Array]:
            squares, slope = self.left_out(moved(logarithms))
            value = 0.5 * np.sum(np.log(squares)) + PRESSURE * np.sum(logarithms)
            return float(value), slope[shrinks] + PRESSURE

        def moved(logarithms: Array) -> Prior:
            deviations = prior.deviations.copy()
            deviations[shrinks] = np.exp(logarithms)
            return prior._replace(deviations=deviations)

        options = {'maxiter': DESCENT}
        for _ in range(FOLD_ROUNDS):
            start = np.log(prior.deviations[shrinks])
            found = minimize(cost, start, jac=True, bounds=bounds, options=options)
            prior = self._measured(moved(found.x))
        return prior

    def evidence(self, count: float, price: float) -> Prior:
        """
        Return the fixed point of the marginal likelihood in which one sample in `count` counts.

        s^2 = sum theta^2 / (gamma + price) for each term, with gamma its effective number of
        parameters, sum (1 - C_kk / s^2) (MacKay 1992); the price is a Gamma hyperprior.
        """
        deviations = np.where(self._shrinks, FIRST_EVIDENCE, 1.0)
        noise, folds = self.plain.noise_std, range(len(self._products))
        for _ in range(EVIDENCE_ROUNDS):
            precision, normal = self.precision(deviations), self.normal(np.sqrt(count) * noise)
            covariance = np.linalg.inv(normal[:-1, :-1] + np.diag(precision))
            x = covariance @ normal[:-1, -1]
            known = (1.0 - precision * np.diag(covariance))[self._n_links :]
            gamma, size = (np.bincount(self._group, y) for y in (known, x[self._n_links :] ** 2))
            ratio = size / np.maximum(gamma + price, TINY)
            new = np.where(self._shrinks, np.clip(np.sqrt(ratio), LEAST, MOST), 1.0)
            change, deviations = np.abs(np.log(new / deviations)).max(), new
            squares = np.sum([self.squares(x, k) for k in folds], axis=0)
            used = self._shares(covariance, noise) / count
            freedom = np.maximum(self._counts - used, LEAST_FREEDOM * self._counts)
            noise = self._noise(squares / freedom)
            if change < CONVERGED:
                break
        return Prior(deviations, np.sqrt(count) * noise)

    def _shares(self, covariance: Array, noise_std: Array) -> Array:
        """Return the parameters that every joint's samples determine, (n,)."""
        out = np.empty(len(self._columns))
        for j, columns in enumerate(self._columns):
            gram = np.sum([each[j] for each in self._products], axis=0)[:-1, :-1]
            out[j] = np.sum(covariance[np.ix_(columns, columns)] * gram) / noise_std[j] ** 2
        return out

    def solve(self, prior: Prior) -> Array:
        """Return the parameters, friction within its bounds, (P,)."""
        normal = self.normal(prior.noise_std)
        matrix = normal[:-1, :-1] + np.diag(self.precision(prior.deviations))
        bounded = np.append(np.zeros(self._n_links, dtype=np.bool_), self._basis.is_positive)
        found = bounded_solutions(matrix[None], normal[None, :-1, -1], bounded[None])
        return np.asarray(self._units * found[0])

    def left_out_residuals(self, prior: Prior) -> Array:
        """Return the residuals of every sample without its fold, (N, n) [N m or N]."""
        tau, fold = self._samples.dataset.tau, self._samples.fold
        out = np.empty_like(tau)
        for k, (_, x) in enumerate(self.without_folds(prior)):
            inside = fold == k
            for j, columns in enumerate(self._columns):
                out[inside, j] = tau[inside, j] - self._features[j][inside] @ x[columns]
        return out

    def possible(self, prior: Prior, scale: LinkScale) -> Array:
        """Return the parameters beside links that can exist, (P,)."""
        normal = self.normal(prior.noise_std)
        hessian = normal[:-1, :-1] + np.diag(self.precision(prior.deviations))
        hessian /= self._units[:, None] * self._units
        size = (self._units / np.sqrt(self.precision(prior.deviations)))[self._n_links :]
        positive = self._basis.is_positive
        right = normal[:-1, -1] / self._units
        problem = BarrierProblem.of_arm(hessian, right, scale, (size, positive))
        return problem.minimised(problem.usual, BARRIERS)

    def split(self, parameters: Array) -> tuple[FrictionModel, Array]:
        """Return friction, and links (n, 11)."""
        links, friction = np.split(parameters, [self._n_links])
        model = FrictionModel(self._basis, np.maximum(friction, self._basis.lower))
        return model, links.reshape(len(self._columns), -1)


PLAIN = viscous, coulomb, offset, lag
SHRUNK = (
    *(viscous, coulomb, stribeck, saturating, load_coulomb, presliding, dahl),
    *(position_curve, velocity_curve, load_torque),
)
"""Of drives of one joint, and of motors that turn with two (viscous and Coulomb friction)."""

STEPS = CURVE_STEPS[0]
"""Of curves: the finer ones are not shrunk too."""


def is_plain(part: DriveTerm) -> bool:
    """Return whether a term is one that the drive of every joint has."""
    return part.term.kind in PLAIN and len(part.drive.joints) == 1


def plain_terms(widths: Array) -> list[DriveTerm]:
    """
    Return viscous and Coulomb friction and an offset for every joint.

    Viscous friction may be late: only its difference to the rotor's inertia is known.
    """
    late = [DriveTerm(Drive.of_joint(joint), lag()) for joint in range(len(widths))]
    return [*plain_friction(len(widths), widths).terms, *late]


def presliding_terms(widths: Array, dataset: Dataset) -> list[DriveTerm]:
    """Return pre-sliding friction for every joint."""
    return [term for each in presliding_candidates(widths, dataset) for term in each.terms]


def offered_terms(widths: Array, dataset: Dataset) -> list[DriveTerm]:
    """Return the terms that are shrunk, for widths of smooth signs (n,) [rad/s or m/s]."""
    every = dict.fromkeys(term for each in candidates(widths, dataset) for term in each.terms)
    return [
        part
        for part in every
        if part.term.kind in SHRUNK and part.term.parameters.get('count', STEPS) == STEPS
    ]


def _torque(chain: Chain, links: Array, friction: FrictionModel, dataset: Dataset) -> Array:
    dataset = remembering(dataset)
    load = links_torque(chain, links, dataset)
    state = dataset.q, dataset.dq, dataset.ddq
    return np.asarray(load + friction.torque(*state, load, dataset.history))


def errors(train: Dataset, test: Dataset) -> tuple[Array, Array]:
    """Return errors with shrunk terms and with the default fit, (n,) [%]."""
    model = fit(train)
    arm = model.arm
    assert arm is not None
    data = remembering(train)
    data = data.select(without_long_rests(data))
    fitter = ArmFitter(data)
    known = arm.chain, fitter.link_std, fitter.prior.scale, arm.friction.basis
    friction, links = shrunk_friction(data, *known)
    shrunk = _torque(arm.chain, links, friction, test)
    usual = model.predict(test.q, test.dq, test.ddq, test.t).tau
    return nmse_percent(shrunk, test.tau), nmse_percent(usual, test.tau)


def main(arguments: list[str]) -> int:
    """Print the errors of every split of the real arms, and their geometric mean."""
    parser = argparse.ArgumentParser(prog='benchmarks shrinkage', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the recordings')
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS))
    options = parser.parse_args(arguments)
    logarithms = []
    for name, split in product(options.arms, SPLITS):
        shrunk, usual = errors(*ARMS[name].split(options.data, split))
        logarithms.append(float(np.mean(np.log(shrunk / usual))))
        cells = ' '.join(short(each) for each in shrunk)
        print(line(f'{name}, {split}', cells, f'{np.exp(logarithms[-1]):.2f}'), flush=True)
    print(line('all', '', f'{np.exp(np.mean(logarithms)):.2f}'))
    return 0
