"""Posteriors on all samples: noise estimated again, deviations that left-out blocks widen."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

from gp.arms import ARMS, dataset_of, noise_of, random_motion
from gp.cases import random_hyperparameters, random_kernel, TYPES
from gp.processes import process_of
from kernels.cases import random_states
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from lip_id_ros.arrays import Array
from lip_id_ros.gp.fitting import conditioned, left_out_inflation, left_out_residuals
from lip_id_ros.identification import fit
from lip_id_ros.kernels import TorquePrior
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.settings import FitSettings

ARM = ARMS['two_links']
N_SAMPLES, STEP_S = 200, 0.1
SHARE = 0.05
"""Of each torque's deviation, the noise."""

Motion = tuple[Array, Array, Array]


def smooth_motion(n_samples: int, seed: int) -> Motion:
    """Return sums of sinusoids of up to 1 Hz, at 10 Hz."""
    rng = np.random.default_rng(seed)
    t = STEP_S * np.arange(n_samples)[:, None, None]
    rate = 2.0 * np.pi * rng.uniform(0.05, 1.0, (2, 6))
    size, phase = rng.normal(size=(2, 6)) / rate, rng.uniform(0.0, 2.0 * np.pi, (2, 6))
    angle = rate * t + phase
    q, dq = size * np.sin(angle), size * rate * np.cos(angle)
    return q.sum(axis=-1), dq.sum(axis=-1), -(size * rate**2 * np.sin(angle)).sum(axis=-1)


def learned(seed: int, deviation: float) -> InverseDynamicsModel:
    """Fit to noise that is white, or filtered by a Gaussian of this deviation [samples]."""
    motion = smooth_motion(N_SAMPLES, seed)
    tau = ARM.torque(*motion)
    noise = noise_of(tau, 1.0, seed)
    if deviation:
        noise = gaussian_filter1d(noise, deviation, axis=0)
    noise *= SHARE * tau.std(axis=0) / noise.std(axis=0)
    dataset = dataset_of(ARM, motion, tau + noise)
    return fit(dataset, FitSettings(kernel='recursive', subset=60, friction=False))


def squared_deviations(model: InverseDynamicsModel, seed: int) -> Array:
    """Return errors of noiseless torques and both energies at other motions, in deviations."""
    q, dq, ddq = smooth_motion(N_SAMPLES, 100 + seed)
    found, std = model.predict(q, dq, ddq), model.standard_deviation(q, dq, ddq)
    assert found.kinetic is not None
    tau = (found.tau - ARM.torque(q, dq, ddq)) / std.tau
    return np.concatenate([tau.ravel(), (found.kinetic - ARM.kinetic(q, dq)) / std.kinetic]) ** 2


@pytest.mark.slow
@pytest.mark.parametrize(('deviation', 'least', 'most'), [(0.0, 1.0, 1.25), (1.2, 1.5, 4.0)])
def test_deviations_are_true_where_noise_is_correlated(
    deviation: float, least: float, most: float
) -> None:
    models = [learned(seed, deviation) for seed in range(6)]
    inflation = np.mean([process_of(model).inflation for model in models])
    assert least <= inflation < most
    squares = np.array([squared_deviations(model, seed) for seed, model in enumerate(models)])
    assert np.mean(squares < 4.0) > 0.9
    assert 0.3 < np.mean(squares) < 1.5


def test_noise_of_a_descent_that_collapsed_is_estimated_again() -> None:
    model = fit(
        dataset_of(ARM, motion := random_motion(ARM, 80, seed=0), ARM.torque(*motion)),
        FitSettings(kernel='recursive', iterations=10, friction=False),
    )
    prior = process_of(model).prior
    at = prior.hyperparameters
    tau = ARM.torque(*motion)
    noise = noise_of(tau, 0.02)
    true = noise.std(axis=0)
    collapsed = replace(at, noise_variance=true**2 * np.array([1e-4, 1e3]))
    found, left_out = conditioned(prior.kernel, collapsed, dataset_of(ARM, motion, tau + noise))
    np.testing.assert_allclose(found.noise_std, true, rtol=0.25)
    assert (left_out > 0.8 * true**2).all()
    residual = found.prior.hyperparameters.noise_variance * found.alpha
    np.testing.assert_allclose(residual.std(axis=0), true, rtol=0.25)


def test_left_out_blocks_by_their_definition() -> None:
    """Each block is predicted from the others; its own shift of that is weighed by alpha."""
    rng = np.random.default_rng(0)
    kernel = random_kernel('recursive', TYPES, True, rng)
    prior = TorquePrior(kernel, random_hyperparameters(kernel, rng))
    states = kernel.states(*random_states(12, 3, rng))
    tau = 20.0 * rng.normal(size=36)
    gram, noise = prior.gram(states), np.tile(prior.hyperparameters.noise_variance, 12)
    noisy, shift, residuals = gram + np.diag(noise), 0.0, []
    alpha = np.linalg.solve(noisy, tau)
    cuts = np.array([0, 9, 21, 36])
    for begin, end in pairwise(cuts):
        block = np.arange(begin, end)
        rest = np.setdiff1d(np.arange(36), block)
        weights = np.linalg.solve(noisy[np.ix_(rest, rest)], gram[np.ix_(rest, block)])
        shift += alpha[block] @ ((gram @ alpha)[block] - weights.T @ tau[rest])
        residuals.append(tau[block] - weights.T @ tau[rest])
    freedom = np.trace(gram @ np.linalg.inv(noisy))
    blocks = CholeskyFactor.of(noisy).inverse_blocks(cuts)
    left_out = left_out_residuals(alpha.reshape(12, 3), blocks)
    np.testing.assert_allclose(left_out.ravel(), np.concatenate(residuals))
    variance = prior.hyperparameters.noise_variance
    found = left_out_inflation(alpha.reshape(12, 3), blocks, variance)
    assert found > 1.0
    assert found == pytest.approx(shift / freedom)
    assert left_out_inflation(1e-3 * alpha.reshape(12, 3), blocks, variance) == 1.0
