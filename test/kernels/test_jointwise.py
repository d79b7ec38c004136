"""Friction and residual: covariances from definitions, gradients from differences."""

from __future__ import annotations

from kernels.cases import random_states
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import Friction, JointBasis, PerJointKernel, Residual

N_JOINTS = 3
TYPES = ('revolute', 'prismatic', 'revolute')


def make(name: str) -> tuple[PerJointKernel, Array, Array, Array]:
    """Return a kernel, its parameters and two sets of inputs."""
    rng = np.random.default_rng(0)
    basis = JointBasis(TYPES, rng.normal(size=3), 0.5 + rng.random(3))
    kernels: dict[str, tuple[PerJointKernel, Array]] = {
        'friction': (Friction(0.1 + rng.random(3)), rng.random((3, 3))),
        'residual': (Residual(basis, 0.5 + rng.random((2, 3))), 0.5 + rng.random((3, 4))),
    }
    kernel, parameters = kernels[name]
    x = kernel.inputs(*random_states(7, N_JOINTS, rng))
    z = kernel.inputs(*random_states(5, N_JOINTS, rng))
    return kernel, parameters, x, z


def test_friction_by_definition() -> None:
    """The kernel is linear in velocity, smooth sign and a constant."""
    rng = np.random.default_rng(1)
    kernel, parameters = Friction(np.full(3, 0.2)), rng.random((3, 3))
    (q, dq, ddq), (p, dp, ddp) = random_states(2, 3, rng), random_states(4, 3, rng)
    got = kernel.covariance(parameters, kernel.inputs(q, dq, ddq), kernel.inputs(p, dp, ddp))
    for i in range(3):
        a, b, c = parameters[i]
        for t in range(2):
            for u in range(4):
                signs = np.tanh(dq[t, i] / 0.2) * np.tanh(dp[u, i] / 0.2)
                expected = a * dq[t, i] * dp[u, i] + b * signs + c
                assert got[i, t, u] == pytest.approx(expected)


def test_residual_by_definition() -> None:
    """A squared exponential of distances in features, velocities and accelerations."""
    rng = np.random.default_rng(1)
    basis = JointBasis(TYPES, np.zeros(3), np.ones(3))
    scales = 0.5 + rng.random((2, 3))
    kernel, parameters = Residual(basis, scales), 0.5 + rng.random((3, 4))
    (q, dq, ddq), (p, dp, ddp) = random_states(2, 3, rng), random_states(4, 3, rng)
    got = kernel.covariance(parameters, kernel.inputs(q, dq, ddq), kernel.inputs(p, dp, ddp))
    for i, (variance, *lengths) in enumerate(parameters):
        for t in range(2):
            for u in range(4):
                turn = 2.0 - 2.0 * np.cos(q[t] - p[u])
                turn[1] = (q[t, 1] - p[u, 1]) ** 2
                velocity = ((dq[t] - dp[u]) / scales[0]) ** 2
                acceleration = ((ddq[t] - ddp[u]) / scales[1]) ** 2
                groups = np.array([turn.sum(), velocity.sum(), acceleration.sum()])
                expected = variance * np.exp(-0.5 * (groups / np.square(lengths)).sum())
                assert got[i, t, u] == pytest.approx(expected)


@pytest.mark.parametrize('name', ['friction', 'residual'])
def test_prior_variance_is_the_diagonal(name: str) -> None:
    """The shortcut and the whole agree."""
    kernel, parameters, x, _ = make(name)
    diagonal = np.einsum('itt->ti', kernel.covariance(parameters, x, x))
    np.testing.assert_allclose(kernel.prior_variance(parameters, x), diagonal)


@pytest.mark.parametrize('name', ['friction', 'residual'])
def test_gradient(name: str) -> None:
    """Against central differences by every parameter."""
    kernel, parameters, x, _ = make(name)
    contraction = np.random.default_rng(2).normal(size=(3, 7, 7))
    contraction += contraction.transpose(0, 2, 1)
    got = kernel.gradient(parameters, x, contraction)
    for index in np.ndindex(parameters.shape):
        step = np.zeros_like(parameters)
        step[index] = 1e-6
        up = (contraction * kernel.covariance(parameters + step, x, x)).sum()
        down = (contraction * kernel.covariance(parameters - step, x, x)).sum()
        assert got[index] == pytest.approx((up - down) / 2e-6, rel=1e-6, abs=1e-7)
