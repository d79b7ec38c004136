"""
Posterior means of Gaussian processes by the weights of few samples.

A smooth mean is nearly that which interpolates it at some (power function and Newton basis:
Mueller and Schaback, J. Approximation Theory 2009).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.model.remainder import correlation, near_and_beyond

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
