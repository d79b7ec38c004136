"""
Square-root statistics of torques that are linear in parameters (maths.md, section 11).

Per joint, the triangular factor R_i of the rows [f_i, tau_i], updated by orthogonal
transformations (Golub and Van Loan, Matrix Computations, 4th ed., 5.3 and 6.5.2), since normal
equations square the condition number. So the noise and the choice of columns stay open. Left-out
parts show errors, noise and the inflation of the covariance (section 13).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack, solve_triangular

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.errors import ShapeError
from lip_id_ros.linear_algebra import CholeskyFactor


@dataclass(frozen=True, eq=False)
class TorqueStatistics:
    """
    Triangular factors of the rows [features, torque] of every joint.

    R_i is upper triangular with a diagonal that is not negative: R_i^T R_i = [F_i, tau_i]^T W_i
    [F_i, tau_i].
    """

    columns: tuple[IndexArray, ...]  # (p_i,), parameters of joint i; joints may share them
    factors: tuple[Array, ...]  # (p_i + 1, p_i + 1)
    counts: Array  # (n,), of samples

    @classmethod
    def empty(cls, columns: Sequence[IndexArray]) -> TorqueStatistics:
        """Return the statistics of no samples."""
        columns = tuple(np.asarray(column, dtype=np.intp) for column in columns)
        factors = tuple(np.zeros((c.size + 1, c.size + 1)) for c in columns)
        return cls(columns, factors, np.zeros(len(columns)))

    @property
    def n_parameters(self) -> int:
        """Number of parameters that the columns refer to."""
        return 1 + max((int(column.max()) for column in self.columns if column.size), default=-1)

    def update(
        self,
        features: Sequence[Array],
        tau: Array,
        weights: Array | None = None,
        counts: Array | None = None,
    ) -> TorqueStatistics:
        """
        Return the statistics with further samples.

        Costs memory for these samples only. Features (N, p_i) of every joint and tau (N, n) [N m
        or N], weights (N, n) of squared residuals, and by how many samples each counts (N, n), as
        an outlier does by less; both 1 where not given. Raises ShapeError if the shapes do not fit
        the columns.
        """
        shapes = [each.shape for each in features]
        expected = [(len(tau), column.size) for column in self.columns]
        if shapes != expected or tau.shape != (len(tau), len(self.columns)):
            raise ShapeError(
                f'features of shapes {expected} and as many torques were expected, but '
                f'{shapes} and {tau.shape} came; give one array per joint.'
            )
        if weights is None:
            weights = np.ones_like(tau)
        factors = []
        for i, factor in enumerate(self.factors):
            root = np.sqrt(weights[:, i : i + 1])
            rows = np.empty((len(tau), len(factor)), order='F')
            np.multiply(features[i], root, out=rows[:, :-1])
            np.multiply(tau[:, i : i + 1], root, out=rows[:, -1:])
            factors.append(triangular(factor, rows))
        taken = np.full(len(self.columns), len(tau)) if counts is None else counts.sum(axis=0)
        return TorqueStatistics(self.columns, tuple(factors), self.counts + taken)

    def squared_residuals(self, parameters: Array) -> Array:
        """Weighted sums (..., n) of squares [(N m)^2 or N^2], for parameters (..., P)."""
        sums = []
        for column, factor in zip(self.columns, self.factors, strict=True):
            residual = parameters[..., column] @ factor[:, :-1].T - factor[:, -1]
            sums.append(np.sum(residual**2, axis=-1))
        return np.stack(sums, axis=-1)

    def system(self, noise_std: Array, selected: IndexArray | None = None) -> Array:
        """
        Triangular factor (s + 1, s + 1) of all joints' rows in units of their noise, shape (n,).

        Of the selected parameters, in this order, and the torques; of all where not given.
        """
        if selected is None:
            selected = np.arange(self.n_parameters)
        place = np.full(self.n_parameters, -1)
        place[selected] = np.arange(selected.size)
        blocks = []
        for column, factor, std in zip(self.columns, self.factors, noise_std, strict=True):
            kept = np.flatnonzero(place[column] >= 0)
            block = np.zeros((len(factor), selected.size + 1))
            block[:, place[column[kept]]] = factor[:, kept] / std
            block[:, -1] = factor[:, -1] / std
            blocks.append(block)
        return triangular(*blocks)


@dataclass(frozen=True, eq=False)
class GaussianPosterior:
    """Posterior of the parameters of a linear model with Gaussian prior and noise."""

    mean: Array  # (P,)
    information_root: Array  # (P, P), upper triangular R, information R^T R

    def variance(self, features: Array) -> Array:
        """Return variances of linear functions of the parameters, features (N, P), shape (N,)."""
        half = solve_triangular(self.information_root, features.T, trans='T', check_finite=False)
        return np.asarray(np.sum(half**2, axis=0))


def posterior(
    statistics: TorqueStatistics,
    noise_std: Array,
    prior_std: Array,
    selected: IndexArray | None = None,
) -> GaussianPosterior:
    """
    Solve for the selected parameters.

    All others are zero. Noise (n,) is in N m or N, `prior_std`, shape (P,) or that of the
    selected, around zero.
    """
    root = posterior_root(statistics.system(noise_std, selected), prior_std)
    mean = solve_triangular(root[:-1, :-1], root[:-1, -1], check_finite=False)
    return GaussianPosterior(mean, root[:-1, :-1])


def posterior_root(system: Array, prior_std: Array) -> Array:
    """Add independent Gaussian priors (p,) around zero to a triangular system (p + 1, p + 1)."""
    prior = np.column_stack([np.diag(1.0 / prior_std), np.zeros(prior_std.size)])
    return triangular(system, prior)


def triangular(*blocks: Array) -> Array:
    """Triangular R of stacked rows A, R^T R = A^T A, with a diagonal that is not negative."""
    size = blocks[0].shape[1]
    some = [each for each in blocks if each.any()]  # rows of zeros take as long as others
    lengths = [len(each) for each in some]
    rows = np.zeros((max(sum(lengths), size), size), order='F')
    for each, end in zip(some, np.cumsum(lengths), strict=True):
        rows[end - len(each) : end] = each
    packed, *_ = lapack.dgeqrf(rows, overwrite_a=1)
    factor = np.triu(packed[:size])
    return np.ascontiguousarray(factor * np.where(np.diagonal(factor) < 0.0, -1.0, 1.0)[:, None])


def contiguous_blocks(n_samples: int, count: int) -> IndexArray:
    """Return the block of every sample, (N,): `count` stretches of time of nearly equal size."""
    return np.arange(n_samples) * min(count, n_samples) // max(n_samples, 1)


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
    count, whole = np.sum([block.counts for block in blocks], axis=0), grams.sum(axis=0)
    parameters, covariance = solved(whole, prior, noise_std)
    inside = _shares(covariance, noise_std, whole) / count
    inflation = score_inflation(grams, parameters, covariance, noise_std, float(inside.mean()))
    white = noise_std / np.sqrt(_freedom(inside))
    squares, outside = np.zeros((len(blocks), noise_std.size)), np.zeros(noise_std.size)
    for k, block in enumerate(blocks):
        step, without = solved(whole - grams[k], prior, white)
        squares[k] = block.squared_residuals(step)
        outside += _shares(without, white, grams[k]) / count
    # correlated noise takes as many times more degrees of freedom
    variance = noise_std**2 / _freedom(inflation * inside)
    left_over = squares.sum(axis=0) / count - inflation * outside * variance
    left_std = np.sqrt(np.maximum(left_over, variance))
    return LeftOut(len(blocks) * squares / count, inflation, left_std, np.sqrt(variance))


def score_inflation(
    grams: Array, parameters: Array, covariance: Array, noise_std: Array, inside: float
) -> float:
    """
    Return how many times the scores of blocks vary more than white noise makes them, at least 1.

    Gram matrices (K, n, m, m) of blocks, and what `solved` gives for their sum; `inside` is the
    share of the noise's variance that parameters take. Scores are slopes of the log likelihood by
    parameters, measured in their covariance (Liang and Zeger, Biometrika 1986; White,
    Econometrica 1982).
    """
    if len(grams) == 1:  # the score of all samples together is that of the prior
        return 1.0
    blocks = np.tensordot(grams, noise_std**-2.0, axes=(1, 0))
    scores = blocks[:, :-1, -1] - blocks[:, :-1, :-1] @ parameters
    shares = covariance @ blocks[:, :-1, :-1]
    # of white noise: tr(C E[u u^T]) with u = F_k^T (e_k - F_k C F^T e)
    left = np.eye(len(covariance)) - shares
    rest = shares.sum(axis=0) - shares
    expected = np.trace((left @ left + rest @ shares) @ shares, axis1=1, axis2=2).sum()
    ratio = float(np.einsum('ka,ab,kb->', scores, covariance, scores) / expected)
    return float(np.clip(ratio / (1.0 + ratio * inside), 1.0, MOST_INFLATION))


def solved(grams: Array, prior: Array, noise_std: Array) -> tuple[Array, Array]:
    """Return parameters and covariance from the Gram matrices of all joints' rows."""
    normal = np.tensordot(noise_std**-2.0, grams, axes=1) + prior.T @ prior
    factor = CholeskyFactor.of(np.ascontiguousarray(normal[:-1, :-1]))
    return factor.solve(normal[:-1, -1]), factor.inverse()


def _shares(covariance: Array, noise_std: Array, shown: Array) -> Array:
    """
    Return sums of variances of torques by a covariance, in units of the noise's variance, (n,).

    `shown`: Gram matrices of the samples of the torques.

    """
    return np.asarray(np.einsum('iab,ab->i', shown[:, :-1, :-1], covariance) / noise_std**2)


def _freedom(share: Array) -> Array:
    """Return the share of samples that is left where parameters take one, shape (n,)."""
    return np.asarray(np.maximum(1.0 - share, LEAST_FREEDOM))
