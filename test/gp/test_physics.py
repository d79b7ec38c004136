"""Models learned from arms in closed form know inertia, torques and energies, not only sums."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from gp.arms import Arm, ARMS, dataset_of, noise_of, random_motion
from gp.processes import process_of, with_prior
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.identification import fit
from lip_id_ros.kernels.torque_process import friction_coefficients
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.settings import FitSettings

MEMBERS = ('lip', 'recursive')
CASES = [(name, member) for name in ARMS for member in MEMBERS]
N_SAMPLES = 80
ITERATIONS = 25
VISCOUS, COULOMB = np.array([0.8, 0.3]), np.array([1.5, 0.6])


@cache
def learned(name: str, member: str) -> InverseDynamicsModel:
    arm = ARMS[name]
    motion = random_motion(arm, N_SAMPLES, seed=0)
    tau = arm.torque(*motion)
    dataset = dataset_of(arm, motion, tau + noise_of(tau))
    return fit(dataset, FitSettings(kernel=member, friction=False, iterations=ITERATIONS))


def unseen(arm: Arm) -> tuple[Array, Array, Array]:
    return random_motion(arm, 100, seed=1)


def assert_close(got: Array, expected: Array, size: float) -> None:
    """Within two parts in a thousand of a size."""
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=2e-3 * size)


@pytest.mark.slow
@pytest.mark.parametrize(('name', 'member'), CASES)
def test_torques(name: str, member: str) -> None:
    arm = ARMS[name]
    q, dq, ddq = motion = unseen(arm)
    tau = arm.torque(*motion)
    got = learned(name, member).predict(*motion)
    size = abs(tau).max()
    assert_close(got.tau, tau, size)
    assert_close(got.inertial, arm.inertial(q, ddq), size)
    assert_close(got.coriolis, arm.coriolis(q, dq), size)
    assert_close(got.gravity, arm.gravity(q), size)


@pytest.mark.parametrize(('name', 'member'), CASES)
def test_inertia_matrix(name: str, member: str) -> None:
    arm = ARMS[name]
    q, _, _ = unseen(arm)
    expected = arm.inertia(q)
    assert_close(learned(name, member).inertia_matrix(q), expected, abs(expected).max())


@pytest.mark.parametrize(('name', 'member'), CASES)
def test_energies(name: str, member: str) -> None:
    arm = ARMS[name]
    q, dq, ddq = unseen(arm)
    predictor = learned(name, member)
    got = predictor.predict(q, dq, ddq)
    kinetic = arm.kinetic(q, dq)
    assert_close(got.kinetic, kinetic, kinetic.max())
    reference = predictor.potential_reference[None]
    potential = arm.potential(q) - arm.potential(reference)
    assert got.potential is not None
    assert_close(got.potential, potential, abs(potential).max())


@cache
def learned_with_friction(member: str) -> InverseDynamicsModel:
    arm = ARMS['two_links']
    motion = random_motion(arm, 120, seed=0)
    dq = motion[1]
    tau = arm.torque(*motion) + VISCOUS * dq + COULOMB * np.sign(dq)
    dataset = dataset_of(arm, motion, tau + noise_of(tau))
    return fit(dataset, FitSettings(kernel=member, friction=True, iterations=ITERATIONS))


@pytest.mark.parametrize('member', MEMBERS)
def test_friction_coefficients_are_recovered(member: str) -> None:
    model = learned_with_friction(member)
    process = process_of(model)
    parameters, features = process.prior.hyperparameters.friction, process.states.friction
    assert parameters is not None
    assert features is not None
    got = friction_coefficients(parameters, features, process.alpha)
    np.testing.assert_allclose(got[:, 0], VISCOUS, rtol=0.02)
    np.testing.assert_allclose(got[:, 1], COULOMB, rtol=0.02)
    np.testing.assert_allclose(got[:, 2], 0.0, atol=0.02)


@pytest.mark.parametrize('member', MEMBERS)
def test_friction_is_told_from_inertia_and_gravity(member: str) -> None:
    arm = ARMS['two_links']
    q, dq, ddq = motion = unseen(arm)
    fast = (abs(dq) > 0.2).all(axis=1)  # away from where the smooth sign turns
    got = learned_with_friction(member).predict(*motion)
    size = abs(arm.torque(*motion)).max()
    assert_close(got.inertial, arm.inertial(q, ddq), size)
    assert_close(got.coriolis, arm.coriolis(q, dq), size)
    assert_close(got.gravity, arm.gravity(q), size)
    assert_close(got.friction[fast], (VISCOUS * dq + COULOMB * np.sign(dq))[fast], size)


@pytest.mark.parametrize('member', MEMBERS)
def test_torques_without_gravity(member: str) -> None:
    """From gravity-compensated torques inertia is learned as well; no potential is reported."""
    arm = ARMS['two_links']
    q, dq, ddq = motion = random_motion(arm, N_SAMPLES, seed=0)
    tau = arm.torque(*motion) - arm.gravity(q)
    dataset = dataset_of(arm, motion, tau + noise_of(tau), gravity_compensated=True)
    predictor = fit(dataset, FitSettings(kernel=member, friction=False, iterations=ITERATIONS))
    q, dq, ddq = unseen(arm)
    got = predictor.predict(q, dq, ddq)
    assert not predictor.has_potential
    assert got.potential is None
    assert np.isnan(predictor.query(q[0], dq[0], ddq[0]).potential)
    assert predictor.standard_deviation(q, dq, ddq).potential is None
    assert not got.gravity.any()
    expected = arm.inertia(q)
    assert_close(predictor.inertia_matrix(q), expected, abs(expected).max())
    assert_close(got.coriolis, arm.coriolis(q, dq), abs(got.tau).max())


def with_offset_variance(model: InverseDynamicsModel, variance: float) -> InverseDynamicsModel:
    """Condition on the same samples under another prior of the friction's offset."""
    at = process_of(model).prior.hyperparameters
    assert at.friction is not None
    friction = at.friction.copy()
    friction[:, 2] = variance
    prior = replace(process_of(model).prior, hyperparameters=replace(at, friction=friction))
    process = with_prior(process_of(model), prior)
    return replace(model, process=process)


def test_a_constant_force_of_a_sliding_joint_is_gravity_or_offset() -> None:
    """Data determine the sum of weight and friction offset; the prior determines the split."""
    arm = ARMS['slider']
    motion = random_motion(arm, N_SAMPLES, seed=0)
    tau = arm.torque(*motion)
    dataset = dataset_of(arm, motion, tau + noise_of(tau))
    model = fit(dataset, FitSettings(kernel='recursive', iterations=ITERATIONS))
    weight = arm.gravity(unseen(arm)[0])
    shares = []
    for variance in (1e-6, 1e6):
        got = with_offset_variance(model, variance).predict(*unseen(arm))
        assert_close(got.gravity + got.friction, weight, weight.max())
        shares.append((got.gravity / weight).mean())
    assert shares[0] > 0.9
    assert shares[1] < 0.1
