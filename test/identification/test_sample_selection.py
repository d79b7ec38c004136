"""Samples that are left out of an identification."""

from __future__ import annotations

from dataclasses import replace

from gp.arms import dataset_of
from gp.chains import R, random_arm
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.identification import fit
from lip_id_ros.identification.sample_selection import (
    explained,
    measured,
    plausible,
    without_long_rests,
)


def recorded() -> Dataset:
    arm = random_arm((R, R), seed=1)
    motion = arm.motion(400, seed=0)
    return dataset_of(arm, motion, arm.torque(*motion))


@pytest.mark.parametrize('name', ['dq', 'ddq', 'tau'])
def test_absurd_values_are_left_out(name: str) -> None:
    dataset = recorded()
    values = getattr(dataset, name).copy()
    values[[7, 90], 1] *= 1e3
    kept = plausible(replace(dataset, **{name: values}))
    np.testing.assert_array_equal(np.flatnonzero(~kept), [7, 90])


def resting(dataset: Dataset, begins: list[int], lengths: list[int], force: float) -> Dataset:
    """Let the arm rest before some samples; its friction then holds back any force."""
    rng = np.random.default_rng(0)
    rows, number = [], 0
    for begin, length in zip(begins, lengths, strict=True):
        rows += [*range(number, begin), *[begin] * length]
        number = begin
    chosen = np.array([*rows, *range(number, dataset.n_samples)])
    is_rest = np.diff(chosen, prepend=-1) == 0
    dq, ddq = (np.where(is_rest[:, None], 0.0, each[chosen]) for each in (dataset.dq, dataset.ddq))
    arm = random_arm((R, R), seed=1)
    tau = arm.torque(dataset.q[chosen], dq, ddq)
    tau += np.where(is_rest[:, None], force + 1e-3 * rng.standard_normal(tau.shape), 0.0)
    return replace(dataset_of(arm, (dataset.q[chosen], dq, ddq), tau))


def test_of_a_long_rest_a_few_samples_are_kept() -> None:
    dataset = resting(recorded(), [0, 200], [50, 1000], 0.1)
    rows = without_long_rests(dataset)
    is_rest = (dataset.dq == 0.0).all(axis=1)
    assert np.isin(np.flatnonzero(~is_rest), rows).all()
    kept = rows[is_rest[rows]]
    assert (kept < 50).sum() == 49
    assert 98 <= (kept > 200).sum() <= 100
    assert kept[-1] > 1200
    many = resting(recorded(), [40 * k for k in range(10)], [90] * 10, 0.1)
    assert 750 <= without_long_rests(many).size <= 800


def test_large_residuals_are_left_out() -> None:
    residual = np.random.default_rng(0).standard_normal((400, 2))
    residual[33, 0] = -20.0
    np.testing.assert_array_equal(np.flatnonzero(~explained(residual)), [33])


def test_what_is_common_is_no_outlier() -> None:
    """A joint that moves a fifth of the time, and one that hardly ever does."""
    dataset = recorded()
    dq = dataset.dq.copy()
    dq[:, 0] *= np.arange(400) % 5 == 0
    dq[:, 1] = 0.0
    assert plausible(replace(dataset, dq=dq)).all()
    residual = np.zeros((400, 1))
    residual[::5] = 1.0
    assert explained(residual).all()


def test_zeros_of_drives_that_are_off_are_left_out() -> None:
    """With the samples beside them, which a low-pass mixes with zeros."""
    dataset = recorded()
    tau = dataset.tau.copy()
    tau[100:300] = 1e-6 * tau[100:300]
    kept = measured(replace(dataset, tau=tau))
    np.testing.assert_array_equal(np.flatnonzero(~kept), np.arange(92, 308))


def test_zeros_of_one_joint_or_of_a_moment_are_torques() -> None:
    dataset = recorded()
    tau = dataset.tau.copy()
    tau[:, 0], tau[100:109] = 0.0, 0.0
    assert measured(replace(dataset, tau=tau)).all()
    assert measured(replace(dataset, tau=0.0 * tau)).all()
    assert measured(dataset).all()


@pytest.mark.slow
def test_a_fit_does_not_suffer_from_drives_that_were_off() -> None:
    """For more than half of the time, while the arm was held by its brakes."""
    dataset = recorded()
    held = resting(dataset, [0, 200], [500, 500], 0.0)
    tau = np.where((held.dq == 0.0).all(axis=1)[:, None], 0.0, held.tau)
    model = fit(replace(held, tau=tau))
    error = np.mean((model.predict(dataset.q, dataset.dq, dataset.ddq).tau - dataset.tau) ** 2)
    assert error < 1e-8 * dataset.tau.var()
