"""The marginal likelihood against a textbook's, its gradient against differences."""

from __future__ import annotations

from gp.cases import random_likelihood, TYPES, without_gravity
from kernels.cases import MEMBERS
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from lip_id_ros.arrays import Array
from lip_id_ros.gp.training import MarginalLikelihood
from lip_id_ros.kernels.gram import cross_gram
from lip_id_ros.kernels.torque_process import friction_covariance


def dense_covariance(likelihood: MarginalLikelihood) -> Array:
    """Return the covariance of the measured torques, put together entry by entry."""
    kernel, at, x = likelihood.kernel, likelihood.like, likelihood.states
    n = kernel.energy.n_joints
    total = cross_gram(kernel.energy, at.weights, x.packed, x.packed)
    if at.friction is not None and x.friction is not None:
        covariances = friction_covariance(at.friction, x.friction, x.friction)
        for joint, covariance in enumerate(covariances):
            for row in range(len(x)):
                for column in range(len(x)):
                    total[row * n + joint, column * n + joint] += covariance[row, column]
    return total + np.kron(np.eye(len(x)), np.diag(at.noise_variance))


def differences(likelihood: MarginalLikelihood, direction: Array, step: float = 1e-5) -> float:
    """Return the derivative along a direction by central differences of fourth order."""
    at = likelihood.like.vector()

    def value(steps: int) -> float:
        return likelihood.value_and_gradient(at + steps * step * direction)[0]

    return (8.0 * (value(1) - value(-1)) - (value(2) - value(-2))) / (12.0 * step)


@pytest.mark.parametrize('friction', [False, True])
@pytest.mark.parametrize('member', MEMBERS)
def test_value_is_the_textbooks(member: str, friction: bool) -> None:
    likelihood = random_likelihood(member, TYPES, friction, 11)
    value, _ = likelihood.value_and_gradient(likelihood.like.vector())
    normal = multivariate_normal(cov=dense_covariance(likelihood))
    assert value == pytest.approx(-normal.logpdf(likelihood.tau.ravel()), rel=1e-10)


@pytest.mark.parametrize('friction', [False, True])
@pytest.mark.parametrize('member', MEMBERS)
def test_gradient_by_every_group(member: str, friction: bool) -> None:
    """Each group of hyperparameters by itself, so that none hides behind a larger one."""
    likelihood = random_likelihood(member, TYPES, friction, 9)
    _, gradient = likelihood.value_and_gradient(likelihood.like.vector())
    rng = np.random.default_rng(1)
    start = 0
    for name, values in likelihood.like.groups().items():
        direction = np.zeros_like(gradient)
        direction[start : start + values.size] = rng.normal(size=values.size)
        start += values.size
        expected = differences(likelihood, direction)
        assert gradient @ direction == pytest.approx(expected, rel=1e-6, abs=1e-7), name


@pytest.mark.parametrize('types', [('revolute',), ('prismatic',), ('prismatic', 'revolute')])
@pytest.mark.parametrize('member', MEMBERS)
def test_gradient_of_other_arms(member: str, types: tuple[str, ...]) -> None:
    likelihood = random_likelihood(member, types, True, 35)
    _, gradient = likelihood.value_and_gradient(likelihood.like.vector())
    direction = np.random.default_rng(2).normal(size=len(gradient))
    expected = differences(likelihood, direction)
    assert gradient @ direction == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize('member', MEMBERS)
def test_gradient_without_potential_energy(member: str) -> None:
    """The potential's factors have no part in torques that leave gravity out."""
    likelihood = without_gravity(random_likelihood(member, TYPES, True, 9))
    _, gradient = likelihood.value_and_gradient(likelihood.like.vector())
    direction = np.random.default_rng(3).normal(size=len(gradient))
    expected = differences(likelihood, direction)
    assert gradient @ direction == pytest.approx(expected, rel=1e-6)
    names = [name for name, values in likelihood.like.groups().items() for _ in range(values.size)]
    assert not gradient[np.array(names) == 'potential_factors'].any()
