"""A fit as a whole: what it refuses, what it keeps to, what it reports."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
import json
from typing import Any

from gp.arms import ARMS, dataset_of, noise_of, random_motion
from gp.processes import process_of
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.evaluation import fit_cautions
from lip_id_ros.identification import fit
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
