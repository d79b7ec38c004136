"""Statistics in square-root form, against least squares on all samples at once."""

from __future__ import annotations

from itertools import pairwise
from random import Random

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ShapeError
from lip_id_ros.identification.posterior import jackknife_root
from lip_id_ros.identification.statistics import (
    contiguous_blocks,
    measure_left_out,
    posterior,
    score_inflation,
    solved,
    TorqueStatistics,
)

COLUMNS = (np.arange(6), np.array([2, 3, 4, 5, 6]), np.array([4, 5, 6, 7, 8]))
"""Of three joints, which share some of nine parameters."""

PRIOR = np.linspace(0.5, 3.0, 9)
NOISE = np.array([0.1, 0.5, 2.0])


def samples(n_samples: int, seed: int = 0) -> tuple[list[Array], Array]:
    rng = np.random.default_rng(seed)
    features = [rng.standard_normal((n_samples, column.size)) for column in COLUMNS]
    theta = rng.standard_normal(9)
    clean = [rows @ theta[column] for rows, column in zip(features, COLUMNS, strict=True)]
    return features, np.column_stack(clean) + NOISE * rng.standard_normal((n_samples, 3))


def part(features: list[Array], tau: Array, rows: slice) -> TorqueStatistics:
    empty = TorqueStatistics.empty(COLUMNS)
    return empty.update([each[rows] for each in features], tau[rows])


def dense(features: list[Array], tau: Array, weights: Array) -> Array:
    rows, right = [np.diag(1.0 / PRIOR)], [np.zeros(9)]
    for i, column in enumerate(COLUMNS):
        block = np.zeros((len(tau), 9))
        block[:, column] = features[i]
        root = np.sqrt(weights[:, i]) / NOISE[i]
        rows.append(block * root[:, None])
        right.append(tau[:, i] * root)
    return np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]


def test_parameters_are_those_of_all_samples_at_once() -> None:
    features, tau = samples(400)
    weights = np.random.default_rng(1).uniform(0.1, 1.0, tau.shape)
    statistics = TorqueStatistics.empty(COLUMNS).update(features, tau, weights)
    got = posterior(statistics, NOISE, PRIOR)
    np.testing.assert_allclose(got.mean, dense(features, tau, weights), rtol=1e-11)
    np.testing.assert_array_equal(statistics.counts, 400)


@given(
    cuts=st.lists(st.integers(0, 300), max_size=6),
    order=st.randoms(use_true_random=False),
    seed=st.integers(0, 100),
)
def test_split_and_order_of_samples_do_not_matter(
    cuts: list[int], order: Random, seed: int
) -> None:
    features, tau = samples(300, seed)
    edges = [0, *sorted(cuts), 300]
    parts = [slice(a, b) for a, b in pairwise(edges)]
    order.shuffle(parts)
    whole, joined = part(features, tau, slice(None)), TorqueStatistics.empty(COLUMNS)
    for rows in parts:
        joined = joined.update([each[rows] for each in features], tau[rows])
    one, other = (posterior(each, NOISE, PRIOR).mean for each in (whole, joined))
    np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-9)
    for i in range(len(COLUMNS)):
        np.testing.assert_allclose(joined.factors[i], whole.factors[i], atol=1e-9)


def test_better_than_normal_equations() -> None:
    """Features of condition 1e9: the square of that is beyond float64, the factor is not."""
    rng = np.random.default_rng(0)
    base = rng.standard_normal((500, 2))
    rows = np.column_stack([base[:, 0], base[:, 0] + 1e-9 * base[:, 1]])
    theta = np.array([2.0, -1.0])
    statistics = TorqueStatistics.empty([np.arange(2)]).update([rows], (rows @ theta)[:, None])
    weak = np.full(2, 1e13)
    got = posterior(statistics, np.array([1.0]), weak).mean
    np.testing.assert_allclose(got, theta, rtol=1e-5)


def test_chosen_parameters_alone() -> None:
    features, tau = samples(200)
    chosen = np.array([7, 0, 2, 5])
    got = posterior(part(features, tau, slice(None)), NOISE, PRIOR[chosen], chosen).mean
    kept = [np.isin(column, chosen) for column in COLUMNS]
    few = [rows[:, keep] for rows, keep in zip(features, kept, strict=True)]
    columns = [column[keep] for column, keep in zip(COLUMNS, kept, strict=True)]
    statistics = TorqueStatistics.empty(columns).update(few, tau)
    assert statistics.n_parameters == 8
    prior = np.full(8, 1e-9)
    prior[chosen] = PRIOR[chosen]
    expected = posterior(statistics, NOISE, prior).mean[chosen]
    np.testing.assert_allclose(got, expected, rtol=1e-9)


def test_leaving_a_block_out() -> None:
    """Each block is predicted from the others as a fit to the others predicts it."""
    features, tau = samples(120)
    whole = np.zeros((3, 120, 9))
    for rows, some, column in zip(whole, features, COLUMNS, strict=True):
        rows[:, column] = some
    block, empty = contiguous_blocks(120, 4), TorqueStatistics.empty([np.arange(9)] * 3)
    blocks = [empty.update(list(whole[:, block == k]), tau[block == k]) for k in range(4)]
    prior = np.column_stack([np.diag(1.0 / PRIOR), np.zeros(PRIOR.size)])
    got = measure_left_out(blocks, prior, NOISE)
    in_fit = posterior(empty.update(list(whole), tau), NOISE, PRIOR)
    inside = [in_fit.variance(rows).mean() for rows in whole] / NOISE**2
    white = NOISE / np.sqrt(1.0 - inside)
    squares, outside = np.zeros((2, 3))
    for k in range(4):
        others = empty.update(list(whole[:, block != k]), tau[block != k])
        fit = posterior(others, white, PRIOR)
        squares += blocks[k].squared_residuals(fit.mean) / 120
        outside += [fit.variance(rows[block == k]).sum() / 120 for rows in whole] / white**2
    np.testing.assert_allclose(got.mean_squares, squares, rtol=1e-9)
    variance = NOISE**2 / (1.0 - got.inflation * inside)
    np.testing.assert_allclose(got.unbiased_std**2, variance, rtol=1e-8)


def test_scores_of_blocks_by_their_definition() -> None:
    """With residuals of white noise as a projection of all samples, and errors that last."""
    features, tau = samples(120)
    block = contiguous_blocks(120, 4)
    tau += 2.0 * NOISE * np.array([1.0, -1.0, 1.0, -1.0])[block, None]
    rows = np.zeros((3, 120, 9))
    for each, some, column in zip(rows, features, COLUMNS, strict=True):
        each[:, column] = some
    with_tau = np.concatenate([rows, tau.T[:, :, None]], axis=2)
    parts = [with_tau[:, block == k] for k in range(4)]
    grams = np.array([each.swapaxes(1, 2) @ each for each in parts])
    scaled = with_tau / NOISE[:, None, None]
    matrix, target = scaled[..., :-1].reshape(360, 9), scaled[..., -1].ravel()
    covariance = np.linalg.inv(matrix.T @ matrix + np.diag(PRIOR**-2))
    maker = np.eye(360) - matrix @ covariance @ matrix.T
    found = expected = 0.0
    for k in range(4):
        own = np.tile(block == k, 3)
        score = matrix[own].T @ (maker @ target)[own]
        white = matrix[own].T @ maker[own]
        found += score @ covariance @ score
        expected += np.trace(covariance @ white @ white.T)
    prior = np.column_stack([np.diag(1.0 / PRIOR), np.zeros(9)])
    ratio = found / expected
    assert ratio > 1.5
    fit = solved(grams.sum(axis=0), prior, NOISE)
    got = score_inflation(grams, *fit, NOISE, inside=0.1)
    assert got == pytest.approx(ratio / (1.0 + 0.1 * ratio), rel=1e-9)
    inside = np.trace(matrix @ covariance @ matrix.T) / 360
    blocks = [
        TorqueStatistics.empty([np.arange(9)] * 3).update(list(each), tau[block == k])
        for k, each in enumerate(rows[:, block == k] for k in range(4))
    ]
    whole = measure_left_out(blocks, prior, NOISE).inflation
    assert whole == pytest.approx(ratio / (1.0 + inside * ratio), rel=1e-9)


def test_a_single_block_shows_no_correlation() -> None:
    """Parameters far from their prior are no noise that lasts."""
    features, tau = samples(120)
    rows = np.concatenate([features[0], tau[:, :1]], axis=1)
    prior = np.column_stack([np.diag(1.0 / PRIOR[COLUMNS[0]]), np.full(COLUMNS[0].size, 30.0)])
    grams = (rows.T @ rows)[None, None]
    fit = solved(grams[0], prior, NOISE[:1])
    assert score_inflation(grams, *fit, NOISE[:1], 0.05) == 1.0


@pytest.mark.parametrize('together', [1, 6])
def test_variances_are_true_where_noise_is_correlated(together: int) -> None:
    """Of torques that slow features make, over 20 draws of white noise and of moving averages."""
    rng, t = np.random.default_rng(0), np.arange(2400)
    features = gaussian_filter1d(rng.standard_normal((t.size, 48)), 5.0, axis=0)
    features /= features.std(axis=0)
    empty, wide = TorqueStatistics.empty([np.arange(48)]), np.full(48, 1e3)
    prior = np.column_stack([np.diag(1.0 / wide), np.zeros(48)])
    block, inflations = contiguous_blocks(t.size, 6), []
    said, seen, noises = [], [], []
    for _ in range(20):
        noise = rng.standard_normal((t.size + together - 1, 1))
        tau = sum(noise[i : i + t.size] for i in range(together)) / np.sqrt(together)
        fit = posterior(empty.update([features], tau), np.ones(1), wide)
        residual = tau - features @ fit.mean[:, None]
        blocks = [empty.update([features[block == k]], residual[block == k]) for k in range(6)]
        prior[:, -1] = -fit.mean / wide
        found = measure_left_out(blocks, prior, np.sqrt(np.mean(residual**2, axis=0)))
        said.append(found.inflation * found.unbiased_std[0] ** 2 * fit.variance(features).mean())
        seen.append(np.mean((features @ fit.mean) ** 2))
        noises.append(found.unbiased_std[0])
        inflations.append(found.inflation)
    assert np.std(inflations) < 0.8  # by errors of left-out blocks it was 0.93
    assert np.mean(said) == pytest.approx(np.mean(seen), rel=0.2), (np.mean(said), np.mean(seen))
    assert np.mean(noises) == pytest.approx(1.0, abs=0.02)


def test_blocks_are_contiguous_and_alike_in_size() -> None:
    block = contiguous_blocks(103, 6)
    assert np.all(np.diff(block) >= 0)
    assert np.ptp(np.bincount(block, minlength=6)) <= 1
    assert contiguous_blocks(3, 6).tolist() == [0, 1, 2]
    assert contiguous_blocks(0, 6).size == 0


def test_shapes_that_do_not_fit() -> None:
    features, tau = samples(5)
    with pytest.raises(ShapeError, match='one array per joint'):
        TorqueStatistics.empty(COLUMNS).update(features[:2], tau)


BLOCKS, LENGTH = 6, 50
WHITE, FLAT = np.array([0.2]), 1e-3 * np.eye(2, 3)


def blocks_of(features: Array, residual: Array) -> list[TorqueStatistics]:
    """Gather the statistics of one joint, features (K, N, m) and residuals (K, N)."""
    empty = TorqueStatistics.empty([np.arange(features.shape[2])])
    ones = np.ones((features.shape[1], 1))
    return [empty.update([x], y[:, None], ones) for x, y in zip(features, residual, strict=True)]


def test_the_jackknife_by_its_definition() -> None:
    rng = np.random.default_rng(0)
    features, residual = rng.normal(size=(BLOCKS, LENGTH, 2)), rng.normal(size=(BLOCKS, LENGTH))
    without = []
    for k in range(BLOCKS):
        x, y = np.delete(features, k, 0).reshape(-1, 2), np.delete(residual, k, 0).ravel()
        rows = np.vstack([np.column_stack([x, y]) / WHITE, FLAT])
        without.append(np.linalg.lstsq(rows[:, :2], rows[:, 2])[0])
    root = jackknife_root(blocks_of(features, residual), FLAT, WHITE)
    expected = (BLOCKS - 1) * np.cov(np.transpose(without), bias=True)
    np.testing.assert_allclose(root @ root.T, expected, rtol=1e-8)


def test_the_jackknife_is_true_where_errors_last() -> None:
    """A model error of its own in each block moves parameters by far more than white noise."""
    rng = np.random.default_rng(1)
    features = np.stack([np.ones((BLOCKS, LENGTH)), rng.normal(size=(BLOCKS, LENGTH))], axis=2)
    found, variance = [], []
    for _ in range(300):
        lasting = WHITE * rng.normal(size=(BLOCKS, 1))
        residual = lasting + 0.1 * WHITE * rng.normal(size=(BLOCKS, LENGTH))
        root = jackknife_root(blocks_of(features, residual), FLAT, WHITE)
        found.append(residual.mean())
        variance.append((root @ root.T)[0, 0])
    white = WHITE[0] / np.sqrt(BLOCKS * LENGTH)
    assert np.std(found) > 5.0 * white
    np.testing.assert_allclose(np.sqrt(np.mean(variance)), np.std(found), rtol=0.1)
