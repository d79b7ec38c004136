"""The expected error against its definition, and its gradients against differences."""

from __future__ import annotations

from excitation.cases import random_limits
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.expected_error import ExpectedError, MeanCriterion, States
from lip_id_ros.excitation.unknown_arms import unknown_arm, UnknownArm
from lip_id_ros.joint_types import PRISMATIC, REVOLUTE

TYPES = (REVOLUTE, PRISMATIC, REVOLUTE, REVOLUTE)


def arm_and_states(seed: int) -> tuple[UnknownArm, States, Array]:
    rng = np.random.default_rng(seed)
    targets = rng.standard_normal((3, 60, len(TYPES)))
    arm = unknown_arm(random_limits(rng, len(TYPES)), TYPES, tuple(targets), rng)
    return arm, (targets[0], targets[1], targets[2]), rng.standard_normal((3, 20, len(TYPES)))


@pytest.mark.parametrize('seed', range(3))
def test_the_share_that_is_left_is_that_of_bayes(seed: int) -> None:
    """Conditioning a covariance on measurements, without roots."""
    arm, targets, states = arm_and_states(seed)
    found = ExpectedError(arm, targets, 60.0, 20).shares(*states)

    prior = arm.root @ arm.root.T
    rows = np.repeat(arm.jacobian(*states), 3, axis=0).reshape(-1, len(prior))
    noise = np.diag(np.tile(arm.noise**2, 60))
    gain = np.linalg.solve(rows @ prior @ rows.T + noise, rows @ prior).T
    after = prior - gain @ rows @ prior
    at = arm.jacobian(*targets)
    left = np.einsum('tjp,pr,tjr->j', at, after, at)
    before = np.einsum('tjp,pr,tjr->j', at, prior, at)
    np.testing.assert_allclose(found, left / before, rtol=1e-5)


@pytest.mark.parametrize('seed', range(3))
def test_gradients_are_those_of_differences(seed: int) -> None:
    arm, targets, states = arm_and_states(seed)
    criterion = MeanCriterion(
        [ExpectedError(arm, targets, measurements, 20) for measurements in (30.0, 900.0)]
    )
    value, gradient = criterion(*states)
    direction = np.random.default_rng(9).standard_normal(states.shape)
    h = 1e-6
    ahead, back = (criterion(*(states + sign * h * direction))[0] for sign in (1, -1))
    assert back < value < ahead or ahead < value < back
    np.testing.assert_allclose(np.sum(gradient * direction), (ahead - back) / (2.0 * h), rtol=2e-5)


def test_more_measurements_leave_less() -> None:
    arm, targets, states = arm_and_states(0)
    few, many = (ExpectedError(arm, targets, m, 20).shares(*states) for m in (20.0, 200.0))
    assert np.all(many < few)
    assert np.all(few < 1.0)
