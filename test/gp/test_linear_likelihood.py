"""The likelihood of links and friction against that by the Gram matrix."""

from __future__ import annotations

from dataclasses import replace

from gp.arms import ARMS, dataset_of, noise_of, random_motion
from kernels.cases import random_links
import numpy as np
import pytest

from lip_id_ros.errors import FitError
from lip_id_ros.gp.initialisation import initial_hyperparameters, make_friction
from lip_id_ros.gp.likelihood import LinearLikelihood, MarginalLikelihood
from lip_id_ros.gp.log_vector import to_vector
from lip_id_ros.kernels import JointBasis, TorqueKernel
from lip_id_ros.kernels.program import none, recursive


def likelihoods(name: str, friction: bool) -> tuple[MarginalLikelihood, LinearLikelihood]:
    arm, rng = ARMS[name], np.random.default_rng(3)
    motion = random_motion(arm, 12, seed=1)
    tau = arm.torque(*motion)
    dataset = dataset_of(arm, motion, tau + noise_of(tau, 0.1))
    n = dataset.n_joints
    links = random_links(dataset.joint_types, rng)
    basis = JointBasis.of(dataset.joint_types, dataset.q)
    per_joint = (make_friction(dataset.dq),) if friction else ()
    kernel = TorqueKernel(none(n), basis, per_joint, (links,))
    centre = initial_hyperparameters(kernel.energy, per_joint, dataset.dq, dataset.ddq, tau)
    states = kernel.states(*motion)
    return (
        MarginalLikelihood(kernel, states, dataset.tau, centre),
        LinearLikelihood(kernel, states, dataset.tau, centre),
    )


@pytest.mark.parametrize('friction', [True, False])
@pytest.mark.parametrize('name', sorted(ARMS))
def test_value_and_gradient_are_those_by_the_gram_matrix(name: str, friction: bool) -> None:
    by_gram, by_features = likelihoods(name, friction)
    rng = np.random.default_rng(5)
    for _ in range(3):
        vector = to_vector(by_gram.like)
        vector = vector + rng.standard_normal(vector.shape)
        value, gradient = by_features.value_and_gradient(vector)
        expected, expected_gradient = by_gram.value_and_gradient(vector)
        assert value == pytest.approx(expected, rel=1e-9)
        np.testing.assert_allclose(
            gradient, expected_gradient, atol=1e-8 * abs(expected_gradient).max()
        )


def test_what_is_linear() -> None:
    kernel = likelihoods('polar', friction=True)[0].kernel
    assert kernel.is_linear
    assert not replace(kernel, energy=recursive(2)).is_linear


def test_torques_that_are_not_finite_are_refused() -> None:
    likelihood = likelihoods('polar', friction=True)[1]
    vector = to_vector(likelihood.like)
    vector[-1] = np.nan
    with pytest.raises(FitError, match=r'expected to be finite'):
        likelihood.value_and_gradient(vector)
