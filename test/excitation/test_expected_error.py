"""What would be learned of an arm from a motion."""

from __future__ import annotations

from excitation.cases import random_limits
import numpy as np
import pytest

from lip_id_ros.excitation.arms import unknown_arm
from lip_id_ros.excitation.expected_error import ExpectedError, Learner, States
from lip_id_ros.joint_types import PRISMATIC, REVOLUTE
from lip_id_ros.rigid_body import LINK_PARAMETERS

TYPES = (REVOLUTE, PRISMATIC, REVOLUTE, REVOLUTE)


def arm_and_states(seed: int) -> tuple[Learner, States, States]:
    rng = np.random.default_rng(seed)
    targets = rng.standard_normal((3, 60, len(TYPES)))
    arm = unknown_arm(random_limits(rng, len(TYPES)), TYPES, tuple(targets), rng)
    q, dq, ddq = rng.standard_normal((3, 20, len(TYPES)))
    return arm, (targets[0], targets[1], targets[2]), (q, dq, ddq)


@pytest.mark.parametrize('seed', range(3))
def test_the_share_that_is_left_is_that_of_bayes(seed: int) -> None:
    """Conditioning a covariance on measurements, without roots."""
    arm, targets, states = arm_and_states(seed)
    found = ExpectedError(arm, targets, 60.0).shares(states)

    prior = arm.root @ arm.root.T
    rows = np.repeat(arm.jacobian(*states), 3, axis=0).reshape(-1, len(prior))
    noise = np.diag(np.tile(arm.noise**2, 60))
    gain = np.linalg.solve(rows @ prior @ rows.T + noise, rows @ prior).T
    after = prior - gain @ rows @ prior
    at = arm.jacobian(*targets)
    left = np.einsum('tjp,pr,tjr->j', at, after, at)
    before = np.einsum('tjp,pr,tjr->j', at, prior, at)
    np.testing.assert_allclose(found, left / before, rtol=1e-5)


def test_more_measurements_leave_less() -> None:
    arm, targets, states = arm_and_states(0)
    few, many = (ExpectedError(arm, targets, m).shares(states) for m in (20.0, 200.0))
    assert np.all(many < few)
    assert np.all(few < 1.0)


def test_friction_of_an_unknown_arm_is_as_unknown_at_full_speed_as_in_slow_motion() -> None:
    rng = np.random.default_rng(0)
    n, targets = len(TYPES), rng.standard_normal((3, 60, len(TYPES)))
    limits = random_limits(rng, n)
    arm = unknown_arm(limits, TYPES, tuple(targets), rng)
    still = np.zeros((1, n))
    rows = (arm.jacobian(still, limits.velocity[None], still) @ arm.root)[0]
    viscous, coulomb, _ = rows[:, LINK_PARAMETERS * n :].reshape(n, 3, n).transpose(1, 0, 2)
    np.testing.assert_allclose(viscous, coulomb)
