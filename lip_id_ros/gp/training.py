"""Optimisation of the hyperparameters: maximum a posteriori by L-BFGS."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize, OptimizeResult

from lip_id_ros.gp.likelihood import MarginalLikelihood
from lip_id_ros.gp.log_vector import from_vector, names, to_vector
from lip_id_ros.kernels import Hyperparameters
from lip_id_ros.progress import Progress, silent

Array = NDArray[np.float64]

RANGE = np.log(1e6)
"""How far a hyperparameter may go from where it starts, up or down."""

STAGE = 'hyperparameters'


@dataclass(frozen=True)
class Optimum:
    """
    Result of an optimisation.

    Attributes
    ----------
    hyperparameters : Hyperparameters
    negative_log_likelihood : float
        At the optimum, on the samples that were optimised on.
    iterations : int
    converged : bool
        False where the iterations ran out first.
    message : str
        The optimiser's own words.
    at_bounds : tuple of str
        Hyperparameters that ran to a bound.

    """

    hyperparameters: Hyperparameters
    negative_log_likelihood: float
    iterations: int
    converged: bool
    message: str
    at_bounds: tuple[str, ...]


def maximise(
    likelihood: MarginalLikelihood,
    start: Hyperparameters,
    iterations: int,
    prior_precision: float,
    progress: Progress = silent,
) -> Optimum:
    """
    Maximise the posterior of the log-hyperparameters.

    Their prior is a weak Gaussian around their start.

    Parameters
    ----------
    likelihood : MarginalLikelihood
    start : Hyperparameters
        Also the centre of the prior.
    iterations : int
        Most iterations of L-BFGS; 0 keeps the start.
    prior_precision : float
        Of each log-hyperparameter; 0 for plain maximum likelihood. The noise has no prior.
    progress : callable

    Raises
    ------
    FitError
        If a Gram matrix cannot be factorised.

    """
    centre = to_vector(start)
    precision = np.full_like(centre, prior_precision)
    precision[-start.noise_variance.size :] = 0.0

    def objective(vector: Array) -> tuple[float, Array]:
        value, gradient = likelihood.value_and_gradient(vector)
        away = vector - centre
        return value + 0.5 * float(precision @ away**2), gradient + precision * away

    done = 0

    def report(_: Array) -> None:
        nonlocal done
        done += 1
        progress(STAGE, done, iterations)

    progress(STAGE, 0, iterations)
    bounds = np.column_stack([centre - RANGE, centre + RANGE])
    result = OptimizeResult(x=centre, nit=0, success=False, message='no iterations asked for')
    if iterations > 0:  # else L-BFGS would still take one
        options = {'maxiter': iterations, 'maxcor': 30, 'maxfun': 4 * iterations}
        result = minimize(
            objective, centre, jac=True, method='L-BFGS-B', bounds=bounds, callback=report,
            options=options,
        )  # fmt: skip
    progress(STAGE, iterations, iterations)
    found = np.asarray(result.x)
    value, _ = likelihood.value_and_gradient(found)
    return Optimum(
        hyperparameters=from_vector(found, start),
        negative_log_likelihood=value,
        iterations=int(result.nit),
        converged=bool(result.success),
        message=str(result.message),
        at_bounds=_at_bounds(found, bounds, names(start)),
    )


def _at_bounds(found: Array, bounds: Array, labels: list[str]) -> tuple[str, ...]:
    close = np.isclose(found[:, None], bounds).any(axis=1)
    return tuple(label for label, hit in zip(labels, close, strict=True) if hit)
