"""What a posterior would learn from a motion, and gradients of that."""

from __future__ import annotations

from collections.abc import Sequence

from excitation.cases import random_limits
import numpy as np
import pytest
from rigid_body.arms import ARMS, random_bodies, random_chain

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.arms import KnownArm, unknown_arm, UnknownArm
from lip_id_ros.excitation.expected_error import ExpectedError, MeanCriterion, States
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.friction.terms import Coulomb, LoadCoulomb, LoadViscous, Offset, Stribeck, Viscous
from lip_id_ros.joint_types import PRISMATIC, REVOLUTE
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.couplings import Coupling, rows_of
from lip_id_ros.rigid_body.regressor_pullback import placement_pullback
from lip_id_ros.rigid_body.rnea_derivatives import placement_derivatives

WIDTH = 0.3


COUPLED = 'RPRPRR', 'PRP'
CASES = [*((arm, ()) for arm in ARMS), *((arm, (Coupling(2, 1, -0.7),)) for arm in COUPLED)]


def posterior(
    arm: str, rng: np.random.Generator, loaded: bool, couplings: Sequence[Coupling] = ()
) -> ArmPosterior:
    n = len(arm)
    chain = random_chain(arm, rng)
    chain = chain._replace(
        rotations=np.ascontiguousarray(chain.rotations),
        translations=np.ascontiguousarray(chain.translations),
        couplings=rows_of(couplings),
    )
    terms = [
        DriveTerm(Drive.of_joint(joint), term)
        for joint in range(n)
        for term in (Viscous(), Coulomb(WIDTH), Offset())
    ]
    terms.append(DriveTerm(Drive.of_joint(n - 1), Stribeck(WIDTH)))
    if loaded:
        terms += [
            DriveTerm(Drive.of_joint(0), LoadCoulomb(WIDTH)),
            DriveTerm(Drive.of_joint(n - 1), LoadViscous()),
        ]
    if n > 1:
        terms.append(DriveTerm(Drive((1, 0), (1.0, 0.5)), Coulomb(WIDTH)))
    basis = FrictionBasis(n, tuple(terms), rise_time=0.02)
    friction = FrictionModel(basis, rng.uniform(0.1, 0.3, basis.size))
    size = 17 * n + basis.with_shapes().size
    return ArmPosterior(
        chain,
        random_bodies(n, rng),
        friction,
        TorqueNoise.constant(rng.uniform(0.1, 0.2, n)),
        0.1 * rng.standard_normal((size, 12)),
    )


@pytest.mark.parametrize(('arm', 'couplings'), CASES)
def test_gradients_of_placement_derivatives_are_those_of_differences(
    arm: str, couplings: Sequence[Coupling]
) -> None:
    rng = np.random.default_rng(len(arm))
    known = posterior(arm, rng, False, couplings)
    n, h = len(arm), 1e-6
    states, weights = rng.standard_normal((3, 5, n)), rng.standard_normal((5, n, 6 * n))
    found = placement_pullback(known.chain, known.links, weights, *states)
    for which in range(3):
        for joint in range(n):
            ends = []
            for sign in (1.0, -1.0):
                moved = states.copy()
                moved[which, :, joint] += sign * h
                slopes = placement_derivatives(known.chain, known.links, *moved)
                ends.append(np.sum(weights * slopes.reshape(weights.shape), axis=(1, 2)))
            expected = (ends[0] - ends[1]) / (2.0 * h)
            np.testing.assert_allclose(found[which, :, joint], expected, rtol=1e-5, atol=1e-4)


@pytest.mark.parametrize('loaded', [False, True])
@pytest.mark.parametrize(('arm', 'couplings'), CASES)
def test_gradients_of_the_criterion_are_those_of_differences(
    arm: str, couplings: Sequence[Coupling], loaded: bool
) -> None:
    rng = np.random.default_rng(10 + len(arm))
    learner = KnownArm(posterior(arm, rng, loaded, couplings))
    targets = rng.standard_normal((3, 30, len(arm)))
    states = rng.standard_normal((3, 8, len(arm)))
    criterion = ExpectedError(learner, (targets[0], targets[1], targets[2]), 40.0, 8)
    _, gradient = criterion(*states)
    h = 1e-6
    for _ in range(3):
        direction = rng.standard_normal(states.shape)
        ahead, back = (criterion(*(states + sign * h * direction))[0] for sign in (1, -1))
        np.testing.assert_allclose(
            np.sum(gradient * direction), (ahead - back) / (2.0 * h), rtol=1e-4, atol=1e-6
        )


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


def test_friction_of_an_unknown_arm_is_as_unknown_at_full_speed_as_in_slow_motion() -> None:
    rng = np.random.default_rng(0)
    n, targets = len(TYPES), rng.standard_normal((3, 60, len(TYPES)))
    limits = random_limits(rng, n)
    arm = unknown_arm(limits, TYPES, tuple(targets), rng)
    still = np.zeros((1, n))
    rows = (arm.jacobian(still, limits.velocity[None], still) @ arm.root)[0]
    viscous, coulomb, _ = rows[:, LINK_PARAMETERS * n :].reshape(n, 3, n).transpose(1, 0, 2)
    np.testing.assert_allclose(viscous, coulomb)
