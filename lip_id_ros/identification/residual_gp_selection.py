"""
Which joints have a Gaussian process beside links and friction, or instead of them.

Left-out motions with repetitions, and left-out lowest and highest positions, give a process beside
the links its weight, and choose among length scales of a grid and, instead of links, those of
marginal likelihood; beside them it would take correlated residuals for signal.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.arm_prior import links_torque
from lip_id_ros.identification.arm_problem import ArmProblem
from lip_id_ros.identification.folds import motion_s, recurrent_folds
from lip_id_ros.identification.process_parameters import likeliest, sparse_weights
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.linear_algebra import normal_solution
from lip_id_ros.model.residual_gp import (
    correlation,
    FRICTION_VARIANCE,
    Inputs,
    kinds_of,
    ResidualGP,
    stored_inputs,
    stored_weights,
)

MOST_SAMPLES, SELECTION_SAMPLES = 1000, 300
"""Of the processes that were selected, and of their selection."""

BLOCKS, LEAST_FOLDS = 6, 4

LEAST_NEW_S = 12.0
"""
Motion without repetitions that a process is selected on [s]. A block that is left out of less lies
between states of the rest, as no other motion does: on shorter motions, processes that predict
left-out blocks better predict new motion worse.
"""

EXTREME = 1.0 / 6.0
"""Share of the samples at each end of a joint's positions that are left out together."""

LENGTHS = (1.0, 2.0, 4.0)
"""Common length scales, in standard deviations times the root of the number of inputs."""

NOISES = (0.1, 1.0)
"""Variances of the noise that are tried at least, in variances of the process."""

LEAST_GAIN, WORTH = 0.1, 0.03
"""
Least decrease of the logarithm of left-out errors for which a joint has a process in place of its
links, and a weighted one beside them: eight on real recordings that gained less changed unseen
errors by 1 % in the mean, and each costs time in every query.
"""

NOTHING = 1e-3
"""Left-out errors, as a share of the torque's deviation, below which nothing is left to learn."""

HOPELESS = float(np.sqrt(0.5))
"""Left-out errors likewise, below which no process takes the place of links."""

LARGEST_ERROR = 0.1
"""Of a mean by the weights of few samples, in its left-out error."""

LEAST_ERRORS = 1.9
"""
Least mean decrease of those logarithms over the folds, in its standard errors: Student's t on the
level of 5 % for eight folds.
"""


@dataclass(frozen=True, eq=False)
class Fold:
    """Samples that are left out together."""

    out: BoolArray  # (M,)
    residual: Array  # (M, n), of a fit without them [N m or N]
    joint: int  # the joint to which the fold matters; -1 for all


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of samples that were left out."""

    mean_squares: Array  # (K,), of every fold [(N m)^2 or N^2]
    block_std: float  # of left-out blocks of time [N m or N]
    score: float  # log of root mean squares, mean over both kinds of folds

    @classmethod
    def of(cls, folds: Sequence[Fold], errors: Sequence[Array]) -> Errors:
        """Return the measures of errors fold by fold."""
        squares = np.array([np.mean(each**2) for each in errors])
        extreme = np.array([fold.joint >= 0 for fold in folds])
        means = [squares[kind].mean() for kind in (~extreme, extreme) if kind.any()]
        score = 0.5 * np.mean(np.log(np.maximum(means, 1e-300)))
        return cls(squares, float(np.sqrt(means[0])), float(score))

    def are_below(self, other: Errors) -> bool:
        """Return whether errors are less than others by enough, and by more than chance may do."""
        gains = np.log(other.mean_squares / np.maximum(self.mean_squares, 1e-300))
        error = float(gains.std(ddof=1) / np.sqrt(gains.size))
        enough = self.score < other.score - LEAST_GAIN
        return enough and bool(gains.mean() >= LEAST_ERRORS * error)


@dataclass(frozen=True, eq=False)
class ResidualProcess:
    """A Gaussian process of one joint."""

    replaces: bool  # takes the place of the links
    lengths: Array  # (d,), of the inputs
    noise: float  # variance, in variances of the process
    weight: float = 1.0  # of its mean in the torque
    left_out_std: float = 0.0  # of left-out blocks of time [N m or N]


def _weighted(
    process: ResidualProcess, residuals: Sequence[Array], errors: Sequence[Array]
) -> tuple[ResidualProcess, list[Array]]:
    """
    Return a process with the weight that left-out motions ask for, and the errors it then has.

    The slope of left-out residuals e on predictions g, less its standard error over the folds,
    between 0 and 1. Errors are e - g.
    """
    predictions = [e - error for e, error in zip(residuals, errors, strict=True)]
    products = np.array([e @ g for e, g in zip(residuals, predictions, strict=True)])
    squares = np.array([g @ g for g in predictions])
    total = max(float(squares.sum()), 1e-300)
    slope = products.sum() / total
    error = np.sqrt(np.sum((products - slope * squares) ** 2)) / total
    weight = float(np.clip(slope - error, 0.0, 1.0))
    left = [e - weight * g for e, g in zip(residuals, predictions, strict=True)]
    return replace(process, weight=weight), left


def fold_masks(dataset: Dataset, rows: IndexArray) -> list[tuple[BoolArray, int]]:
    """Return what to leave out of some rows, (M,), with the joint it matters to; -1 for all."""
    block, q = recurrent_folds(dataset, BLOCKS)[rows], dataset.q[rows]
    masks: list[tuple[BoolArray, int]] = [(block == k, -1) for k in np.unique(block)]
    low, high = np.quantile(q, (EXTREME, 1.0 - EXTREME), axis=0)
    for joint in range(q.shape[1]):
        masks += [(q[:, joint] <= low[joint], joint), (q[:, joint] >= high[joint], joint)]
    return [(mask, joint) for mask, joint in masks if 0 < mask.sum() < 0.7 * len(q)]


@dataclass(frozen=True, eq=False)
class Targets:
    """What processes are to explain."""

    inputs: Inputs
    x: Array  # (M, d), inputs of the samples
    friction: Array  # (M, n, 3), features
    tau: Array  # (M, n) [N m or N]
    residual: Array  # (M, n), of links and friction [N m or N]

    @classmethod
    def of(cls, inputs: Inputs, dataset: Dataset, residual: Array) -> Targets:
        """Return the targets of samples."""
        x = stored_inputs(inputs(dataset.q, dataset.dq, dataset.ddq))
        return cls(inputs, x, inputs.friction(dataset.dq), dataset.tau, residual)

    def of_joint(self, joint: int, replaces: bool) -> Array:
        """Return what the process of a joint explains, shape (M,) [N m or N]."""
        return np.asarray((self.tau if replaces else self.residual)[:, joint])

    def known(self, joint: int, replaces: bool) -> Array:
        """Return the covariance of friction, where links do not have it, shape (M, M)."""
        own = self.friction[:, joint] * float(replaces)
        return np.asarray(FRICTION_VARIANCE * own @ own.T)

    def conditioned(self, processes: Sequence[ResidualProcess | None]) -> ResidualGP | None:
        """Return the processes of the joints that have one; None if there are none."""
        n = self.tau.shape[1]
        noise, variance, left_out_std = np.zeros((3, n))
        replaces = np.zeros(n, dtype=bool)
        lengths, alpha = np.zeros((n, self.x.shape[1])), np.zeros_like(self.tau)
        friction = np.zeros((n, 3))
        for joint, each in enumerate(processes):
            if each is None:
                continue
            lengths[joint], noise[joint] = each.lengths, each.noise
            replaces[joint], left_out_std[joint] = each.replaces, each.left_out_std
            target = self.of_joint(joint, each.replaces)
            gram = correlation(self.x, self.x, each.lengths) + self.known(joint, each.replaces)
            gram[np.diag_indices_from(gram)] += each.noise
            weights = cho_solve(cho_factor(gram, lower=True), target)
            alpha[:, joint] = each.weight * weights
            variance[joint] = each.weight * float(target @ weights) / len(target)
            if each.replaces:
                friction[joint] = FRICTION_VARIANCE * self.friction[:, joint].T @ alpha[:, joint]
        few = self._sparse(lengths, alpha, LARGEST_ERROR * left_out_std)
        lengths *= few.any(axis=0)[:, None]  # others are zero to a tenth of the error
        if not lengths.any():
            return None
        own = lengths, noise, variance, left_out_std
        return ResidualGP(self.inputs, self.x, *own, replaces, stored_weights(few), friction)

    def _sparse(self, lengths: Array, alpha: Array, tolerance: Array) -> Array:
        """Return weights of few samples, the same ones for joints with the same length scales."""
        out = np.zeros_like(alpha)
        different, kinds = kinds_of(lengths, lengths.any(axis=1))
        for kind, each in enumerate(different):
            own = kinds == kind
            out[:, own] = sparse_weights(self.x, each, alpha[:, own], tolerance[own])
        return out


class ResidualGPSelection:
    """Selection of processes, joint by joint."""

    def __init__(self, targets: Targets, folds: Sequence[Fold]) -> None:
        self._targets, self._folds = targets, folds

    def select(self) -> list[ResidualProcess | None]:
        """Return the process of every joint; None where it predicts better without."""
        return [self.chosen(joint) for joint in range(self._targets.tau.shape[1])]

    def chosen(self, joint: int) -> ResidualProcess | None:
        """Return the process of one joint; None where it is better off without."""
        folds = [fold for fold in self._folds if fold.joint in (-1, joint)]
        residuals = [fold.residual[fold.out, joint] for fold in folds]
        alone = Errors.of(folds, residuals)
        std = self._targets.tau[:, joint].std()
        if alone.block_std < NOTHING * std:
            return None
        beside = self._candidates(joint, False, folds)
        weighted = [_weighted(each, residuals, left_out) for each, left_out in beside]
        process, errors = min(weighted, key=lambda each: sum(np.sum(e**2) for e in each[1]))
        now, best = Errors.of(folds, errors), None
        if alone.score - now.score < WORTH:
            now = alone
        else:
            best = replace(process, left_out_std=now.block_std)
        # A process is wrong without bound where it is wrong, above all in place of the links.
        if now.block_std >= HOPELESS * std:
            instead = [
                (Errors.of(folds, left_out), each)
                for each, left_out in self._candidates(joint, True, folds)
            ]
            other, candidate = min(instead, key=lambda each: each[0].score)
            if other.are_below(now):
                return replace(candidate, left_out_std=other.block_std)
        return best

    def _candidates(
        self, joint: int, replaces: bool, folds: Sequence[Fold]
    ) -> Iterator[tuple[ResidualProcess, list[Array]]]:
        """Yield processes with the errors of left-out samples of each fold."""
        x, known = self._targets.x, self._targets.known(joint, replaces)
        for lengths, noises in self._offers(joint, replaces, known):
            gram = correlation(x, x, lengths) + known
            for noise in noises:
                left_out = [self._left_out(fold, joint, replaces, gram, noise) for fold in folds]
                yield ResidualProcess(replaces, lengths, noise), left_out

    def _offers(
        self, joint: int, replaces: bool, known: Array
    ) -> Iterator[tuple[Array, Sequence[float]]]:
        """Yield length scales with the noises to try."""
        x = self._targets.x
        if replaces:
            target = self._targets.of_joint(joint, replaces)
            lengths, noise = likeliest(x, target, known)
            yield lengths, [noise, *(least for least in NOISES if least > noise)]
        for length in LENGTHS:
            yield np.full(x.shape[1], length * np.sqrt(x.shape[1])), NOISES

    def _left_out(
        self, fold: Fold, joint: int, replaces: bool, gram: Array, noise: float
    ) -> Array:
        """Return the errors of the samples of a fold."""
        out = fold.out
        target = (self._targets.tau if replaces else fold.residual)[:, joint]
        known = gram[np.ix_(~out, ~out)] + noise * np.eye(int(np.sum(~out)))
        alpha = cho_solve(cho_factor(known, lower=True), target[~out])
        return np.asarray(target[out] - gram[np.ix_(out, ~out)] @ alpha)


def select_residual_gp(fitter: ArmFitter, fit: ArmFit) -> ResidualGP | None:
    """Return the processes that predict better than links and friction of a fit alone, if any."""
    _, new_s = motion_s(fitter.dataset)
    return conditioned_residual_gp(fitter, fit, select_processes(fitter, fit, new_s))


def select_processes(fitter: ArmFitter, fit: ArmFit, new_s: float) -> list[ResidualProcess | None]:
    """
    Return the process of every joint; None where links and friction predict better alone.

    `new_s`: motion without repetitions that the samples are of [s].
    """
    nothing: list[ResidualProcess | None] = [None] * fitter.dataset.n_joints
    if new_s < LEAST_NEW_S:
        return nothing
    rows = evenly(fitter.dataset.n_samples, SELECTION_SAMPLES)
    masks = fold_masks(fitter.dataset, rows)
    if sum(joint < 0 for _, joint in masks) < LEAST_FOLDS:
        return nothing  # whatever memorises would be selected
    folds = left_out_fits(fitter, fit, rows, masks)
    return ResidualGPSelection(_targets(fitter, fit, rows), folds).select()


def conditioned_residual_gp(
    fitter: ArmFitter, fit: ArmFit, processes: Sequence[ResidualProcess | None]
) -> ResidualGP | None:
    """Return selected processes, conditioned on the residual of a fit; None if there are none."""
    if not any(processes):
        return None
    rows = evenly(fitter.dataset.n_samples, MOST_SAMPLES)
    return _targets(fitter, fit, rows).conditioned(processes)


def _targets(fitter: ArmFitter, fit: ArmFit, rows: IndexArray) -> Targets:
    some, dataset = fitter.dataset.select(rows), fitter.dataset
    inputs = Inputs.of(~dataset.prismatic, dataset.q, dataset.dq, dataset.ddq)
    return Targets.of(inputs, some, some.tau - fitter.problem(some, fit).torque(fit.state))


def left_out_fits(
    fitter: ArmFitter, fit: ArmFit, rows: IndexArray, masks: Sequence[tuple[BoolArray, int]]
) -> list[Fold]:
    """Fit links and friction without each fold, by one Gauss-Newton step from the fit to all."""
    some = fitter.dataset.select(rows)
    problem = fitter.problem(some, fit)
    jacobian, residual = linearised(problem, some, fit)
    # These samples stand for all of them.
    share = np.sqrt(fitter.dataset.n_samples / rows.size)
    scale = share * np.sqrt(fit.noise.weights(some.dq)) / fit.noise.std
    features, target = jacobian * scale[..., None], residual * scale
    precision = problem.prior_precision()
    prior = precision * problem.prior_residual(fit.state)
    folds = []
    for out, joint in masks:
        rest = features[~out].reshape(-1, precision.size)
        normal = rest.T @ rest + np.diag(precision**2)
        step = normal_solution(normal, rest.T @ target[~out].ravel() - prior)
        folds.append(Fold(out, residual - jacobian @ step, joint))
    return folds


def linearised(problem: ArmProblem, dataset: Dataset, fit: ArmFit) -> tuple[Array, Array]:
    """
    Return the Jacobian of torques at a fit, (N, n, m), and residuals (N, n) [N m or N].

    The loads that friction bears change with the links.
    """
    jacobian = problem.jacobian(fit.state)
    if fit.friction.basis.is_loaded.any():
        load = links_torque(fit.chain, fit.links, dataset)
        loads = jacobian[..., : problem.size - fit.friction.basis.size]
        states = dataset.q, dataset.dq, dataset.ddq, load, dataset.history
        loads += fit.friction.load_slopes(*states) @ loads
    return jacobian, dataset.tau - problem.torque(fit.state)
