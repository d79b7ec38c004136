"""Errors, noise and inflation of the covariance by left-out parts (maths.md, section 13)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.linear_algebra import CholeskyFactor

MOST_INFLATION = 1e4

LEAST_FREEDOM = 0.1
"""Least share of the samples that counts as left after the parameters."""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """
    What left-out blocks show.

    Block squares are weighted, as shares of all samples times the number of blocks [(N m)^2 or
    N^2].
    """

    block_squares: Array  # (K, n)
    inflation: float  # of the covariance that explains these; at least 1
    noise_std: Array  # (n,), of what the covariance does not explain [N m or N]
    unbiased_std: Array  # (n,), of the fit, with degrees of freedom [N m or N]

    @property
    def mean_squares(self) -> Array:
        """Mean squared residuals of blocks that were left out, (n,) [(N m)^2 or N^2]."""
        return np.asarray(self.block_squares.mean(axis=0))


def measure_left_out(
    blocks: Sequence[TorqueStatistics], prior: Array, noise_std: Array
) -> LeftOut:
    """
    Predict each block from the others.

    Statistics are of Jacobian and residuals, in which all joints have all parameters; rows of the
    prior (m, m + 1) in its deviations; `noise_std`, shape (n,), are root mean squares of the
    residuals [N m or N].
    """
    grams = np.array([[r.T @ r for r in block.factors] for block in blocks])
    count = np.sum([block.counts for block in blocks], axis=0)
    _, covariance = solved(grams.sum(axis=0), prior, noise_std)
    noise_std = _unbiased(noise_std, _spread(grams.sum(axis=0), covariance) / count)
    squares, expected = np.zeros((len(blocks), noise_std.size)), np.zeros(noise_std.size)
    for k, block in enumerate(blocks):
        step, covariance = solved(grams.sum(axis=0) - grams[k], prior, noise_std)
        squares[k] = block.squared_residuals(step)
        expected += _spread(grams[k], covariance)
    variance = noise_std**2
    total = squares.sum(axis=0)
    excess = np.sum(total / variance - count)
    inflation = float(np.clip(excess / np.sum(expected / variance), 1.0, MOST_INFLATION))
    unexplained = (total - inflation * expected) / count
    left_std = np.sqrt(np.maximum(unexplained, variance))
    return LeftOut(len(blocks) * squares / count, inflation, left_std, noise_std)


def solved(grams: Array, prior: Array, noise_std: Array) -> tuple[Array, Array]:
    """Return parameters and covariance from the Gram matrices of all joints' rows."""
    normal = np.tensordot(noise_std**-2.0, grams, axes=1) + prior.T @ prior
    factor = CholeskyFactor.of(np.ascontiguousarray(normal[:-1, :-1]))
    return factor.solve(normal[:-1, -1]), factor.inverse()


def _spread(grams: Array, covariance: Array) -> Array:
    """Return the sums of variances of the torques that a covariance of parameters makes, (n,)."""
    return np.asarray(np.einsum('iab,ab->i', grams[:, :-1, :-1], covariance))


def _unbiased(noise_std: Array, variance: Array) -> Array:
    """Return the noise with the degrees of freedom that the parameters took, shape (n,)."""
    share = variance / noise_std**2
    return np.asarray(noise_std / np.sqrt(np.maximum(1.0 - share, LEAST_FREEDOM)))
