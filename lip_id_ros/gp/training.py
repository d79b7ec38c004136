"""Marginal likelihood and its gradient; hyperparameters, maximum a posteriori by L-BFGS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import count
from typing import NamedTuple, Protocol

import numpy as np
from scipy.optimize import minimize, OptimizeResult

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.errors import FitError
from lip_id_ros.kernels import Hyperparameters, JointStates, TorqueKernel, TorquePrior
from lip_id_ros.kernels.gram import contracted_gradient
from lip_id_ros.kernels.torque_process import friction_gradient
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.progress import Progress, silent


class Likelihood(Protocol):
    """What the optimisation needs of a likelihood."""

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """Return the negative logarithm at log-hyperparameters (p,), and its gradient (p,)."""


@dataclass(frozen=True)
class MarginalLikelihood:
    """
    Negative log marginal likelihood of torques (N, n) as a function of the log-hyperparameters.

    `like` gives their shapes.
    """

    kernel: TorqueKernel
    states: JointStates
    tau: Array
    like: Hyperparameters

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """
        Evaluate at log-hyperparameters (p,), constant included; the gradient has shape (p,).

        FitError if the Gram matrix cannot be factorised.
        """
        at = self.like.with_vector(vector)
        prior = TorquePrior(self.kernel, at)
        factor = CholeskyFactor.of(prior.noisy_gram(self.states))
        y = self.tau.ravel()
        alpha = factor.solve(y)
        constant = 0.5 * len(y) * np.log(2.0 * np.pi)
        value = 0.5 * float(y @ alpha) + 0.5 * factor.log_determinant() + constant
        contraction = factor.inverse()
        contraction -= np.multiply.outer(alpha, alpha)
        contraction *= 0.5
        return value, at.log_gradient(self._gradient(at, contraction))

    def _gradient(self, at: Hyperparameters, contraction: Array) -> Hyperparameters:
        n = self.tau.shape[1]
        weights = contracted_gradient(
            self.kernel.energy, at.weights, self.states.packed, contraction
        )
        blocks = np.stack([contraction[i::n, i::n] for i in range(n)])
        features = self.states.friction
        friction = None if features is None else friction_gradient(features, blocks)
        return Hyperparameters(weights, friction, np.einsum('itt->i', blocks))


RANGE = np.log(1e6)
"""How far a hyperparameter may go from where it starts, up or down."""

ALIKE = 3.0
"""Precision of the prior on how far the weights of a joint's cosine and sine are apart."""

FAR_WORSE = 10.0
"""Increase of the worst value so far, relative, at a step that cannot be evaluated."""

ValueAndGradient = Callable[[Array], tuple[float, Array]]

STAGE = 'hyperparameters'


@dataclass(frozen=True)
class Objective:
    """
    Negative log posterior of the log-hyperparameters, up to a constant.

    `centre`: of the Gaussian prior on their logarithms. `prior_precision`: of each logarithm; 0
    for plain maximum likelihood. The noise has no prior. Where a joint's zero is does not matter
    to a robot: a prior also takes cosine and sine for alike (`ALIKE`).
    """

    likelihood: Likelihood
    centre: Hyperparameters
    prior_precision: float

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """Evaluate at one vector of log-hyperparameters, shape (p,)."""
        value, gradient = self.likelihood.value_and_gradient(vector)
        return value + self.penalty(vector), gradient + self._penalty_gradient(vector)

    def penalty(self, vector: Array) -> float:
        """Return what the prior adds to the negative log likelihood."""
        away = self._away(vector)
        apart = self._apart(away)
        return 0.5 * (
            self.prior_precision * float(away @ away) + self._alike * float(apart @ apart)
        )

    def _penalty_gradient(self, vector: Array) -> Array:
        away = self._away(vector)
        gradient = self.prior_precision * away
        cosines, sines = self._pairs
        pull = self._alike * self._apart(away)
        gradient[cosines] += pull
        gradient[sines] -= pull
        return gradient

    @property
    def _alike(self) -> float:
        return ALIKE if self.prior_precision > 0.0 else 0.0

    @cached_property
    def _pairs(self) -> tuple[IntArray, IntArray]:
        return self.centre.cosines_and_sines()

    def _apart(self, away: Array) -> Array:
        cosines, sines = self._pairs
        return away[cosines] - away[sines]

    def _away(self, vector: Array) -> Array:
        away = vector - self.centre.vector()
        away[-self.centre.noise_variance.size :] = 0.0
        return away


@dataclass(frozen=True)
class Optimum:
    """
    Result of an optimisation.

    `value`: of the objective.
    `negative_log_likelihood`: on the samples that were optimised on.
    `converged`: False where the iterations ran out first.
    `message`: the optimiser's own words.
    `at_bounds`: hyperparameters that ran to a bound.
    `rejected`: steps that led where the Gram matrix cannot be factorised, and were shortened.
    """

    hyperparameters: Hyperparameters
    value: float
    negative_log_likelihood: float
    iterations: int
    converged: bool
    message: str
    at_bounds: tuple[str, ...]
    rejected: int


def maximise(
    objective: Objective,
    start: Hyperparameters,
    iterations: int,
    progress: Progress = silent,
    stage: str = STAGE,
) -> Optimum:
    """
    Maximise the posterior of the log-hyperparameters by L-BFGS; 0 iterations keep the start.

    FitError if the Gram matrix cannot be factorised at the start.
    """
    first, centre = start.vector(), objective.centre.vector()
    found = minimise(
        objective.value_and_gradient, first, centre, iterations, partial(progress, stage)
    )
    likelihood, _ = objective.likelihood.value_and_gradient(found.vector)
    labels = zip(start.names(), found.at_bounds.tolist(), strict=True)
    return Optimum(
        hyperparameters=start.with_vector(found.vector),
        value=likelihood + objective.penalty(found.vector),
        negative_log_likelihood=likelihood,
        iterations=found.iterations,
        converged=found.converged,
        message=found.message,
        at_bounds=tuple(label for label, hit in labels if hit),
        rejected=found.rejected,
    )


class Minimum(NamedTuple):
    """Where a minimisation ended, shapes (p,); the rest as in `Optimum`."""

    vector: Array
    at_bounds: BoolArray
    iterations: int
    converged: bool
    message: str
    rejected: int


def minimise(
    function: ValueAndGradient,
    start: Array,
    centre: Array,
    iterations: int,
    report: Callable[[int, int], None],
) -> Minimum:
    """
    Minimise a function of log-hyperparameters (p,) by L-BFGS, within `RANGE` of a centre.

    `function`: value and gradient at a vector (p,); FitError where it has none. `iterations`: at
    most; 0 keeps the start. `report`: gets the iterations that are done, and their largest number.
    FitError if the function has no value at the start.
    """
    guarded, counter = _Guarded(function), count(1)
    report(0, iterations)
    bounds = np.column_stack([centre - RANGE, centre + RANGE])
    result = OptimizeResult(x=start, nit=0, success=False, message='no iterations asked for')
    if iterations > 0:  # else L-BFGS would still take one
        result = minimize(
            guarded,
            start,
            jac=True,
            method='L-BFGS-B',
            bounds=bounds,
            callback=lambda _: report(next(counter), iterations),
            options={'maxiter': iterations, 'maxcor': 30, 'maxfun': 4 * iterations},
        )
    report(iterations, iterations)
    found = np.asarray(result.x)
    close: BoolArray = np.isclose(found[:, None], bounds).any(axis=1)
    converged, message = bool(result.success), str(result.message)
    return Minimum(found, close, int(result.nit), converged, message, guarded.rejected)


class _Guarded:
    """A function for a line search: a step too far is a bad step, not the end of the fit."""

    def __init__(self, function: ValueAndGradient) -> None:
        self._function = function
        self._worst: float | None = None
        self.rejected = 0

    def __call__(self, vector: Array) -> tuple[float, Array]:
        try:
            value, gradient = self._function(vector)
        except FitError:
            if self._worst is None:
                raise
            self.rejected += 1
            return self._worst + FAR_WORSE * (1.0 + abs(self._worst)), np.zeros_like(vector)
        self._worst = value if self._worst is None else max(value, self._worst)
        return value, gradient
