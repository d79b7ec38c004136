"""
Prediction of left-out blocks by torque models that are linear in parameters, some not negative.

Blocks, since residuals are correlated in time (Roberts and others, Ecography 2017), by statistics:
a fit without a block costs one small Cholesky factorisation. Fits with one more group of
parameters each are solved together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.linear_algebra import normal_factor
from lip_id_ros.numba_jit import jit

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

TRIES, MOST_EXCHANGES = 3, 200
"""Exchanges in a row that may leave as many parameters wrong, and exchanges at most."""

ROUNDING = 1e-12
"""Share of its terms below which a slope is none."""

JITTER = 1e-10
"""Share of itself by which the diagonal is raised where a matrix is singular."""


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
        self.prior_std, self.is_free = prior_std, np.isneginf(lower)
        self._torque_std = np.where(torque_std > 0.0, torque_std, 1.0)
        self.counts = np.array([each.counts for each in blocks])
        self.joints = []
        for joint, column in enumerate(blocks[0].columns):
            rows = np.array([each.factors[joint] for each in blocks])
            products = rows.transpose(0, 2, 1) @ rows
            self.joints.append(_Joint(np.append(column, prior_std.size), rows, products))
        sizes = [size for size in LEFT_OUT_TOGETHER if len(blocks) > size]
        self._schemes = [np.arange(0, len(blocks), size) for size in sizes]

    def fit(self, selected: IndexArray, noise_std: Array) -> LeftOutFit:
        """Fit the selected parameters, with given noise per joint (n,)."""
        (only,) = self.with_each(selected, NOTHING_MORE, noise_std)
        return only

    def noise(self, selected: IndexArray) -> Array:
        """Estimate the noise of every joint by the root mean square of left-out residuals."""
        fits = _Fits(self, selected, NOTHING_MORE)
        noise = INITIAL_NOISE * self._torque_std
        for _ in range(NOISE_ROUNDS):
            (squares,) = fits.mean_squares(self._schemes[0], noise)
            noise = np.maximum(np.sqrt(squares), LEAST_NOISE * self._torque_std)
        return noise

    def with_each(
        self, selected: IndexArray, groups: Sequence[IndexArray], noise_std: Array
    ) -> list[LeftOutFit]:
        """Return the fits with one more group of parameters each."""
        fits = _Fits(self, selected, groups)
        parts = fits.normal_equations(noise_std)
        every = fits.placed(fits.solutions(parts.sum(axis=0, keepdims=True))[0])
        found = [fits.left_out(first, parts) for first in self._schemes]
        thetas = fits.placed(found[0][0])
        return [
            LeftOutFit(every[g], tuple(thetas[:, g]), tuple(squares[:, g] for _, squares in found))
            for g in range(len(groups))
        ]

    def explained(
        self, selected: IndexArray, groups: Sequence[IndexArray], noise_std: Array
    ) -> Array:
        """Return the decrease of the logarithms of mean squares, nothing left out, (groups,)."""
        fits = _Fits(self, selected, [*NOTHING_MORE, *groups])
        whole = fits.normal_equations(noise_std).sum(axis=0, keepdims=True)
        (squares,) = fits.squares(np.zeros(1, dtype=np.intp), fits.solutions(whole))
        logs = np.log(np.maximum(squares, 1e-300))
        return np.asarray(logs[0].sum() - logs[1:].sum(axis=1))

    def mean_squares(
        self, selected: IndexArray, groups: Sequence[IndexArray], noise_std: Array
    ) -> Array:
        """Return `LeftOutFit.mean_squares` with one more group of parameters each, (groups, n)."""
        return _Fits(self, selected, groups).mean_squares(self._schemes[0], noise_std)


@dataclass(frozen=True, eq=False)
class _Joint:
    """Statistics of the K blocks of one joint."""

    columns: IndexArray  # (c,), parameters, and the number of all of them for tau
    rows: Array  # (K, c, c), factors of [F, tau]
    products: Array  # (K, c, c), of normal equations


class _Fits:
    """
    Fits of the selected parameters with each of some groups, on statistics of these alone.

    They have Q parameters together: first those without bounds that all have, then the rest.
    Schemes are given by the first blocks of their sets.
    """

    def __init__(
        self, blocks: LeftOutBlocks, selected: IndexArray, groups: Sequence[IndexArray]
    ) -> None:
        is_free, self._counts = blocks.is_free, blocks.counts
        shared, bounded = selected[is_free[selected]], selected[~is_free[selected]]
        rest = np.setdiff1d(np.concatenate([bounded, *groups]), shared)
        self._used, self._all = np.concatenate([shared, rest]), is_free.size
        self._precision, self._n_shared = blocks.prior_std[self._used] ** -2.0, shared.size
        # numbers in the rest of what each fit has; where it has fewer, of one that changes nothing
        own = [np.searchsorted(rest, np.append(bounded, group)) for group in groups]
        self._own = np.full((len(own), max(each.size for each in own)), rest.size)
        for row, each in zip(self._own, own, strict=True):
            row[: each.size] = each
        self._is_bounded = np.append(~is_free[rest], False)[self._own]
        self._lay_out(blocks.joints)

    def _lay_out(self, joints: Sequence[_Joint]) -> None:
        """Find the parameters in use among those of each joint."""
        local = np.full(self._all + 1, -1)
        local[self._used], local[-1] = np.arange(self._used.size), self._used.size
        self._rows, self._products = [], []
        for joint in joints:
            at = np.flatnonzero(local[joint.columns] >= 0)
            to = local[joint.columns[at]]
            self._rows.append((to, joint.rows[:, :, at]))
            self._products.append((joint.products, at, to))

    def placed(self, thetas: Array) -> Array:
        """Return parameters (..., Q) among all of them, shape (..., P)."""
        out = np.zeros((*thetas.shape[:-1], self._all))
        out[..., self._used] = thetas
        return out

    def normal_equations(self, noise_std: Array) -> Array:
        """Return [F, tau]^T [F, tau] of every block in units of the noise, (K, Q + 1, Q + 1)."""
        size = self._used.size + 1
        out = np.zeros((len(self._counts), size, size))
        for weight, (products, at, to) in zip(noise_std**-2.0, self._products, strict=True):
            _add_products(out, weight, products, at, to)
        return out

    def left_out(self, first: IndexArray, parts: Array) -> tuple[Array, Array]:
        """Return parameters without each set of blocks, and mean squares (sets, groups, n)."""
        thetas = self.solutions(parts.sum(axis=0) - self._sums(parts, first))
        counts = np.add.reduceat(self._counts, first)
        return thetas, np.asarray(self.squares(first, thetas) / counts.mean(axis=0))

    def _sums(self, parts: Array, first: IndexArray) -> Array:
        """Return the sums of the blocks' normal equations over each set."""
        if len(first) == len(parts):
            return parts
        sizes = np.diff(np.append(first, len(parts)))
        members = np.repeat(np.eye(len(first)), sizes, axis=1)
        return (members @ parts.reshape(len(parts), -1)).reshape(-1, *parts.shape[1:])

    def mean_squares(self, first: IndexArray, noise_std: Array) -> Array:
        """Return mean squared errors over the sets of blocks that are left out, (groups, n)."""
        _, squares = self.left_out(first, self.normal_equations(noise_std))
        return np.asarray(squares.mean(axis=0))

    def squares(self, first: IndexArray, thetas: Array) -> Array:
        """Return sums of squared residuals of sets, with parameters of their own, as above."""
        sizes = np.diff(np.append(first, len(self._counts)))
        signed = np.concatenate([thetas, np.full((*thetas.shape[:-1], 1), -1.0)], axis=-1)
        signed = np.repeat(signed, sizes, axis=0)
        blocks = [
            np.sum((signed[..., columns] @ rows.transpose(0, 2, 1)) ** 2, axis=-1)
            for columns, rows in self._rows
        ]
        return np.asarray(np.add.reduceat(np.stack(blocks, axis=-1), first))

    def solutions(self, normal: Array) -> Array:
        """Return parameters with each group for normal equations of sets, (sets, groups, Q)."""
        f, own = self._n_shared, self._own
        shared = normal[:, :f, :f] + np.diag(self._precision[:f])
        factors = [normal_factor(each) for each in shared]
        half = np.array(
            [
                lapack.dtrtrs(factor, each[:f, f:], lower=1)[0]
                for factor, each in zip(factors, normal, strict=True)
            ]
        )
        system = normal[:, f:, f:] - half.transpose(0, 2, 1) @ half
        system += np.diag(np.append(self._precision[f:], 0.0))
        right = system[:, :, -1].copy()
        # the place of the torque is now that of what changes nothing
        system[:, -1] = system[:, :, -1] = right[:, -1] = 0.0
        among = system[:, own[:, :, None], own[:, None, :]]
        among += (own == len(system[0]) - 1)[:, :, None] * np.eye(own.shape[1])
        rest = np.zeros((len(normal), len(own), len(system[0])))
        found = bounded_solutions(
            among, right[:, own], np.broadcast_to(self._is_bounded, among.shape[:-1])
        )
        np.put_along_axis(rest, np.broadcast_to(own, found.shape), found, axis=2)
        rest[..., -1] = -1.0
        first = [
            lapack.dtrtrs(factor, each @ -more.T, lower=1, trans=1)[0].T
            for factor, each, more in zip(factors, half, rest, strict=True)
        ]
        return np.concatenate([np.array(first), rest[..., :-1]], axis=2)


@jit
def _add_products(
    out: Array, weight: float, products: Array, at: IndexArray, to: IndexArray
) -> None:
    """Add normal equations (K, c, c) at some parameters to others' (K, Q, Q), with a weight."""
    for k in range(len(out)):
        for a in range(len(at)):
            row, column = products[k, at[a]], out[k, to[a]]
            for b in range(len(at)):
                column[to[b]] += weight * row[at[b]]


def bounded_solutions(normal: Array, right: Array, bounded: BoolArray) -> Array:
    """
    Solve normal equations (..., p, p) where parameters that are `bounded` are not negative.

    In all problems at once, by block principal pivoting (Portugal, Judice and Vicente, A
    comparison of block pivoting and interior-point algorithms for linear least squares problems
    with nonnegative variables, 1994).
    """
    size, x = right.shape[-1], np.empty(right.shape)
    flat = normal.reshape(-1, size, size), right.reshape(-1, size), bounded.reshape(-1, size)
    try:
        _pivot(x.reshape(-1, size), *flat)
    except np.linalg.LinAlgError:
        _pivot(x.reshape(-1, size), flat[0] * (1.0 + JITTER * np.eye(size)), *flat[1:])
    return x


def _pivot(out: Array, normal: Array, right: Array, bounded: BoolArray) -> None:
    count, size = right.shape
    numbers, positive = np.arange(count), np.ones((count, size), dtype=np.bool_)
    fewest, left = np.full(count, size + 1), np.full(count, TRIES)
    for _ in range(MOST_EXCHANGES):
        among = positive[:, :, None] & positive[:, None, :]
        matrix, other = np.where(among, normal, np.eye(size)), np.where(positive, right, 0.0)
        x = np.linalg.solve(matrix, other[..., None])[..., 0]
        out[numbers] = x
        scale = np.sqrt(np.einsum('kii->ki', normal))
        terms = scale * np.sum(scale * np.abs(x), axis=1, keepdims=True) + np.abs(right)
        slope = (normal @ x[..., None])[..., 0] - right
        wrong = bounded & np.where(positive, x < 0.0, slope < -ROUNDING * terms)
        n_wrong = wrong.sum(axis=1)
        if not (again := np.flatnonzero(n_wrong)).size:
            return
        left = np.where(n_wrong < fewest, TRIES, left - 1)
        fewest = np.minimum(fewest, n_wrong)
        last = size - 1 - np.argmax(wrong[:, ::-1], axis=1)  # alone, it leads to the end
        positive ^= wrong & ((left >= 0)[:, None] | (np.arange(size) == last[:, None]))
        numbers, positive = numbers[again], positive[again]
        fewest, left = fewest[again], left[again]
        normal, right, bounded = normal[again], right[again], bounded[again]
