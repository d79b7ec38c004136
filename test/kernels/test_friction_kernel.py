"""The friction kernel: covariances from the definition, gradients from differences."""

from __future__ import annotations

from kernels.cases import random_states
import numpy as np
import pytest

from lip_id_ros.kernels import FrictionKernel
from lip_id_ros.kernels.torque_process import friction_covariance, friction_gradient


def test_friction_by_definition() -> None:
    """The kernel is linear in velocity, smooth sign and a constant."""
    rng = np.random.default_rng(1)
    kernel, parameters = FrictionKernel(np.full(3, 0.2)), rng.random((3, 3))
    (_, dq, _), (_, dp, _) = random_states(2, 3, rng), random_states(4, 3, rng)
    got = friction_covariance(parameters, kernel.features(dq), kernel.features(dp))
    for i in range(3):
        a, b, c = parameters[i]
        for t in range(2):
            for u in range(4):
                signs = np.tanh(dq[t, i] / 0.2) * np.tanh(dp[u, i] / 0.2)
                expected = a * dq[t, i] * dp[u, i] + b * signs + c
                assert got[i, t, u] == pytest.approx(expected)


def test_gradient_of_the_friction_kernel() -> None:
    """The derivative by each parameter is the central difference."""
    rng = np.random.default_rng(0)
    x = FrictionKernel(0.1 + rng.random(3)).features(rng.normal(size=(7, 3)))
    parameters, contraction = rng.random((3, 3)), rng.normal(size=(3, 7, 7))
    contraction += contraction.transpose(0, 2, 1)
    got = friction_gradient(x, contraction)
    for index in np.ndindex(parameters.shape):
        step = np.zeros_like(parameters)
        step[index] = 1e-6
        up = (contraction * friction_covariance(parameters + step, x, x)).sum()
        down = (contraction * friction_covariance(parameters - step, x, x)).sum()
        assert got[index] == pytest.approx((up - down) / 2e-6, rel=1e-6, abs=1e-7)
