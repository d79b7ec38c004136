"""The jackknife over blocks of time against its definition, and under correlated residuals."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.identification.posterior import jackknife_root
from lip_id_ros.identification.statistics import TorqueStatistics

BLOCKS, SIZE = 6, 50
NOISE, PRIOR = np.array([0.2]), 1e-3 * np.eye(2, 3)


def blocks_of(features: Array, residual: Array) -> list[TorqueStatistics]:
    """Gather the statistics of one joint, features (K, N, m) and residuals (K, N)."""
    empty = TorqueStatistics.empty([np.arange(features.shape[2])])
    ones = np.ones((features.shape[1], 1))
    return [empty.update([x], y[:, None], ones) for x, y in zip(features, residual, strict=True)]


def test_the_jackknife_by_its_definition() -> None:
    rng = np.random.default_rng(0)
    features, residual = rng.normal(size=(BLOCKS, SIZE, 2)), rng.normal(size=(BLOCKS, SIZE))
    without = []
    for k in range(BLOCKS):
        x, y = np.delete(features, k, 0).reshape(-1, 2), np.delete(residual, k, 0).ravel()
        rows = np.vstack([np.column_stack([x, y]) / NOISE, PRIOR])
        without.append(np.linalg.lstsq(rows[:, :2], rows[:, 2])[0])
    root = jackknife_root(blocks_of(features, residual), PRIOR, NOISE)
    expected = (BLOCKS - 1) * np.cov(np.transpose(without), bias=True)
    np.testing.assert_allclose(root @ root.T, expected, rtol=1e-8)


def test_the_jackknife_is_true_where_errors_last() -> None:
    """A model error of its own in each block moves parameters by far more than white noise."""
    rng = np.random.default_rng(1)
    features = np.stack([np.ones((BLOCKS, SIZE)), rng.normal(size=(BLOCKS, SIZE))], axis=2)
    found, variance = [], []
    for _ in range(300):
        lasting = NOISE * rng.normal(size=(BLOCKS, 1))
        residual = lasting + 0.1 * NOISE * rng.normal(size=(BLOCKS, SIZE))
        root = jackknife_root(blocks_of(features, residual), PRIOR, NOISE)
        found.append(residual.mean())
        variance.append((root @ root.T)[0, 0])
    white = NOISE[0] / np.sqrt(BLOCKS * SIZE)
    assert np.std(found) > 5.0 * white
    np.testing.assert_allclose(np.sqrt(np.mean(variance)), np.std(found), rtol=0.1)
