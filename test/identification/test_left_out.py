"""Cross-validation on statistics, against fits to the samples themselves."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lip_id_ros.arrays import Array
from lip_id_ros.identification.left_out import bounded_solutions, Gain, LeftOutBlocks
from lip_id_ros.identification.statistics import contiguous_blocks, TorqueStatistics

N, P = 240, 7
COLUMNS = (np.array([0, 1, 2, 3, 4]), np.array([1, 2, 5, 6]))
LOWER = np.array([-np.inf, -np.inf, 0.0, 0.0, -np.inf, 0.0, -np.inf])
TRUTH = np.array([1.0, -2.0, 0.7, 0.0, 0.5, 0.4, -0.3])
NOISE = np.array([0.1, 0.4])
PRIOR = np.full(P, 10.0)


def samples(seed: int = 0) -> tuple[list[Array], Array]:
    rng = np.random.default_rng(seed)
    features = [rng.standard_normal((N, column.size)) for column in COLUMNS]
    clean = [rows @ TRUTH[column] for rows, column in zip(features, COLUMNS, strict=True)]
    return features, np.column_stack(clean) + NOISE * rng.standard_normal((N, 2))


def blocks_of(features: list[Array], tau: Array) -> LeftOutBlocks:
    number, empty = contiguous_blocks(N, 6), TorqueStatistics.empty(COLUMNS)
    blocks = [empty.update([f[number == k] for f in features], tau[number == k]) for k in range(6)]
    return LeftOutBlocks(blocks, PRIOR, LOWER, tau.std(axis=0))


def dense(features: list[Array], tau: Array, rows: Array, selected: Array) -> Array:
    stacked, right = [np.diag(1.0 / PRIOR)], [np.zeros(P)]
    for i, column in enumerate(COLUMNS):
        block = np.zeros((int(rows.sum()), P))
        block[:, column] = features[i][rows]
        stacked.append(block / NOISE[i])
        right.append(tau[rows, i] / NOISE[i])
    theta, a = np.zeros(P), np.concatenate(stacked)[:, selected]
    bounds = (LOWER[selected], np.inf)
    theta[selected] = lsq_linear(a, np.concatenate(right), bounds, tol=1e-14, method='bvls').x
    return theta


def error_of(features: list[Array], tau: Array, theta: Array, rows: Array) -> Array:
    return np.array(
        [
            np.mean((tau[rows, i] - features[i][rows] @ theta[column]) ** 2)
            for i, column in enumerate(COLUMNS)
        ]
    )


@pytest.mark.parametrize('selected', [[0, 1, 2, 3, 4, 5, 6], [6, 2, 0, 3]])
def test_errors_of_left_out_blocks(selected: list[int]) -> None:
    features, tau = samples()
    chosen, number = np.array(selected), contiguous_blocks(N, 6)
    got = blocks_of(features, tau).fit(chosen, NOISE)
    whole = dense(features, tau, np.ones(N, dtype=bool), chosen)
    np.testing.assert_allclose(got.parameters, whole, atol=1e-9)
    for scheme, size in enumerate((1, 2)):
        for k in range(6 // size):
            out = number // size == k
            theta = dense(features, tau, ~out, chosen)
            expected = error_of(features, tau, theta, out)
            np.testing.assert_allclose(got.squares[scheme][k], expected, rtol=1e-8)


def test_one_more_term_without_solving_anew() -> None:
    features, tau = samples()
    blocks, selected = blocks_of(features, tau), np.array([1, 2, 6])
    groups = [np.array([0]), np.array([3, 4]), np.array([5]), np.array([3])]
    for group, got in zip(groups, blocks.with_each(selected, groups, NOISE), strict=True):
        expected = blocks.fit(np.append(selected, group), NOISE)
        np.testing.assert_allclose(got.parameters, expected.parameters, atol=1e-9)
        for mine, its in zip(got.squares, expected.squares, strict=True):
            np.testing.assert_allclose(mine, its, rtol=1e-8)


def test_mean_squares_are_those_of_the_fits() -> None:
    features, tau = samples()
    blocks, selected = blocks_of(features, tau), np.array([1, 2, 6])
    groups = [np.array([0]), np.array([3, 4]), np.zeros(0, dtype=np.intp)]
    fits = blocks.with_each(selected, groups, NOISE)
    found = blocks.mean_squares(selected, groups, NOISE)
    np.testing.assert_array_equal(found, [each.mean_squares for each in fits])


def test_a_gain_must_be_larger_than_chance() -> None:
    now = np.exp(0.3 * np.random.default_rng(0).standard_normal((8, 3)))

    def sure(*pairs: tuple[Array, Array], errors: float = 2.0) -> bool:
        return Gain.between(*zip(*pairs, strict=True)).is_sure(errors=errors)

    assert not sure((now, now))
    assert sure((now, 0.9 * now))
    assert not sure((0.9 * now, now))
    assert not sure((now, 0.99 * now))  # in every block, and too small
    mixed = now * np.tile([0.2, 1.2], 4)[:, None]
    assert sure((now, mixed), errors=1.0)
    assert not sure((now, mixed))
    assert not sure((now, 0.5 * now), (now[::2], 1.1 * now[::2]))  # in one scheme of folds


@given(seed=st.integers(0, 1000), size=st.integers(1, 12))
def test_bounded_least_squares(seed: int, size: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((4, 20, size)), rng.standard_normal((4, 20, 1))
    bounded = rng.uniform(size=(4, size)) < 0.7
    columns = a.transpose(0, 2, 1)
    got = bounded_solutions(columns @ a, (columns @ b)[..., 0], bounded)
    for matrix, right, mask, found in zip(a, b[..., 0], bounded, got, strict=True):
        lower = np.where(mask, 0.0, -np.inf)
        expected = lsq_linear(matrix, right, (lower, np.inf), tol=1e-14, method='bvls').x
        np.testing.assert_allclose(found, expected, atol=1e-8)
