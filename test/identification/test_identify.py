"""Arms identified from simulated recordings, usual and unusual ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gp.arms import dataset_of, noise_of
from gp.chains import ChainArm, P, R, random_arm
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import FitError
from lip_id_ros.friction.conservative_terms import position_curve, velocity_curve
from lip_id_ros.identification.identify import (
    FRICTION,
    Identified,
    identify,
    NAMED,
)
from lip_id_ros.rigid_body.pseudo_inertia import pseudo_inertia

NOISE = 1e-3
ARMS = [(P, P), (R, P, R), (R, R, R, R)]
Motion = tuple[Array, Array, Array]


def samples_of(arm: ChainArm, count: int = 120, noise: float = NOISE) -> Dataset:
    motion = arm.motion(count, seed=0)
    tau = arm.torque(*motion)
    return dataset_of(arm, motion, tau + noise_of(tau, noise))


def assert_predicts(found: Identified, motion: Motion, tau: Array, share: float = 3e-3) -> None:
    np.testing.assert_allclose(found.torque(*motion), tau, atol=share * np.abs(tau).max())


@pytest.mark.slow
@pytest.mark.parametrize('joint_types', ARMS, ids=lambda kinds: ''.join(k[0] for k in kinds))
def test_random_arms(joint_types: tuple[str, ...]) -> None:
    """The noise is found, unseen torques are the true ones, and every link can exist."""
    arm = random_arm(joint_types, seed=11)
    dataset = samples_of(arm)
    found = identify(dataset)
    noise = NOISE * arm.torque(dataset.q, dataset.dq, dataset.ddq).std(axis=0)
    np.testing.assert_allclose(found.arm.noise.std, noise, rtol=0.3)
    motion = arm.motion(100, seed=1)
    assert_predicts(found, motion, arm.torque(*motion))
    assert found.searches_agreed
    assert found.residual_gp is None
    assert found.outliers == 0
    assert (np.linalg.eigvalsh(pseudo_inertia(found.arm.links)) > 0.0).all()


@pytest.mark.slow
def test_gravity_of_another_size() -> None:
    """Links of other lengths have the same torques on the Earth."""
    arm = random_arm((R, R, R), seed=6, gravity=24.8)
    motion = arm.motion(100, seed=1)
    assert_predicts(identify(samples_of(arm)), motion, arm.torque(*motion))


@pytest.mark.slow
def test_torques_without_gravity() -> None:
    arm = random_arm((R, P, R), seed=9, gravity=0.0)
    found = identify(replace(samples_of(arm), gravity_compensated=True))
    assert not found.arm.chain.gravity.any()
    motion = arm.motion(100, seed=1)
    assert_predicts(found, motion, arm.torque(*motion))


def at_rest(q: Array, dq: Array, ddq: Array) -> None:
    dq[:], ddq[:] = 0.0, 0.0


def violent(q: Array, dq: Array, ddq: Array) -> None:
    dq *= 1e3
    ddq *= 1e6


def far_away(q: Array, dq: Array, ddq: Array) -> None:
    q += 1e4


def repeated(q: Array, dq: Array, ddq: Array) -> None:
    half = len(q) // 2
    for x in (q, dq, ddq):
        x[half:] = x[:half]


@pytest.mark.slow
@pytest.mark.parametrize('change', [at_rest, violent, far_away, repeated])
def test_unusual_motions(change: Callable[[Array, Array, Array], None]) -> None:
    arm = random_arm((R, R), seed=1)
    motion, unseen = arm.motion(120, seed=0), arm.motion(100, seed=1)
    change(*motion)
    change(*unseen)
    tau = arm.torque(*motion)
    found = identify(dataset_of(arm, motion, tau + noise_of(tau)))
    assert_predicts(found, unseen, arm.torque(*unseen), 0.01)


def test_few_samples() -> None:
    """Ten of two joints: too few for a good model, enough for a usable one."""
    arm = random_arm((R, R), seed=4)
    motion = arm.motion(100, seed=1)
    tau = arm.torque(*motion)
    error = np.mean((identify(samples_of(arm, 10)).torque(*motion) - tau) ** 2, axis=0)
    assert (error < 0.1 * tau.var(axis=0)).all()


@pytest.mark.slow
@pytest.mark.parametrize('size', [1e-3, 1e4])
def test_torques_of_any_size(size: float) -> None:
    arm = random_arm((R, R), seed=2)
    dataset, motion = samples_of(arm), arm.motion(100, seed=1)
    found = identify(replace(dataset, tau=size * dataset.tau))
    assert_predicts(found, motion, size * arm.torque(*motion))


@pytest.mark.slow
def test_a_spring_between_joints_has_a_process_beside_the_links() -> None:
    """It is no rigid link, and a function of both angles; one joint may do with its own."""
    arm = random_arm((R, R), seed=4)

    def torque(q: Array, dq: Array, ddq: Array) -> Array:
        spring = -10.0 * np.sin(q[:, 0] - q[:, 1])
        return arm.torque(q, dq, ddq) + spring[:, None] * (1.0, -1.0)

    motion, unseen = arm.motion(120, seed=0), arm.motion(100, seed=1)
    tau = torque(*motion)
    data = dataset_of(arm, motion, tau + noise_of(tau))
    found = identify(data)
    assert found.residual_gp is not None
    assert found.residual_gp.joints.any()
    assert not found.residual_gp.replaces.any()
    assert_predicts(found, unseen, torque(*unseen), 0.06)
    assert identify(data, terms=NAMED).residual_gp is None
    # of less motion left-out blocks are not like other motions
    assert identify(replace(data, t=0.05 * data.t)).residual_gp is None


@pytest.mark.slow
def test_curves_are_left_out_where_the_setting_says_friction_alone() -> None:
    arm = random_arm((R, R), seed=4)
    motion = arm.motion(120, seed=0)
    tau = arm.torque(*motion) + 5.0 * np.sin(3.0 * motion[1] / motion[1].std(axis=0))
    data = dataset_of(arm, motion, tau + noise_of(tau))
    curves = [
        any(each.term.kind in (position_curve, velocity_curve) for each in basis.terms)
        for terms in (NAMED, FRICTION)
        for basis in [identify(data, terms=terms).arm.friction.basis]
    ]
    assert curves == [True, False]


@pytest.mark.filterwarnings('ignore::RuntimeWarning')
def test_numbers_too_large_are_refused() -> None:
    dataset = samples_of(random_arm((R, R), seed=4), 20)
    with pytest.raises(FitError, match='check the data for values beyond what the robot can do'):
        identify(replace(dataset, tau=1e200 * dataset.tau))
