"""
Length scales and weights of a Gaussian process beside links and friction.

Length scales by marginal likelihood (Rasmussen and Williams 2006, 5.1 and 5.4.1); weights of few
samples whose mean is nearly that of all (power function and Newton basis: Mueller and Schaback, J.
Approximation Theory 2009).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.model.residual_gp import correlation, near_and_beyond

TYPICAL = 1.5
"""Prior median of a length scale, in roots of the number of inputs, which have unit variance."""

SHORTEST, LONGEST = 0.1, 1e3
LEAST_NOISE, MOST_NOISE, FIRST_NOISE = 1e-5, 10.0, 1e-2
"""Variances of the noise, in those of the process."""

MOST_ITERATIONS = 60


def likeliest(x: Array, y: Array, known: Array) -> tuple[Array, float]:
    """
    Return length scales (d,) and noise of greatest posterior probability.

    Inputs x (M, d) have unit variance, y (M,) is not zero everywhere; noise and the known
    covariance (M, M), which is added, are in variances of the process.
    """
    start = np.append(np.full(x.shape[1], _typical(x)), np.log(FIRST_NOISE))
    bounds = [(np.log(SHORTEST), np.log(LONGEST))] * x.shape[1]
    found = minimize(
        negative_log_posterior,
        start,
        args=(x, y, known),
        jac=True,
        method='L-BFGS-B',
        bounds=[*bounds, (np.log(LEAST_NOISE), np.log(MOST_NOISE))],
        options={'maxiter': MOST_ITERATIONS},
    )
    return np.exp(found.x[:-1]), float(np.exp(found.x[-1]))


def negative_log_posterior(theta: Array, x: Array, y: Array, known: Array) -> tuple[float, Array]:
    """
    Return the negative log posterior density up to a constant, and its gradient (d + 1,).

    `theta` has the logarithms of length scales and noise; the rest is as in `likeliest`.
    """
    lengths, noise = np.exp(theta[:-1]), np.exp(theta[-1])
    process = correlation(x, x, lengths)
    gram = process + known
    gram[np.diag_indices_from(gram)] += noise
    factor = cho_factor(gram, lower=True)
    alpha = cho_solve(factor, y)
    scale = len(y) / float(y @ alpha)
    slope = 0.5 * (cho_solve(factor, np.eye(len(y))) - scale * np.outer(alpha, alpha))
    weights = slope * process
    # the sum over pairs of weights times squared differences, input by input
    squares = 2.0 * (weights.sum(axis=1) @ x**2 - np.sum(x * (weights @ x), axis=0))
    excess = theta[:-1] - _typical(x)
    value = np.log(np.diag(factor[0])).sum() - 0.5 * len(y) * np.log(scale) + 0.5 * excess @ excess
    gradient = np.append(squares / lengths**2 + excess, noise * np.trace(slope))
    return float(value), gradient


def _typical(x: Array) -> float:
    return float(np.log(TYPICAL * np.sqrt(x.shape[1])))


LEAST_VARIANCE = 1e-7
"""Share of its variance below which a sample is known from those before it."""

ROUNDING = 1e-3
"""Of errors, in tolerances."""


def sparse_weights(x: Array, lengths: Array, alpha: Array, tolerance: Array) -> Array:
    """
    Return weights (M, k), most of them zero, whose k means are nearly those of all samples.

    From inputs (M, d) with length scales (d,), weights alpha (M, k) and the tolerance (k,) by
    which each mean may differ at the samples, near to them, between and beyond [N m or N]. Returns
    `alpha` where rounding does not allow for less.
    """
    cross = correlation(x, near_and_beyond(x), lengths)  # the first M columns are the samples
    means = cross.T @ (alpha / tolerance)
    chosen = _interpolating(cross, means)
    gram = cross[np.ix_(chosen, chosen)]
    weights = cho_solve(cho_factor(gram, lower=True), means[chosen])
    if np.abs(cross[chosen].T @ weights - means).max(initial=0.0) > 1.0 + ROUNDING:
        return alpha
    out = np.zeros_like(alpha)
    out[chosen] = weights * tolerance
    return out


def _interpolating(cross: Array, means: Array) -> IndexArray:
    """Return samples at whose values means are known to 1 everywhere."""
    count = len(cross)
    chosen: list[int] = []
    missing, variance, basis = means.copy(), np.ones(len(means)), np.empty_like(cross)
    while np.abs(missing).max() > 1.0 and len(chosen) < count:
        known = variance[:count] < LEAST_VARIANCE
        norm = np.max(missing[:count] ** 2, axis=1) / np.where(known, np.inf, variance[:count])
        best, size = int(np.argmax(norm)), len(chosen)
        if norm[best] == 0.0:
            break
        row = cross[best] - basis[:size, best] @ basis[:size]
        basis[size] = row / np.sqrt(variance[best])
        missing -= np.outer(row, missing[best] / variance[best])
        variance = variance - basis[size] ** 2
        chosen.append(best)
    return np.array(chosen, dtype=np.intp)
