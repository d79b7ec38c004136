"""Recordings of hard kinds of arms, and the rows of their table."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.families import FAMILIES, FamilyArm, logs_of, remembered, row_of
from lip_id_ros.friction.dahl import dahl_states, Steps
from lip_id_ros.joint_types import DISPLACEMENTS


@pytest.mark.parametrize('name', FAMILIES)
def test_a_seed_records_the_same_arm_again(name: str) -> None:
    first, again = (FamilyArm(FAMILIES[name], 3).recorded(3) for _ in range(2))
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.tau, other.tau)
        assert one.joint_types == FAMILIES[name].joint_types
    train, test = first
    assert len(np.unique(train.recording)) == FAMILIES[name].recordings
    assert np.all(test.tau.std(axis=0) > 0.1 * train.tau.std(axis=0))
    assert FamilyArm(FAMILIES[name], 4).recorded(4)[0].tau[0, 0] != train.tau[0, 0]


def test_coarse_currents_have_few_values_before_they_are_filtered() -> None:
    family = FAMILIES['small, coarse currents']
    assert family.step > 0.0
    train, _ = FamilyArm(family, 0).recorded(0)
    assert 1.0 / np.median(np.diff(train.t)) == pytest.approx(family.rate_hz, rel=0.05)


def test_friction_that_remembers_is_that_of_the_model() -> None:
    rng = np.random.default_rng(0)
    q = np.cumsum(0.002 * rng.standard_normal((300, 2)), axis=0)
    begins = np.zeros(len(q), dtype=bool)
    begins[0] = True
    steps = Steps.of(q, np.zeros_like(q), begins, np.ones(2, dtype=bool))
    for k, displacement in enumerate(DISPLACEMENTS):
        found = remembered(q, np.zeros(2), np.full(2, displacement))
        np.testing.assert_allclose(found, dahl_states(steps)[:, :, k], atol=1e-12)


def test_a_line_compares_the_default_with_the_best() -> None:
    rows = {
        'processes': [{'nmse': [1.0, 4.0]}, {'nmse': [2.0, 2.0]}],
        'named': [{'nmse': [1.0, 1.0]}, {'nmse': [1.0, 1.0]}],
        'friction': [{'nmse': [8.0, 8.0]}, {'nmse': [8.0, 8.0]}],
    }
    logs = logs_of(rows)
    assert logs.shape == (3, 4)
    assert row_of('soft', logs) == '| soft | 2 | 1 | 8 | 2.00 |'
