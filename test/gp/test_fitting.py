"""A fit as a whole: what it refuses, keeps to and reports, and how true its deviations are."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise
import json
from typing import Any

from gp.arms import ARMS, dataset_of, noise_of, random_motion
from gp.cases import random_hyperparameters, random_kernel, TYPES
from gp.processes import process_of
from kernels.cases import random_states
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.evaluation import fit_cautions
from lip_id_ros.gp.fitting import conditioned, left_out_inflation, left_out_residuals
from lip_id_ros.identification import fit
from lip_id_ros.kernels import TorquePrior
from lip_id_ros.linear_algebra import CholeskyFactor
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.settings import FitSettings


@cache
def samples(n_samples: int = 40) -> Dataset:
    arm = ARMS['polar']
    motion = random_motion(arm, n_samples, seed=0)
    tau = arm.torque(*motion)
    return dataset_of(arm, motion, tau + noise_of(tau, 0.01))


def quick(dataset: Dataset, **settings: Any) -> InverseDynamicsModel:
    return fit(
        dataset,
        FitSettings(**{'kernel': 'recursive', 'iterations': 3, **settings}),
    )


def test_other_things_than_a_data_set_and_settings_are_refused() -> None:
    with pytest.raises(DataError, match=r'^a fit needs a Dataset, not str; use load_dataset'):
        fit('arm.csv')  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=r'^the settings of a fit must be FitSettings, not dict'):
        fit(samples(), {'kernel': 'lip'})  # type: ignore[arg-type]


@pytest.mark.parametrize('name', ['q', 'ddq', 'tau'])
def test_numbers_of_no_arm_are_refused(name: str) -> None:
    absurd = replace(samples(), **{name: 1e12 * getattr(samples(), name)})
    with pytest.raises(DataError, match=rf'^{name} must be at most 1e\+09 as that of any arm,'):
        fit(absurd)


def test_too_few_samples() -> None:
    with pytest.raises(DataError, match=r'at least 10 samples, but the data set has 9; record'):
        fit(samples().select(np.arange(9)))


@pytest.mark.parametrize('torque', [0.0, 0.1, -3.7e3])
def test_a_torque_that_never_changes(torque: float) -> None:
    """Also where the mean of equal numbers is not quite that number."""
    tau = samples().tau.copy()
    tau[:, 1] = torque
    with pytest.raises(DataError, match=r"in all 40 samples those of 'joint_2' are the same;"):
        fit(replace(samples(), tau=tau))


def test_summary() -> None:
    model = quick(samples(), kernel='lip')
    summary = json.loads(json.dumps(model.summary))
    assert summary == model.summary
    assert summary.keys() == {
        'at_bounds',
        'converged',
        'covariance_inflation',
        'ignored_settings',
        'inertia_min_eigenvalue',
        'inertia_not_pd_percent',
        'iterations',
        'motion_s',
        'negative_log_likelihood',
        'new_motion_s',
        'noise_std',
        'optimiser_message',
        'rejected_steps',
        'seconds_optimising',
        'seconds_total',
        'unexplained_left_out',
        'unexplained_percent',
    }
    np.testing.assert_allclose(summary['noise_std'], model.noise_std)
    assert 0.0 <= summary['seconds_optimising'] <= summary['seconds_total']


def test_the_share_that_is_not_explained_has_no_unit() -> None:
    first, hundredfold = (
        quick(replace(samples(), tau=factor * samples().tau)).summary['unexplained_left_out']
        for factor in (1.0, 100.0)
    )
    np.testing.assert_allclose(hundredfold, first, rtol=0.1)


@pytest.mark.parametrize(
    ('settings', 'sentence'),
    [
        ({}, None),
        ({'friction': False, 'iterations': 3}, 'did not use fit.friction, fit.iterations: '),
        ({'kernel': 'recursive', 'iterations': 3}, None),
        ({'kernel': 'recursive', 'iterations': 3, 'seed': 7}, 'did not use fit.seed: '),
    ],
)
def test_settings_without_use_are_named(settings: dict[str, Any], sentence: str | None) -> None:
    model = fit(samples(100), FitSettings(**settings))
    found = [text for text in fit_cautions(model) if 'not use' in text]
    assert len(found) == (sentence is not None)
    assert all(sentence in text for text in found if sentence is not None)


def test_samples_are_capped() -> None:
    model = quick(samples(), max_samples=15, subset=12)
    assert model.n_samples == 15
    rows = (samples().q[:, None] == process_of(model).states.q).all(axis=2)
    assert rows.any(axis=0).all()


def test_alpha_solves_the_normal_equations() -> None:
    model = quick(samples())
    gram = process_of(model).prior.noisy_gram(process_of(model).states)
    np.testing.assert_allclose(
        gram @ process_of(model).alpha.ravel(),
        process_of(model).tau.ravel(),
        atol=1e-8 * abs(process_of(model).tau).max(),
    )


def test_a_joint_that_rests_is_no_obstacle() -> None:
    arm = ARMS['polar']
    q, dq, ddq = random_motion(arm, 40, seed=0)
    for x in (q, dq, ddq):
        x[:, 1] = 0.1 if x is q else 0.0
    tau = arm.torque(q, dq, ddq)
    model = quick(dataset_of(arm, (q, dq, ddq), tau + noise_of(tau, 0.01)))
    assert np.isfinite(process_of(model).alpha).all()


def test_progress_goes_through_all_stages() -> None:
    calls: list[tuple[str, int, int]] = []
    fit(samples(), FitSettings(kernel='recursive', iterations=2), lambda *call: calls.append(call))
    stages = list(dict.fromkeys(stage for stage, _, _ in calls))
    assert stages[-2:] == ['hyperparameters', 'posterior']
    for stage in stages:
        done = [(done, total) for name, done, total in calls if name == stage]
        assert done[0][0] == 0
        assert done[-1][0] == done[-1][1] > 0


def test_training_range() -> None:
    data = samples()
    low, high = quick(data).training_range
    for row, x in enumerate((data.q, data.dq, data.ddq)):
        np.testing.assert_array_equal(low[row], x.min(axis=0))
        np.testing.assert_array_equal(high[row], x.max(axis=0))


TWO_LINKS = ARMS['two_links']
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
    tau = TWO_LINKS.torque(*motion)
    noise = noise_of(tau, 1.0, seed)
    if deviation:
        noise = gaussian_filter1d(noise, deviation, axis=0)
    noise *= SHARE * tau.std(axis=0) / noise.std(axis=0)
    dataset = dataset_of(TWO_LINKS, motion, tau + noise)
    return fit(dataset, FitSettings(kernel='recursive', subset=60, friction=False))


def squared_deviations(model: InverseDynamicsModel, seed: int) -> Array:
    """Return errors of noiseless torques and both energies at other motions, in deviations."""
    q, dq, ddq = smooth_motion(N_SAMPLES, 100 + seed)
    found, std = model.predict(q, dq, ddq), model.standard_deviation(q, dq, ddq)
    assert found.kinetic is not None
    tau = (found.tau - TWO_LINKS.torque(q, dq, ddq)) / std.tau
    return (
        np.concatenate([tau.ravel(), (found.kinetic - TWO_LINKS.kinetic(q, dq)) / std.kinetic])
        ** 2
    )


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
        dataset_of(
            TWO_LINKS, motion := random_motion(TWO_LINKS, 80, seed=0), TWO_LINKS.torque(*motion)
        ),
        FitSettings(kernel='recursive', iterations=10, friction=False),
    )
    prior = process_of(model).prior
    at = prior.hyperparameters
    tau = TWO_LINKS.torque(*motion)
    noise = noise_of(tau, 0.02)
    true = noise.std(axis=0)
    collapsed = replace(at, noise_variance=true**2 * np.array([1e-4, 1e3]))
    found, left_out = conditioned(
        prior.kernel, collapsed, dataset_of(TWO_LINKS, motion, tau + noise)
    )
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
