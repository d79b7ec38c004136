"""Noise that grows near rest."""

from __future__ import annotations

import numpy as np

from lip_id_ros.identification.noise import estimate_noise, TorqueNoise

TRUTH = TorqueNoise(np.array([0.5, 2.0]), np.array([0.0, 8.0]), np.array([1.0, 0.1]))


def test_recovered_where_it_is_and_only_there() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        dq = rng.standard_normal((800, 2))
        residuals = TRUTH.std_at(dq) * rng.standard_normal(dq.shape)
        got = estimate_noise(residuals, dq)
        np.testing.assert_allclose(got.std, TRUTH.std, rtol=0.15)
        assert got.ratio[0] == 0.0
        assert 4.0 <= got.ratio[1] <= 16.0
        np.testing.assert_allclose(got.std_at(np.zeros((1, 2)))[0, 1], 16.0, rtol=0.7)


def test_weights_are_those_of_the_variance() -> None:
    dq = np.linspace(-1.0, 1.0, 21)[:, None].repeat(2, axis=1)
    weights = TRUTH.weights(dq)
    np.testing.assert_allclose(TRUTH.std_at(dq) ** 2 * weights, np.tile(TRUTH.std**2, (21, 1)))
    np.testing.assert_array_equal(weights[:, 0], 1.0)
    assert weights[10, 1] == 1.0 / 65.0


def test_joints_that_never_move_have_constant_noise() -> None:
    residuals = np.random.default_rng(0).standard_normal((50, 1))
    got = estimate_noise(residuals, np.zeros((50, 1)))
    assert np.isfinite(got.std_at(np.zeros((1, 1)))).all()
