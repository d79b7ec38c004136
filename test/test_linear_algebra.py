"""Cholesky factors: what they solve, how much jitter they take, and what they refuse."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import FitError
from lip_id_ros.linear_algebra import CholeskyFactor, JITTERS, normal_factor, normal_solution


def positive(m: int, seed: int = 0) -> Array:
    a = np.random.default_rng(seed).normal(size=(m, m))
    return a @ a.T + m * np.eye(m)


def singular(m: int, eigenvalue: float) -> Array:
    """Return a matrix of which half the eigenvalues are one, the others as given."""
    q, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(m, m)))
    matrix = (q * np.where(np.arange(m) < m // 2, 1.0, eigenvalue)) @ q.T
    return 0.5 * (matrix + matrix.T)


@given(m=st.integers(1, 20), seed=st.integers(0, 2**32 - 1))
def test_what_a_factor_answers(m: int, seed: int) -> None:
    matrix = positive(m, seed)
    y = np.random.default_rng(seed).normal(size=(m, 3))
    factor = CholeskyFactor.of(matrix)
    lower = np.tril(factor.lower)
    np.testing.assert_allclose(lower @ lower.T, matrix, atol=1e-12 * m**2)
    np.testing.assert_allclose(factor.solve(y), np.linalg.solve(matrix, y), atol=1e-12)
    np.testing.assert_allclose(factor.solve(y[:, 0]), factor.solve(y)[:, 0])
    np.testing.assert_allclose(lower @ factor.half_solve(y), y, atol=1e-12)
    np.testing.assert_allclose(factor.inverse(), np.linalg.inv(matrix), atol=1e-12)
    assert factor.log_determinant() == pytest.approx(np.linalg.slogdet(matrix)[1])
    assert factor.jitter == 0.0


@given(m=st.integers(2, 20), first=st.integers(1, 19), seed=st.integers(0, 2**32 - 1))
def test_blocks_of_the_inverse(m: int, first: int, seed: int) -> None:
    matrix = positive(m, seed)
    cuts = np.array([0, min(first, m - 1), m])
    inverse = np.linalg.inv(matrix)
    blocks = CholeskyFactor.of(matrix).inverse_blocks(cuts)
    for block, (begin, end) in zip(blocks, pairwise(cuts), strict=True):
        np.testing.assert_allclose(block, inverse[begin:end, begin:end], atol=1e-12)


def test_the_matrix_is_left_as_it_is() -> None:
    matrix = positive(5)
    before = matrix.copy()
    factor = CholeskyFactor.of(matrix)
    factor.inverse()
    np.testing.assert_array_equal(matrix, before)
    np.testing.assert_allclose(factor.inverse() @ matrix, np.eye(5), atol=1e-12)


@pytest.mark.parametrize('step', range(1, len(JITTERS)))
def test_as_little_jitter_as_it_takes(step: int) -> None:
    """A rung of the ladder is taken where the one before would not lift the eigenvalues."""
    matrix = singular(40, -2.0 * JITTERS[step - 1] - 1e-14)
    scale = float(np.mean(np.diagonal(matrix)))
    factor = CholeskyFactor.of(matrix)
    assert factor.jitter == pytest.approx(JITTERS[step] * scale)
    lower = np.tril(factor.lower)
    np.testing.assert_allclose(lower @ lower.T, matrix + factor.jitter * np.eye(40), atol=1e-13)


def test_an_indefinite_matrix_is_refused() -> None:
    sentence = r'expected to be positive definite but is not, even with 1e-06 of its mean diagonal'
    with pytest.raises(FitError, match=sentence):
        CholeskyFactor.of(singular(10, -1e-3))


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(('row', 'column'), [(0, 0), (7, 0), (7, 6), (7, 7)])
def test_what_is_not_finite_is_refused(value: float, row: int, column: int) -> None:
    matrix = positive(8)
    matrix[row, column] = matrix[column, row] = value
    with pytest.raises(FitError, match='expected to be finite but is not: check the data'):
        CholeskyFactor.of(matrix)


@pytest.mark.parametrize('size', [1.0, 1e9])
def test_normal_equations_whose_ridge_is_lost_are_solved(size: float) -> None:
    """Two columns that are alike and huge beside a small one."""
    x = np.random.default_rng(0).standard_normal((50, 2))
    rows = np.column_stack([size * x[:, 0], size * x[:, 0], x[:, 1]])
    target = rows @ np.ones(3)
    found = normal_solution(rows.T @ rows + np.eye(3), rows.T @ target)
    stacked = np.vstack([rows, np.eye(3)])
    expected = np.linalg.lstsq(stacked, np.append(target, np.zeros(3)), rcond=None)[0]
    np.testing.assert_allclose(rows @ found, rows @ expected, atol=1e-5 * size)


@pytest.mark.parametrize('value', [np.nan, np.inf])
def test_a_factor_of_what_is_not_finite_is_not_a_number(value: float) -> None:
    assert not np.isfinite(normal_factor(np.diag([1.0, value, 1.0]))).all()
