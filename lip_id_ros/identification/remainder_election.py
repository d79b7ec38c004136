"""
Which joints have a Gaussian process beside links and friction, or instead of them.

Its length scale and noise are not chosen by likelihood, which takes correlated residuals for
signal, but by the prediction of left-out samples, joint by joint, as is whether there is a process
at all. Left out are contiguous blocks of time, and the lowest and the highest positions of the
joint: a model must also extrapolate.

"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.statistics import contiguous_blocks
from lip_id_ros.model.remainder import (
    correlation,
    FRICTION_VARIANCE,
    Inputs,
    Remainder,
    stored_inputs,
    stored_weights,
)

MOST_SAMPLES = 300
"""Of the processes."""

BLOCKS = 6
EXTREME = 1.0 / 6.0
"""Share of the samples at each end of a joint's positions that are left out together."""

LENGTHS = (1.0, 2.0, 4.0)
"""Length scales that are tried, in standard deviations times the root of the number of inputs."""

NOISES = (0.1, 1.0)
"""Variances of the noise that are tried, in variances of the process."""

LEAST_GAIN = 0.1
"""Least decrease of the logarithm of left-out errors for which a joint has a process."""

NOTHING = 1e-3
"""Left-out errors, as a share of the torque's deviation, below which nothing is left to learn."""

LEAST_ERRORS = 2.0
"""Least mean decrease of those logarithms over the folds, in its standard errors."""


@dataclass(frozen=True, eq=False)
class Fold:
    """
    Samples that are left out together.

    Attributes
    ----------
    out : bool array, shape (M,)
    residual : array, shape (M, n)
        Of links and friction that were fitted without these samples [N m or N].
    joint : int
        The joint to which the fold matters; -1 for all.

    """

    out: BoolArray
    residual: Array
    joint: int


@dataclass(frozen=True, eq=False)
class Choice:
    """
    A process of one joint, and how well left-out samples are predicted with it.

    Attributes
    ----------
    replaces : bool
    length, noise : float
    left_out_std : float
        Root mean square error of left-out blocks of time [N m or N].
    score : float
        Logarithm of root mean squared errors, averaged over the two kinds of folds.

    """

    replaces: bool
    length: float
    noise: float
    left_out_std: float
    score: float


def fold_masks(q: Array, number_of_samples: int, rows: IndexArray) -> list[tuple[BoolArray, int]]:
    """
    Return what to leave out, with the joint that it matters to: blocks of time, extreme positions.

    Parameters
    ----------
    q : array, shape (M, n)
    number_of_samples : int
        Of the whole data set.
    rows : int array, shape (M,)
        Of the samples in the data set, which is in the order of time.

    """
    block = contiguous_blocks(number_of_samples, BLOCKS)[rows]
    masks: list[tuple[BoolArray, int]] = [(block == k, -1) for k in np.unique(block)]
    low, high = np.quantile(q, (EXTREME, 1.0 - EXTREME), axis=0)
    for joint in range(q.shape[1]):
        masks += [(q[:, joint] <= low[joint], joint), (q[:, joint] >= high[joint], joint)]
    return [(mask, joint) for mask, joint in masks if 0 < mask.sum() < 0.7 * len(q)]


class RemainderElection:
    """
    Election of processes, joint by joint.

    Parameters
    ----------
    inputs : Inputs
    q, dq, ddq, tau : arrays, shape (M, n)
    residual : array, shape (M, n)
        Of links and friction fitted to all [N m or N].
    folds : sequence of Fold

    """

    def __init__(
        self,
        inputs: Inputs,
        state: tuple[Array, Array, Array],
        tau: Array,
        residual: Array,
        folds: Sequence[Fold],
    ) -> None:
        self._inputs, self._tau, self._residual, self._folds = inputs, tau, residual, folds
        self._x = stored_inputs(inputs(*state))
        self._friction = inputs.friction(state[1])
        self._grams = {length: correlation(self._x, self._x, length) for length in LENGTHS}

    def elect(self) -> Remainder | None:
        """Return the processes that predict better than links and friction alone, if any."""
        n = self._tau.shape[1]
        shape = (len(self._x), n)
        length, noise, variance, left_out_std = np.zeros((4, n))
        replaces = np.zeros(n, dtype=bool)
        alpha, friction = np.zeros(shape), np.zeros((n, 3))
        for joint in range(n):
            choice = self.chosen(joint)
            if choice is None:
                continue
            length[joint], noise[joint] = choice.length, choice.noise
            replaces[joint] = choice.replaces
            left_out_std[joint] = choice.left_out_std
            target = (self._tau if choice.replaces else self._residual)[:, joint]
            gram = self._gram(choice, joint) + choice.noise * np.eye(len(target))
            alpha[:, joint] = stored_weights(cho_solve(cho_factor(gram, lower=True), target))
            variance[joint] = float(target @ alpha[:, joint]) / len(target)
            if choice.replaces:
                friction[joint] = FRICTION_VARIANCE * self._friction[:, joint].T @ alpha[:, joint]
        if not length.any():
            return None
        scales = length, noise, variance, left_out_std
        return Remainder(self._inputs, self._x, *scales, replaces, alpha, friction)

    def chosen(self, joint: int) -> Choice | None:
        """Return the process of one joint; None where it is better off without."""
        left_out_std, alone = self._measured(joint, None)
        if left_out_std < NOTHING * self._tau[:, joint].std():
            return None
        beside, instead = (
            min(self._choices(joint, replaces), key=lambda each: each.score)
            for replaces in (False, True)
        )
        # Links have to earn their place where a process does without them.
        best = instead if instead.score < beside.score + LEAST_GAIN else beside
        if best.score < alone - LEAST_GAIN and self._errors(joint, best) >= LEAST_ERRORS:
            return best
        return None

    def _errors(self, joint: int, choice: Choice) -> float:
        """Return the mean gain of a process over the folds in its standard errors."""
        folds = [fold for fold in self._folds if fold.joint in (-1, joint)]
        gains = np.log(
            [
                self._left_out(fold, joint, None)
                / max(self._left_out(fold, joint, choice), 1e-300)
                for fold in folds
            ]
        )
        error = float(gains.std(ddof=1) / np.sqrt(gains.size))
        return float(gains.mean() / max(error, 1e-300))

    def _choices(self, joint: int, replaces: bool) -> Iterator[Choice]:
        for length in LENGTHS:
            for noise in NOISES:
                choice = Choice(replaces, length, noise, 0.0, 0.0)
                block_std, score = self._measured(joint, choice)
                yield replace(choice, left_out_std=block_std, score=score)

    def _measured(self, joint: int, choice: Choice | None) -> tuple[float, float]:
        """Return the left-out deviation in blocks of time, and the score."""
        squares: dict[bool, list[float]] = {False: [], True: []}
        for fold in self._folds:
            if fold.joint in (-1, joint):
                squares[fold.joint >= 0].append(self._left_out(fold, joint, choice))
        means = [np.mean(each) for each in squares.values() if each]
        score = 0.5 * np.mean(np.log(np.maximum(means, 1e-300)))
        return float(np.sqrt(means[0])), float(score)

    def _left_out(self, fold: Fold, joint: int, choice: Choice | None) -> float:
        """Return the mean squared error of the samples of a fold."""
        out = fold.out
        if choice is None:
            return float(np.mean(fold.residual[out, joint] ** 2))
        target = (self._tau if choice.replaces else fold.residual)[:, joint]
        gram = self._gram(choice, joint)
        known = gram[np.ix_(~out, ~out)] + choice.noise * np.eye(int(np.sum(~out)))
        alpha = cho_solve(cho_factor(known, lower=True), target[~out])
        error = target[out] - gram[np.ix_(out, ~out)] @ alpha
        return float(np.mean(error**2))

    def _gram(self, choice: Choice, joint: int) -> Array:
        gram = self._grams[choice.length]
        if not choice.replaces:
            return gram
        own = self._friction[:, joint]
        return np.asarray(gram + FRICTION_VARIANCE * own @ own.T)


def elect_remainder(fitter: ArmFitter, fit: ArmFit) -> Remainder | None:
    """
    Return the processes that predict better than links and friction alone, if any.

    Parameters
    ----------
    fitter : ArmFitter
    fit : ArmFit
        To all samples.

    """
    count = fitter.dataset.n_samples
    rows = np.unique(np.linspace(0, count - 1, MOST_SAMPLES).astype(np.intp))
    some = fitter.dataset.select(rows)
    state = some.q, some.dq, some.ddq
    revolute = np.array([kind == 'revolute' for kind in some.joint_types])
    masks = fold_masks(some.q, count, rows)
    residual = some.tau - fitter.problem(some, fit).torque(fit.state)
    folds = left_out_fits(fitter, fit, rows, masks)
    inputs = Inputs.of(revolute, *state)
    return RemainderElection(inputs, state, some.tau, residual, folds).elect()


def left_out_fits(
    fitter: ArmFitter, fit: ArmFit, rows: IndexArray, masks: Sequence[tuple[BoolArray, int]]
) -> list[Fold]:
    """Fit links and friction without each fold, by one Gauss-Newton step from the fit to all."""
    some = fitter.dataset.select(rows)
    problem = fitter.problem(some, fit)
    jacobian = problem.jacobian(fit.state)
    residual = some.tau - problem.torque(fit.state)
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
        step = cho_solve(cho_factor(normal), rest.T @ target[~out].ravel() - prior)
        folds.append(Fold(out, residual - jacobian @ step, joint))
    return folds
