"""Hyperparameters as a vector of logarithms, there and back."""

from __future__ import annotations

from gp.cases import P, R, random_hyperparameters, random_kernel
from hypothesis import given
from hypothesis import strategies as st
from kernels.cases import MEMBERS, random_states
import numpy as np
import pytest

from lip_id_ros.kernels import FrictionKernel, Hyperparameters
from lip_id_ros.kernels.torque_process import friction_covariance, friction_gradient


@st.composite
def hyperparameters(draw: st.DrawFn) -> Hyperparameters:
    """Of any member of the family, any arm, with or without friction."""
    types = tuple(draw(st.lists(st.sampled_from([R, P]), min_size=1, max_size=4)))
    member, friction = draw(st.sampled_from(MEMBERS)), draw(st.booleans())
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return random_hyperparameters(random_kernel(member, types, friction, rng), rng)


@given(at=hyperparameters())
def test_round_trip(at: Hyperparameters) -> None:
    vector = at.vector()
    back = at.with_vector(vector)
    for (name, expected), (same, values) in zip(
        at.groups().items(), back.groups().items(), strict=True
    ):
        assert name == same
        np.testing.assert_allclose(values, expected, rtol=1e-14, err_msg=name)
    np.testing.assert_allclose(back.vector(), vector, atol=1e-14)


def test_a_name_tells_the_entry() -> None:
    rng = np.random.default_rng(0)
    at = random_hyperparameters(random_kernel('lip', (R, P), True, rng), rng)
    place = at.names().index('velocities[1, 0]')
    assert at.vector()[place] == np.log(at.weights.velocities[1, 0])
    assert at.names()[-1] == 'noise_variance[1]'


@given(at=hyperparameters())
def test_derivatives_by_logarithms(at: Hyperparameters) -> None:
    """The sum of squares of the parameters has the derivative 2 p by p, 2 p^2 by log p."""
    gradient = at.with_vector(at.vector() + np.log(2.0))
    got = at.log_gradient(gradient)
    np.testing.assert_allclose(got, 2.0 * np.exp(2.0 * at.vector()), rtol=1e-13)


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
