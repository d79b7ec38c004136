"""Factors of many rows in the metric of those before, against orthogonal transformations."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.testing import assert_allclose, assert_array_equal
import pytest

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.identification import factor_sum
from lip_id_ros.identification.factor_sum import FactorSum, LARGEST, Metric
from lip_id_ros.identification.statistics import triangular

SIZE = 8


@dataclass(frozen=True)
class Plain:
    """Rows that are in memory."""

    rows: Array

    def all(self) -> Array:
        return self.rows

    def some(self, columns: IndexArray, check: Array) -> tuple[Array, Array]:
        with np.errstate(invalid='ignore'):
            return np.array(self.rows[:, columns], order='F'), self.rows @ check


def added(parts: list[Array]) -> FactorSum:
    out = FactorSum(parts[0].shape[1])
    for rows in parts:
        out.add(Plain(rows), len(rows))
    return out


def by_rotations(parts: list[Array]) -> Array:
    factor = np.zeros((parts[0].shape[1],) * 2)
    for rows in parts:
        factor = triangular(factor, rows)
    return factor


def assert_same(found: Array, expected: Array, rtol: float = 1e-9) -> None:
    """Both have the same Gram matrix, in units of its columns."""
    size = np.linalg.norm(expected, axis=0)
    size[size == 0.0] = 1.0
    one, other = found / size, expected / size
    assert_allclose(one.T @ one, other.T @ other, atol=rtol)
    assert_array_equal(np.tril(found, -1), 0.0)
    assert np.all(np.diagonal(found) >= 0.0)


@pytest.fixture(autouse=True)
def early(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let metrics begin after few rows."""
    monkeypatch.setattr(factor_sum, 'FIRST', 2 * SIZE)


@st.composite
def rows_of_any_kind(draw: st.DrawFn) -> list[Array]:
    """Rows with columns and rows of zeros, columns that depend on others, and of any size."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows = rng.standard_normal((draw(st.integers(0, 300)), SIZE))
    kinds = st.sampled_from(['own', 'own', 'zero', 'of others', 'nearly of others'])
    for column in range(1, SIZE):
        kind = draw(kinds)
        others = rows[:, :column] @ rng.standard_normal(column)
        if kind == 'zero':
            rows[:, column] = 0.0
        elif kind != 'own':
            rows[:, column] *= 1e-6 * (kind == 'nearly of others')
            rows[:, column] += others
    share = draw(st.sampled_from([0.0, 0.5]))
    rows[rng.uniform(size=len(rows)) < share] = 0.0
    rows[:, draw(st.integers(0, SIZE - 1))] *= draw(st.sampled_from([0.0, 1.0]))
    rows *= 10.0 ** rng.uniform(-8.0, 8.0, SIZE)
    if draw(st.booleans()):  # the end is unlike the beginning
        rows[len(rows) // 2 :] *= 10.0 ** rng.uniform(-8.0, 8.0, SIZE)
    cuts = sorted(draw(st.lists(st.integers(0, len(rows)), max_size=12)))
    return [rows[a:b] for a, b in pairwise([0, *cuts, len(rows)])]


@given(rows_of_any_kind())
def test_any_rows_have_the_factor_of_rotations(parts: list[Array]) -> None:
    assert_same(added(parts).factor(), by_rotations(parts))


@given(st.integers(0, 100), st.integers(-9, -2))
def test_nearly_dependent_columns_are_solved_for_as_well(seed: int, weak: int) -> None:
    """The square of their condition is beyond float64; that of the metric is not."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((4000, 3))
    rows[:, 1] = rows[:, 0] + 10.0**weak * rows[:, 1]
    theta = np.array([2.0, -1.0])
    rows[:, 2] = rows[:, :2] @ theta
    parts = np.array_split(rows, 20)
    factor = added(parts).factor()
    found = np.linalg.solve(factor[:2, :2], factor[:2, 2])
    assert_allclose(found, theta, rtol=1e-14 / 10.0**weak)


def test_most_rows_take_the_fast_way(monkeypatch: pytest.MonkeyPatch) -> None:
    counts: list[int] = []

    def count(*blocks: Array) -> Array:
        counts.append(len(blocks[-1]))
        return triangular(*blocks)

    rng = np.random.default_rng(0)
    parts = np.array_split(rng.standard_normal((40_000, SIZE)), 400)
    monkeypatch.setattr(factor_sum, 'triangular', count)
    found = added(parts)
    assert sum(counts) < 200
    assert_same(found.factor(), by_rotations(parts), 1e-12)


def test_the_metric_is_renewed_where_sums_grow() -> None:
    rng = np.random.default_rng(0)
    parts = np.array_split(rng.standard_normal((20, SIZE)), 2)
    parts += [3.0 * rng.standard_normal((400, SIZE)) for _ in range(500)]
    found = added(parts)
    assert np.diagonal(found._gram).max() <= LARGEST
    assert_same(found.factor(), by_rotations(parts), 1e-12)


@pytest.mark.parametrize('size', [1e-9, 1.0, 1e9])
def test_a_column_that_is_no_longer_that_of_others_is_seen(size: float) -> None:
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((2000, SIZE))
    rows[:1000, 3] = rows[:1000, 1] - rows[:1000, 2]
    rows[:1000, 5] = 0.0
    rows[1000:, 3] = rows[1000:, 1] - rows[1000:, 2] + size * rows[1000:, 3]
    rows[1000:, 5] *= size
    parts = np.array_split(rows, 20)
    assert_same(added(parts).factor(), by_rotations(parts), 1e-12)


def test_a_column_is_not_hidden_by_another_that_is_nearly_explained() -> None:
    """Without the second column the third is nothing that the first explains."""
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((200, 3))
    rows[:, 1] = rows[:, 0] + 1e-13 * rows[:, 2]
    metric = Metric.of(triangular(rows), 200)
    assert metric is not None
    assert metric.own.tolist() == [0, 2]
    assert_same(added(np.array_split(rows, 20)).factor(), triangular(rows), 1e-12)


@pytest.mark.parametrize('bad', [np.nan, np.inf])
@pytest.mark.parametrize('first', [0, 500])
def test_values_that_are_not_finite_are_not_lost(bad: float, first: int) -> None:
    rows = np.random.default_rng(0).standard_normal((1000, SIZE))
    rows[first, 2] = bad
    assert not np.isfinite(added(np.array_split(rows, 10)).factor()).all()
