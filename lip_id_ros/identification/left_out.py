"""
Prediction of left-out blocks by torque models that are linear in parameters, some not negative.

Cross-validation over contiguous blocks, since residuals are correlated in time (Roberts and
others, Ecography 2017). All of it is done on statistics in square-root form: a fit without a block
costs one small triangular factorisation, a fit with one more term an even smaller one.

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import nnls

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.identification.statistics import (
    leave_one_out,
    posterior_root,
    TorqueStatistics,
    triangular,
)

LEFT_OUT_TOGETHER = (1, 2)
"""Numbers of neighbouring blocks that are left out together: two schemes of folds."""

INITIAL_NOISE = 0.05
"""Noise of the first fit, as a share of each torque's standard deviation."""

LEAST_NOISE = 1e-4
"""Least noise, likewise."""

NOISE_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class LeftOutFit:
    """
    A fit to all samples, and its errors where parts of them were left out.

    Attributes
    ----------
    parameters : array, shape (P,)
        From all samples; zero where not selected.
    left_out : tuple of K_1 arrays, shapes (P,)
        From the samples outside each single block.
    squares : tuple of arrays, shapes (K_s, n)
        For every scheme of folds, squared residuals of the left-out parts, weighted so that their
        mean is that of all samples.

    """

    parameters: Array
    left_out: tuple[Array, ...]
    squares: tuple[Array, ...]

    @property
    def mean_squares(self) -> Array:
        """Mean squared residuals over single left-out blocks, shape (n,)."""
        return self.squares[0].mean(axis=0)

    def gain(self, other: LeftOutFit) -> tuple[float, float, float]:
        """
        Compare with a fit that has more terms.

        Returns
        -------
        mean, least, error : floats
            Relative decrease of mean squares, summed over joints: the mean over schemes of folds,
            the least of them, and the standard error over the blocks of the first scheme.

        """
        gains = [
            float(np.log(mine.mean(axis=0) / its.mean(axis=0)).sum())
            for mine, its in zip(self.squares, other.squares, strict=True)
        ]
        change = ((self.squares[0] - other.squares[0]) / self.mean_squares).sum(axis=1)
        error = float(change.std(ddof=1) / np.sqrt(len(change)))
        return float(np.mean(gains)), min(gains), error


class LeftOutBlocks:
    """
    Fits with any selection of parameters, to all samples and without parts of them.

    Parameters
    ----------
    blocks : sequence of TorqueStatistics, at least 2
        Of contiguous stretches of time of nearly equal size.
    prior_std : array, shape (P,)
        Prior standard deviations of the parameters around zero.
    lower : array, shape (P,)
        Lower bounds of the parameters: minus infinity, or zero.
    torque_std : array, shape (n,)
        Standard deviations of the torques [N m or N].

    """

    def __init__(
        self,
        blocks: Sequence[TorqueStatistics],
        prior_std: Array,
        lower: Array,
        torque_std: Array,
    ) -> None:
        self.whole = blocks[0].merge(*blocks[1:])
        self._prior_std, self._free = prior_std, np.isneginf(lower)
        self._torque_std = np.where(torque_std > 0.0, torque_std, 1.0)
        self._schemes = [
            list(zip(parts, leave_one_out(parts), strict=True))
            for parts in (_joined(blocks, size) for size in LEFT_OUT_TOGETHER)
            if len(parts) > 1
        ]

    def fit(self, selected: IndexArray, noise_std: Array) -> LeftOutFit:
        """Fit the selected parameters, with given noise per joint (n,)."""
        return self._measured(
            self._solve(self.whole, selected, noise_std),
            [
                [self._solve(others, selected, noise_std) for _, others in scheme]
                for scheme in self._schemes
            ],
        )

    def noise(self, selected: IndexArray) -> Array:
        """Estimate the noise of every joint by the root mean square of left-out residuals."""
        noise = INITIAL_NOISE * self._torque_std
        for _ in range(NOISE_ROUNDS):
            squares = self.fit(selected, noise).mean_squares
            noise = np.maximum(np.sqrt(squares), LEAST_NOISE * self._torque_std)
        return noise

    def with_each(
        self, selected: IndexArray, groups: Sequence[IndexArray], noise_std: Array
    ) -> list[LeftOutFit]:
        """Return the fits with one more group of parameters each."""
        whole = self._reduced(self.whole, selected, noise_std)
        folds = [
            [self._reduced(others, selected, noise_std) for _, others in scheme]
            for scheme in self._schemes
        ]
        return [
            self._measured(
                whole.solve_with(group),
                [[each.solve_with(group) for each in scheme] for scheme in folds],
            )
            for group in groups
        ]

    def _solve(self, statistics: TorqueStatistics, selected: IndexArray, noise: Array) -> Array:
        free = self._free[selected]
        ordered = np.concatenate([selected[free], selected[~free]])
        root = posterior_root(statistics.system(noise, ordered), self._prior_std[ordered])
        theta = np.zeros(self._prior_std.size)
        theta[ordered] = bounded_solution(root, int(free.sum()))
        return theta

    def _reduced(
        self, statistics: TorqueStatistics, selected: IndexArray, noise: Array
    ) -> _Reduced:
        free = self._free[selected]
        rest = np.setdiff1d(np.arange(self._prior_std.size), selected)
        ordered = np.concatenate([selected[free], selected[~free], rest])
        root = posterior_root(statistics.system(noise, ordered), self._prior_std[ordered])
        return _Reduced(root, ordered, int(free.sum()), selected.size, self._free)

    def _measured(self, parameters: Array, thetas: list[list[Array]]) -> LeftOutFit:
        squares = tuple(
            _squares([part for part, _ in scheme], each)
            for scheme, each in zip(self._schemes, thetas, strict=True)
        )
        return LeftOutFit(parameters, tuple(thetas[0]), squares)


class _Reduced:
    """Triangular system with the selected parameters first, those without bounds before all."""

    def __init__(
        self, root: Array, ordered: IndexArray, n_free: int, n_selected: int, free: BoolArray
    ) -> None:
        self._root, self._ordered, self._free = root, ordered, free
        self._n_free, self._n_selected = n_free, n_selected
        self._place = np.empty_like(ordered)
        self._place[ordered] = np.arange(ordered.size)

    def solve_with(self, group: IndexArray) -> Array:
        """Return the parameters of the fit with some more, shape (P,)."""
        f, p = self._n_free, self._ordered.size
        free = self._free[group]
        bounded = np.append(np.arange(f, self._n_selected), self._place[group[~free]])
        at = np.append(self._place[group[free]], bounded)
        x = bounded_solution(triangular(self._root[f:, np.append(at, p)]), int(free.sum()))
        right = self._root[:f, p] - self._root[:f, at] @ x
        theta = np.zeros(p)
        theta[self._ordered[at]] = x
        theta[self._ordered[:f]] = solve_triangular(self._root[:f, :f], right)
        return theta


def bounded_solution(root: Array, n_free: int) -> Array:
    """
    Least squares where the parameters after the first ones are not negative.

    The first ones are eliminated by the triangular form; the others are solved for by the
    algorithm of Lawson and Hanson, 1974.

    Parameters
    ----------
    root : array, shape (p + 1, p + 1)
        Upper triangular factor of the rows [features, torque]; its first p columns of full rank.
    n_free : int
        Number of parameters without bounds, which come first.

    Returns
    -------
    array, shape (p,)

    """
    f, p = n_free, len(root) - 1
    x = np.zeros(p)
    if p > f:
        x[f:], _ = nnls(root[f:p, f:p], root[f:p, p])
    if f:
        x[:f] = solve_triangular(root[:f, :f], root[:f, p] - root[:f, f:p] @ x[f:])
    return x


def _joined(blocks: Sequence[TorqueStatistics], size: int) -> list[TorqueStatistics]:
    """Merge neighbouring blocks, so many at a time."""
    parts = [blocks[k : k + size] for k in range(0, len(blocks), size)]
    return [part[0].merge(*part[1:]) for part in parts]


def _squares(parts: Sequence[TorqueStatistics], thetas: Sequence[Array]) -> Array:
    weights = np.mean([part.weights for part in parts], axis=0)
    sums = [part.squared_residuals(theta) for part, theta in zip(parts, thetas, strict=True)]
    return np.asarray(np.array(sums) / weights)
