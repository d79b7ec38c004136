"""
Prediction of left-out blocks by torque models that are linear in parameters, some not negative.

Blocks, since residuals are correlated in time (Roberts and others, Ecography 2017), by statistics:
a fit without a block costs one small Cholesky factorisation.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack
from scipy.optimize import nnls

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.linear_algebra import normal_factor

LEFT_OUT_TOGETHER = (1, 2)
"""Numbers of neighbouring blocks that are left out together: two schemes of folds."""

INITIAL_NOISE = 0.05
"""Noise of the first fit, as a share of each torque's standard deviation."""

LEAST_NOISE = 1e-4
"""Least noise, likewise."""

NOISE_ROUNDS = 3

LEAST_GAIN = 0.05
"""Least relative decrease of left-out mean squares, summed over joints, that is worth a change."""

LEAST_ERRORS = 2.0
"""Least gain in standard errors over the left-out blocks."""

NOTHING_MORE = [np.empty(0, dtype=np.intp)]
"""One empty group of parameters."""


@dataclass(frozen=True)
class Gain:
    """
    How much better one model predicts left-out blocks than another.

    As decrease of the logarithms of mean squares, summed over joints: mean and least over schemes
    of folds, and the standard error over blocks of the first scheme.
    """

    mean: float
    least: float
    error: float

    @classmethod
    def between(cls, now: Sequence[Array], other: Sequence[Array]) -> Gain:
        """Return one model's gain, from mean squares (K_s, n) of left-out parts by scheme."""
        gains = [
            float(np.log(mine.mean(axis=0) / its.mean(axis=0)).sum())
            for mine, its in zip(now, other, strict=True)
        ]
        change = ((now[0] - other[0]) / now[0].mean(axis=0)).sum(axis=1)
        error = float(change.std(ddof=1) / np.sqrt(change.size))
        return cls(float(np.mean(gains)), min(gains), error)

    def is_sure(self, least: float = LEAST_GAIN, errors: float = LEAST_ERRORS) -> bool:
        """Return whether it is large enough, and more than chance may do."""
        return self.mean > max(least, errors * self.error) and self.least > 0.0


@dataclass(frozen=True, eq=False)
class LeftOutFit:
    """A fit to all samples, and its errors where parts of them were left out."""

    parameters: Array  # (P,), from all samples; zero where not selected
    left_out: tuple[Array, ...]  # (P,) without each block
    squares: tuple[Array, ...]  # (K_s, n) of each scheme, with the mean of all samples

    @property
    def mean_squares(self) -> Array:
        """Mean squared residuals over single left-out blocks, shape (n,)."""
        return self.squares[0].mean(axis=0)

    def gain(self, other: LeftOutFit) -> Gain:
        """Return what another fit gains over this one."""
        return Gain.between(self.squares, other.squares)


class LeftOutBlocks:
    """
    Fits with any selection of parameters, to all samples and without parts of them.

    Normal equations are enough here: the prior bounds their condition, and what is selected is
    fitted again. Blocks, at least 2, are of contiguous stretches of nearly equal size;
    `prior_std`, shape (P,), is around zero, `lower` minus infinity or zero, and `torque_std`,
    shape (n,), of the torques [N m or N].
    """

    def __init__(
        self,
        blocks: Sequence[TorqueStatistics],
        prior_std: Array,
        lower: Array,
        torque_std: Array,
    ) -> None:
        self.prior_std, self._free = prior_std, np.isneginf(lower)
        self._torque_std = np.where(torque_std > 0.0, torque_std, 1.0)
        self._parts = [_Part.of(each, prior_std.size) for each in blocks]
        count = len(blocks)
        self._schemes = [
            [list(range(k, min(k + size, count))) for k in range(0, count, size)]
            for size in LEFT_OUT_TOGETHER
            if count > size
        ]

    def fit(self, selected: IndexArray, noise_std: Array) -> LeftOutFit:
        """Fit the selected parameters, with given noise per joint (n,)."""
        (only,) = self.with_each(selected, NOTHING_MORE, noise_std)
        return only

    def noise(self, selected: IndexArray) -> Array:
        """Estimate the noise of every joint by the root mean square of left-out residuals."""
        fits = self._fits(selected, NOTHING_MORE)
        noise = INITIAL_NOISE * self._torque_std
        for _ in range(NOISE_ROUNDS):
            (squares,) = fits.mean_squares(self._schemes[0], noise)
            noise = np.maximum(np.sqrt(squares), LEAST_NOISE * self._torque_std)
        return noise

    def with_each(
        self, selected: IndexArray, groups: Sequence[IndexArray], noise_std: Array
    ) -> list[LeftOutFit]:
        """Return the fits with one more group of parameters each."""
        fits = self._fits(selected, groups)
        parts = fits.normal_equations(noise_std)
        every = fits.placed(fits.solutions(np.sum(parts, axis=0)))
        found = [fits.left_out(scheme, parts) for scheme in self._schemes]
        thetas = [fits.placed(theta) for theta in found[0][0]]
        return [
            LeftOutFit(
                every[g],
                tuple(theta[g] for theta in thetas),
                tuple(squares[:, g] for _, squares in found),
            )
            for g in range(len(groups))
        ]

    def explained(
        self, selected: IndexArray, groups: Sequence[IndexArray], noise_std: Array
    ) -> Array:
        """Return the decrease of the logarithms of mean squares, nothing left out, (groups,)."""
        fits = self._fits(selected, [*NOTHING_MORE, *groups])
        thetas = fits.solutions(np.sum(fits.normal_equations(noise_std), axis=0))
        logs = np.log(np.maximum(fits.squares(range(len(self._parts)), thetas), 1e-300))
        return np.asarray(logs[0].sum() - logs[1:].sum(axis=1))

    def mean_squares(
        self, selected: IndexArray, groups: Sequence[IndexArray], noise_std: Array
    ) -> Array:
        """Return `LeftOutFit.mean_squares` with one more group of parameters each, (groups, n)."""
        return self._fits(selected, groups).mean_squares(self._schemes[0], noise_std)

    def _fits(self, selected: IndexArray, groups: Sequence[IndexArray]) -> _Fits:
        return _Fits(self._parts, self.prior_std, self._free, selected, groups)


class _Fits:
    """
    Fits of the selected parameters with each of some groups, on statistics of these alone.

    Parameters and normal equations are of the Q parameters that any of the fits has.
    """

    def __init__(
        self,
        parts: Sequence[_Part],
        prior_std: Array,
        free: BoolArray,
        selected: IndexArray,
        groups: Sequence[IndexArray],
    ) -> None:
        self._all, self._used = prior_std.size, np.unique(np.concatenate([selected, *groups]))
        self._prior_std, self._free = prior_std[self._used], free[self._used]
        self._parts = [part.among(self._used) for part in parts]
        self._selected = np.searchsorted(self._used, selected)
        self._groups = [np.searchsorted(self._used, group) for group in groups]

    def placed(self, thetas: Array) -> Array:
        """Return parameters (groups, Q) among all of them, shape (groups, P)."""
        out = np.zeros((len(thetas), self._all))
        out[:, self._used] = thetas
        return out

    def normal_equations(self, noise_std: Array) -> Array:
        """Return [F, tau]^T [F, tau] of every block in units of the noise, (K, Q + 1, Q + 1)."""
        return np.array([part.normal_equations(noise_std) for part in self._parts])

    def left_out(self, scheme: list[list[int]], parts: Array) -> tuple[list[Array], Array]:
        """Return parameters without each set of blocks, and mean squares (sets, groups, n)."""
        whole = parts.sum(axis=0)
        thetas = [self.solutions(whole - parts[out].sum(axis=0)) for out in scheme]
        counts = [np.sum([self._parts[k].counts for k in out], axis=0) for out in scheme]
        sums = [self.squares(out, theta) for out, theta in zip(scheme, thetas, strict=True)]
        return thetas, np.asarray(np.array(sums) / np.mean(counts, axis=0))

    def mean_squares(self, scheme: list[list[int]], noise_std: Array) -> Array:
        """Return mean squared errors over the sets of blocks that are left out, (groups, n)."""
        _, squares = self.left_out(scheme, self.normal_equations(noise_std))
        return np.asarray(squares.mean(axis=0))

    def squares(self, blocks: Iterable[int], thetas: Array) -> Array:
        """Return sums of squared residuals of some blocks, shape (groups, n)."""
        return np.asarray(np.sum([self._parts[k].squares(thetas) for k in blocks], axis=0))

    def solutions(self, normal: Array) -> Array:
        """Return the parameters with each group beside the selected ones, (groups, Q)."""
        selected = self._selected
        free = selected[self._free[selected]]
        bounded = selected[~self._free[selected]]
        rest = np.setdiff1d(np.arange(self._prior_std.size), free)
        reduced = _Reduced(normal, self._prior_std, free, rest)
        out = np.zeros((len(self._groups), self._prior_std.size))
        for theta, group in zip(out, self._groups, strict=True):
            own = self._free[group]
            more = np.concatenate([group[own], bounded, group[~own]])
            reduced.solve_into(theta, more, int(own.sum()))
        return out


@dataclass(frozen=True, eq=False)
class _Part:
    """One block of samples, with some of the parameters."""

    counts: Array  # (n,)
    rows: list[Array]  # (rows of a joint, columns + 1), factors of [F, tau]
    products: list[Array]  # (columns + 1, columns + 1), of normal equations
    columns: list[IndexArray]  # parameters of the columns, and `size` for tau
    size: int  # number of parameters

    @classmethod
    def of(cls, statistics: TorqueStatistics, size: int) -> _Part:
        """Return a block with all parameters."""
        rows = list(statistics.factors)
        columns = [np.append(each, size) for each in statistics.columns]
        return cls(statistics.counts, rows, [each.T @ each for each in rows], columns, size)

    def among(self, used: IndexArray) -> _Part:
        """Return the block with some parameters, given by their sorted numbers."""
        local = np.full(self.size + 1, -1)
        local[used], local[-1] = np.arange(used.size), used.size
        rows, products, columns = [], [], []
        for row, product, column in zip(self.rows, self.products, self.columns, strict=True):
            at = np.flatnonzero(local[column] >= 0)
            rows.append(row[:, at])
            products.append(product[at[:, None], at])
            columns.append(local[column[at]])
        return _Part(self.counts, rows, products, columns, used.size)

    def normal_equations(self, noise_std: Array) -> Array:
        """Return those of all joints in units of the noise, (size + 1, size + 1)."""
        out = np.zeros((self.size + 1, self.size + 1))
        for column, product, std in zip(self.columns, self.products, noise_std, strict=True):
            out[column[:, None], column] += product / std**2
        return out

    def squares(self, thetas: Array) -> Array:
        """Return sums of squared residuals of every joint, for parameters (g, size), (g, n)."""
        signed = np.column_stack([thetas, np.full(len(thetas), -1.0)])
        residuals = [
            signed[:, column] @ rows.T
            for column, rows in zip(self.columns, self.rows, strict=True)
        ]
        return np.column_stack([np.sum(each**2, axis=1) for each in residuals])


class _Reduced:
    """Normal equations from which the free parameters that all fits share are eliminated."""

    def __init__(
        self, normal: Array, prior_std: Array, free: IndexArray, rest: IndexArray
    ) -> None:
        self._free, self._rest = free, rest
        at = np.append(rest, len(normal) - 1)
        shared = normal[free[:, None], free]
        shared.flat[:: len(shared) + 1] += prior_std[free] ** -2.0
        self._factor = normal_factor(shared)
        self._half, _ = lapack.dtrtrs(self._factor, normal[free[:, None], at], lower=1)
        self._system = normal[at[:, None], at] - self._half.T @ self._half
        diagonal = np.arange(rest.size)
        self._system[diagonal, diagonal] += prior_std[rest] ** -2.0

    def solve_into(self, theta: Array, more: IndexArray, n_free: int) -> None:
        """Set the parameters (P,) of the fit with some of the rest, the free ones first."""
        at = np.searchsorted(self._rest, more)
        x = np.zeros(0)
        if more.size:
            lower = normal_factor(self._system[at[:, None], at])
            root = np.empty((at.size, at.size + 1))
            root[:, :-1] = lower.T
            root[:, -1], _ = lapack.dtrtrs(lower, self._system[at, -1], lower=1)
            x = bounded_solution(root, n_free)
        theta[more] = x
        rest = self._half[:, -1] - self._half[:, at] @ x
        theta[self._free], _ = lapack.dtrtrs(self._factor, rest, lower=1, trans=1)


def bounded_solution(root: Array, n_free: int) -> Array:
    """
    Least squares where the parameters after the first `n_free` ones are not negative, shape (p,).

    The first ones are eliminated by the triangular form of [features, torque], p columns of full
    rank and one; the others are solved for by the algorithm of Lawson and Hanson, 1974.
    """
    f, p = n_free, root.shape[1] - 1
    x = np.zeros(0)
    if p:
        x, _ = lapack.dtrtrs(root[:p, :p].T, root[:p, p], lower=1, trans=1)
    if (x[f:] >= 0.0).all():
        return x
    x[f:], _ = nnls(root[f:p, f:p], root[f:p, p])
    if f:
        right = root[:f, p] - root[:f, f:p] @ x[f:]
        x[:f], _ = lapack.dtrtrs(root[:f, :f].T, right, lower=1, trans=1)
    return x
