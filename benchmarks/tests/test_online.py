"""Rivals that learn sample by sample: least squares as in one step, and errors that fall."""

from __future__ import annotations

import numpy as np

from benchmarks._drives import random_arm, sines, WIDTH
from benchmarks._online import least_squares, sparse_spectrum, true_regressor
from lip_id_ros.arrays import Array

RATE_HZ, NOISE = 20.0, 0.01


def states(seconds: float) -> tuple[Array, Array, Array]:
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    return sines(np.random.default_rng(0), t, 2, 5, 1.0)


def test_least_squares_predict_as_those_of_all_samples_before() -> None:
    rng = np.random.default_rng(0)
    features, variance = rng.standard_normal((60, 5)), rng.uniform(0.5, 2.0, 5)
    torque = features @ rng.standard_normal(5) + rng.standard_normal(60)
    found = least_squares(features, torque, variance, 0.0)
    for t in (1, 7, 59):
        own = features[:t]
        normal = own.T @ own + np.diag(1.0 / variance)
        expected = features[t] @ np.linalg.solve(normal, own.T @ torque[:t])
        np.testing.assert_allclose(found[t], expected, rtol=1e-9)


def test_what_fades_is_followed() -> None:
    rng = np.random.default_rng(1)
    features = rng.standard_normal((2000, 3))
    weight = np.where(np.arange(2000) < 1000, 1.0, -1.0)
    torque = features[:, 0] * weight
    kept, fading = (least_squares(features, torque, np.ones(3), x) for x in (0.0, 0.02))
    late = slice(1500, None)
    assert np.abs(fading - torque)[late].mean() < 0.1 * np.abs(kept - torque)[late].mean()


def test_an_arm_of_known_kinematics_is_learned() -> None:
    arm, motion = random_arm(2, 0), states(60.0)
    clean = arm.torque(*motion) + np.tanh(motion[1] / WIDTH)
    noise = NOISE * clean.std(axis=0)
    tau = clean + noise * np.random.default_rng(2).standard_normal(clean.shape)
    found = true_regressor(arm, motion, tau, noise, 1e-3)
    assert (np.abs(found - clean)[600:].mean(axis=0) < noise).all()


def test_a_sparse_spectrum_learns_a_smooth_torque() -> None:
    motion = states(60.0)
    clean = np.stack([np.sin(motion[0][:, 0]), motion[1][:, 1] ** 2], axis=1)
    tau = clean + NOISE * np.random.default_rng(3).standard_normal(clean.shape)
    (found,) = sparse_spectrum(motion, tau, 300, [0.0])
    assert (np.mean((found - clean)[600:] ** 2, axis=0) < 0.01 * clean.var(axis=0)).all()
