"""Cholesky factors of Gram matrices and normal equations: the only place that adds jitter."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.linalg import blas, lapack

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.errors import FitError

JITTERS = (0.0, 1e-12, 1e-10, 1e-8, 1e-6)
NOT_FINITE = (
    'the Gram matrix was expected to be finite but is not: '
    'check the data for values beyond what the robot can do.'
)
NOT_POSITIVE_DEFINITE = (
    'the Gram matrix was expected to be positive definite but is not, even with '
    f'{JITTERS[-1]:g} of its mean diagonal added: samples are probably repeated or the '
    'noise variance too small; use fewer, better spread samples.'
)


@dataclass(frozen=True)
class CholeskyFactor:
    """Factor of a symmetric positive definite matrix K."""

    lower: Array  # (m, m): L L^T = K + jitter I; above undefined
    jitter: float  # added to the diagonal [units of K]

    @classmethod
    def of(cls, matrix: Array) -> CholeskyFactor:
        """
        Factorise a symmetric matrix (m, m) in C order, with as little jitter as it takes.

        FitError if the matrix is not finite or not positive definite even with jitter.
        """
        # LAPACK may take a matrix with NaN in it and return NaN.
        if not np.isfinite(matrix.sum()):
            raise FitError(NOT_FINITE)
        scale = float(np.mean(np.diagonal(matrix)))
        for relative in JITTERS:
            work = np.array(matrix.T, order='F')
            np.einsum('ii->i', work)[:] += relative * scale
            lower, info = lapack.dpotrf(work, lower=1, clean=0, overwrite_a=1)
            if info == 0:
                return cls(lower, relative * scale)
        raise FitError(NOT_POSITIVE_DEFINITE)

    def solve(self, y: Array) -> Array:
        """Return K^-1 y for y of shape (m,) or (m, k)."""
        x, _ = lapack.dpotrs(self.lower, y, lower=1)
        return np.asarray(x)

    def half_solve(self, y: Array) -> Array:
        """Return L^-1 y for y of shape (m, k)."""
        return np.asarray(blas.dtrsm(1.0, self.lower, y, lower=1))

    def inverse(self) -> Array:
        """Return K^-1, whole and in C order."""
        half, _ = lapack.dpotri(self.lower, lower=1)
        # A Fortran lower triangle is a C upper one.
        upper = half.T
        return np.asarray(np.triu(upper) + np.triu(upper, 1).T)

    def inverse_blocks(self, cuts: IndexArray) -> list[Array]:
        """Return the blocks of K^-1 on its diagonal, between increasing cuts from 0 to m."""
        root, _ = lapack.dtrtri(self.lower, lower=1)
        # columns of L^-1, zero above its diagonal
        columns = [np.tril(root[first:, first:last]) for first, last in pairwise(cuts)]
        return [each.T @ each for each in columns]

    def log_determinant(self) -> float:
        """Return log det K."""
        return 2.0 * float(np.log(np.diagonal(self.lower)).sum())


def normal_factor(normal: Array) -> Array:
    """
    Return the lower Cholesky factor of normal equations, (m, m).

    Every entry of the diagonal is raised by a share of itself where rounding has made the matrix
    indefinite. NaN where it is not finite.
    """
    for relative in JITTERS:
        work = np.array(normal, order='F')
        work.flat[:: len(work) + 1] *= 1.0 + relative
        factor, info = lapack.dpotrf(work, lower=1, overwrite_a=1)
        if info == 0:
            return np.asarray(factor)
    return np.full_like(normal, np.nan)


def normal_solution(normal: Array, right: Array) -> Array:
    """Return the solution of normal equations by `normal_factor`, shape (m,)."""
    x, _ = lapack.dpotrs(normal_factor(normal), right, lower=1)
    return np.asarray(x)
