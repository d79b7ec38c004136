"""Samples that are left out of an identification."""

from __future__ import annotations

from dataclasses import replace

from gp.arms import dataset_of
from gp.chains import R, random_arm
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.sample_selection import explained, plausible


def recorded() -> Dataset:
    arm = random_arm((R, R), seed=1)
    motion = arm.motion(400, seed=0)
    return dataset_of(arm, motion, arm.torque(*motion))


def test_sound_samples_are_kept() -> None:
    dataset = recorded()
    assert plausible(dataset).all()
    residual = np.random.default_rng(0).standard_normal((400, 2))
    assert explained(residual).all()


@pytest.mark.parametrize('name', ['dq', 'ddq', 'tau'])
def test_absurd_values_are_left_out(name: str) -> None:
    dataset = recorded()
    values = getattr(dataset, name).copy()
    values[[7, 90], 1] *= 1e3
    kept = plausible(replace(dataset, **{name: values}))
    np.testing.assert_array_equal(np.flatnonzero(~kept), [7, 90])


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
