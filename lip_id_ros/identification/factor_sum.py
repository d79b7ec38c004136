"""
The triangular factor of very many rows, faster than by orthogonal transformations.

Rows X are added in the metric of the factor R of those before: the factor of both is C R, where C
is the Cholesky factor of I + Y^T Y and Y = X R^-1. A preconditioner keeps the accuracy of QR
(Yamamoto, Nakatsukasa, Yanagisawa and Fukaya, Roundoff error analysis of the CholeskyQR2
algorithm, ETNA 44, 2015), while Y is small; rows whose Y is large are added by `triangular`.
Columns that the others explain to rounding have no part in it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from scipy.linalg import blas, lapack, solve_triangular

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.joint_rows import JointRows
from lip_id_ros.identification.linearisation import Linearisation, Samples
from lip_id_ros.identification.statistics import TorqueStatistics, triangular

FIRST = 1000
"""Rows that are added by orthogonal transformations before there is a metric."""

EXPLAINED = 1e-11
"""Share of its size up to which a column is explained by others."""

LARGEST = 1e4
"""Entry of Y^T Y on the diagonal beyond which the metric is renewed."""

GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True, eq=False)
class Metric:
    """A factor whose rows are independent, and what shows that it explains further rows."""

    own: IndexArray  # (b,), columns that are not explained by others
    root: Array  # (b, b), upper triangular factor of these columns
    rows: Array  # (b, s), factor of all columns
    check: Array  # (s,), zero for all rows whose columns depend on each other as here
    bound: float  # of the product of a row with it, by rounding

    @classmethod
    def of(cls, factor: Array, count: int) -> Metric | None:
        """Return the metric of the factor (s, s) of so many rows; None if infinite or zero."""
        size = np.sqrt(np.einsum('ij,ij->j', factor, factor))
        if not (np.isfinite(size).all() and size.any()):
            return None
        own, whole = _independent(factor, size)
        others = np.setdiff1d(np.arange(size.size), own)
        root = np.asfortranarray(whole[: own.size, own])
        by_own = solve_triangular(root, whole[: own.size, others], check_finite=False)
        # Columns that depend on the others are tried together, by irregular shares of each.
        share = 1.0 + (GOLDEN * np.arange(others.size)) % 1.0
        share /= np.where(size[others] > 0.0, size[others], 1.0)
        check = np.zeros(size.size)
        check[others] = share
        check[own] = -by_own @ share
        bound = EXPLAINED * float(np.abs(check) @ size) / np.sqrt(max(count, 1))
        rows = np.zeros((own.size, size.size), order='F')
        rows[:, own], rows[:, others] = root, root @ by_own
        return cls(own, root, rows, check, bound)

    def times(self, left: Array) -> Metric:
        """Return the metric of a factor that is a triangle (b, b) times this one."""
        root, rows = (blas.dtrmm(1.0, left, each) for each in (self.root, self.rows))
        return replace(self, root=root, rows=rows)


def _independent(factor: Array, size: Array) -> tuple[IndexArray, Array]:
    """Return columns that are independent, and the factor of all in which these come first."""
    scaled = factor / np.where(size > 0.0, size, 1.0)
    own = np.flatnonzero(np.abs(np.diagonal(triangular(scaled))) > EXPLAINED)
    while True:
        others = np.setdiff1d(np.arange(size.size), own)
        order = np.concatenate([own, others])
        whole = triangular(scaled[:, order])
        left = np.sqrt(np.sum(whole[own.size :, own.size :] ** 2, axis=0))
        if not (left > EXPLAINED).any():
            out = np.empty_like(whole)
            out[:, order] = whole * size[order]
            return own, out
        own = np.sort(np.append(own, others[np.argmax(left)]))


class Rows(Protocol):
    """Rows (N, s) of which some columns are taken at a time."""

    def all(self) -> Array:
        """Return the rows (N, s)."""

    def some(self, columns: IndexArray, check: Array) -> tuple[Array, Array]:
        """Return some columns, in Fortran order and not shared, and products (N,) with (s,)."""


class FactorSum:
    """The triangular factor of rows that come part by part."""

    def __init__(self, size: int) -> None:
        self._factor = np.zeros((size, size))
        self._metric: Metric | None = None
        self._gram = np.zeros((0, 0))
        self._count = self._refused = 0
        self._next = FIRST  # number of rows from which on there is a metric

    def add(self, rows: Rows, count: int) -> None:
        """Add so many rows."""
        if self._metric is None and self._count >= self._next:
            self._renew(Metric.of(self._factor, self._count))
        if self._metric is None or not self._added(self._metric, rows):
            self._add_by_rotations(rows.all())
        self._count += count

    def factor(self) -> Array:
        """Return the triangular factor (s, s) of all rows, as `triangular` does."""
        if self._metric is not None:
            self._factor = triangular(self._metric.times(self._root()).rows)
            self._renew(None)
        return self._factor

    def _added(self, metric: Metric, rows: Rows) -> bool:
        """Add rows in the metric; return whether it suits them."""
        some, products = rows.some(metric.own, metric.check)
        if not np.abs(products).max(initial=0.0) <= metric.bound:
            return False
        some = blas.dtrsm(1.0, metric.root, some, side=1, overwrite_b=1)
        gram = blas.dsyrk(1.0, some, trans=1)
        largest = np.diagonal(gram).max(initial=0.0)
        if not largest <= LARGEST:
            return False
        self._gram += gram
        if np.diagonal(self._gram).max(initial=0.0) > LARGEST:
            self._renew(metric.times(self._root()))
        return True

    def _add_by_rotations(self, rows: Array) -> None:
        if self._metric is not None:  # each time that it does not suit, the next is later
            self._refused += 1
            self._next = self._count + len(rows) * 2**self._refused
        self._factor = triangular(self.factor(), rows)

    def _renew(self, metric: Metric | None) -> None:
        self._metric = metric
        if metric is not None:
            self._gram = np.eye(metric.own.size, order='F')

    def _root(self) -> Array:
        """Return the factor of all rows in the metric, (b, b)."""
        return np.asarray(lapack.dpotrf(self._gram, clean=1)[0])


CHUNK = 400
"""Samples whose features are in memory at one time."""


class Gathering:
    """Statistics that grow by samples, whose features are in memory together."""

    def __init__(self, around: Linearisation) -> None:
        self._around = around
        self._columns = [np.concatenate(own) for own in around.columns]
        self._sums = [FactorSum(column.size + 1) for column in self._columns]
        self._count = 0

    def add(self, samples: Samples) -> None:
        """Add samples."""
        parts, target = self._around.parts(samples)
        root = np.sqrt(self._around.noise.weights(samples.dq))
        for joint, (column, of_joint) in enumerate(zip(self._columns, self._sums, strict=True)):
            of_joint.add(JointRows(parts, joint, column, target, root), len(target))
        self._count += len(target)

    def statistics(self) -> TorqueStatistics:
        """Return the statistics of all samples."""
        factors = tuple(each.factor() for each in self._sums)
        counts = np.full(len(factors), float(self._count))
        return TorqueStatistics(tuple(self._columns), factors, counts)


def statistics_of(dataset: Dataset, rows: IndexArray, around: Linearisation) -> TorqueStatistics:
    """Return the statistics of some samples of a data set."""
    gathered = Gathering(around)
    for chunk in _chunks(rows):
        gathered.add(Samples.of(dataset, chunk))
    return gathered.statistics()


def _chunks(rows: IndexArray) -> Iterator[IndexArray]:
    """Yield rows that are in memory together: first some of the whole recording."""
    count = -(-rows.size // CHUNK)
    if count > 2:
        yield rows[::count]
        rows = rows[np.arange(rows.size) % count != 0]
    if count:
        yield from np.array_split(rows, -(-rows.size // CHUNK))
