"""The velocity at which friction has its sign is found in the data."""

from __future__ import annotations

from dataclasses import replace

from gp.arms import ARMS, dataset_of, noise_of, random_motion
from gp.processes import process_of
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.gp import initialisation
from lip_id_ros.gp.fitting import make_kernel
from lip_id_ros.gp.initialisation import (
    FACTORS,
    initial_friction,
    initial_hyperparameters,
    SIGN_SHARE,
    with_likely_sign_widths,
)
from lip_id_ros.gp.training import MarginalLikelihood
from lip_id_ros.identification import fit
from lip_id_ros.kernels import FrictionKernel, TorqueKernel
from lip_id_ros.settings import FitSettings

ARM = ARMS['polar']
MOTION = random_motion(ARM, 60, seed=0)
USUAL = np.sqrt(np.mean(MOTION[1] ** 2, axis=0))


def with_friction(shares: list[float]) -> Dataset:
    """Return torques with a sign as wide as these shares of each joint's usual velocity."""
    tau = ARM.torque(*MOTION)
    tau = tau + tau.std(axis=0) * np.tanh(MOTION[1] / (np.array(shares) * USUAL))
    return dataset_of(ARM, MOTION, tau + noise_of(tau, 0.01))


def widths_of(kernel: TorqueKernel) -> Array:
    assert kernel.friction is not None
    return kernel.friction.sign_width


@pytest.mark.parametrize('shares', [[0.01, 0.4], [0.4, 0.01]])
def test_every_joint_has_a_width_of_its_own(shares: list[float]) -> None:
    model = fit(with_friction(shares), FitSettings(kernel='recursive', iterations=10))
    found = widths_of(process_of(model).prior.kernel) / USUAL
    narrow, wide = int(np.argmin(shares)), int(np.argmax(shares))
    assert found[narrow] <= SIGN_SHARE
    assert found[wide] == pytest.approx(FACTORS[-1] * SIGN_SHARE)


def test_no_other_width_of_a_single_joint_is_likelier() -> None:
    data = with_friction([0.1, 0.3])
    kernel = make_kernel(data, FitSettings(kernel='recursive'), 'recursive')
    at = initial_hyperparameters(kernel, data)
    found = widths_of(with_likely_sign_widths(kernel, at, data))
    last = data.n_joints - 1

    def value(factor: float) -> float:
        widths = found.copy()
        widths[last] = factor * SIGN_SHARE * USUAL[last]
        tried = replace(kernel, friction=FrictionKernel(widths))
        states = tried.states(data.q, data.dq, data.ddq)
        likelihood = MarginalLikelihood(tried, states, data.tau, at)
        return likelihood.value_and_gradient(at.vector())[0]

    best = min(FACTORS, key=value)
    assert found[last] == pytest.approx(best * SIGN_SHARE * USUAL[last])


def test_values_are_likelihoods_of_the_matrix_with_another_vector() -> None:
    rng = np.random.default_rng(5)
    now, *tried = rng.standard_normal((4, 12))
    rest = np.diag(rng.uniform(0.5, 2.0, 12))
    y = rng.standard_normal(12)
    found = initialisation._values(rest + np.outer(now, now), y, now, *tried)
    expected = []
    for z in tried:
        matrix = rest + np.outer(z, z)
        expected.append(0.5 * (y @ np.linalg.solve(matrix, y) + np.linalg.slogdet(matrix)[1]))
    np.testing.assert_allclose(np.diff(found), np.diff(expected), atol=1e-9)


@pytest.mark.parametrize('faster', [0.5, 3.0])
def test_friction_a_priori_is_a_tenth_of_each_torque_at_any_speed(faster: float) -> None:
    dq = faster * np.random.default_rng(0).standard_normal((200, 2))
    deviation = np.array([20.0, 3.0])
    viscous, coulomb, offset = initial_friction(dq, deviation).T
    for variance in (viscous * np.mean(dq**2, axis=0), coulomb, offset):
        np.testing.assert_allclose(np.sqrt(variance), 0.1 * deviation)
