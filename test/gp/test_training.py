"""The optimisation of the hyperparameters: where it goes, where it stops, what it reports."""

from __future__ import annotations

from gp.cases import random_likelihood, TYPES, without_gravity
from kernels.cases import MEMBERS
import numpy as np
import pytest
from scipy.stats import multivariate_normal

from lip_id_ros.arrays import Array
from lip_id_ros.errors import FitError
from lip_id_ros.gp.training import (
    ALIKE,
    MarginalLikelihood,
    maximise,
    Objective,
    Optimum,
    RANGE,
)
from lip_id_ros.kernels.gram import cross_gram
from lip_id_ros.kernels.torque_process import friction_covariance


def small(member: str = 'recursive') -> MarginalLikelihood:
    return random_likelihood(member, TYPES, True, 12)


def improve(likelihood: MarginalLikelihood, iterations: int, prior_precision: float) -> Optimum:
    """Optimise from the likelihood's own point, which is also the centre of the prior."""
    objective = Objective(likelihood, likelihood.like, prior_precision)
    return maximise(objective, likelihood.like, iterations)


def value(likelihood: MarginalLikelihood, vector: Array) -> float:
    return likelihood.value_and_gradient(vector)[0]


@pytest.mark.parametrize('member', MEMBERS)
def test_the_likelihood_rises(member: str) -> None:
    likelihood = small(member)
    found = improve(likelihood, 8, 0.0)
    assert found.negative_log_likelihood < value(likelihood, likelihood.like.vector()) - 1.0
    end = found.hyperparameters.vector()
    assert found.negative_log_likelihood == pytest.approx(value(likelihood, end), rel=1e-12)
    assert 0 < found.iterations <= 8


def test_a_stationary_point_is_reached() -> None:
    likelihood = small()
    precision = 0.5
    found = improve(likelihood, 500, precision)
    assert found.converged
    assert found.at_bounds == ()
    start, end = likelihood.like.vector(), found.hyperparameters.vector()
    slope = likelihood.value_and_gradient(end)[1]
    noise = likelihood.like.noise_variance.size
    slope[:-noise] += precision * (end - start)[:-noise]
    cosines, sines = likelihood.like.cosines_and_sines()
    pull = ALIKE * ((end - start)[cosines] - (end - start)[sines])
    slope[cosines] += pull
    slope[sines] -= pull
    assert abs(slope).max() < 1e-2


@pytest.mark.parametrize('member', MEMBERS)
def test_the_gradient_is_that_of_the_objective(member: str) -> None:
    likelihood = small(member)
    objective = Objective(likelihood, likelihood.like, 0.5)
    rng = np.random.default_rng(0)
    at = likelihood.like.vector() + 0.3 * rng.standard_normal(likelihood.like.vector().size)
    way = rng.standard_normal(at.size)
    step = 1e-5
    ahead, behind = (objective.value_and_gradient(at + s * way)[0] for s in (step, -step))
    slope = objective.value_and_gradient(at)[1] @ way
    assert (ahead - behind) / (2 * step) == pytest.approx(slope, rel=1e-5)


def test_cosine_and_sine_are_alike_in_the_prior() -> None:
    likelihood = small()
    objective = Objective(likelihood, likelihood.like, 0.05)
    cosines, sines = likelihood.like.cosines_and_sines()
    at = likelihood.like.vector()
    at[cosines] += 1.0
    together = at.copy()
    together[sines] += 1.0
    assert objective.penalty(at) > 5.0 * objective.penalty(together)
    assert Objective(likelihood, likelihood.like, 0.0).penalty(at) == 0.0


def test_what_runs_to_a_bound_is_named() -> None:
    """Noise explains random torques best: some weight goes as low as it may."""
    likelihood = small()
    found = improve(likelihood, 300, 0.0)
    assert found.at_bounds
    moved = abs(found.hyperparameters.vector() - likelihood.like.vector())
    assert moved.max() == pytest.approx(RANGE)
    assert len(found.at_bounds) == np.isclose(moved, RANGE, atol=1e-4).sum()


def test_the_start_need_not_be_the_centre_of_the_prior() -> None:
    """The objective depends on where a start is, not on how far it came."""
    likelihood = small()
    centre = likelihood.like.vector()
    objective = Objective(likelihood, likelihood.like, 0.5)
    away = likelihood.like.with_vector(centre + 0.3)
    noise = likelihood.like.noise_variance.size
    found = maximise(objective, away, 0)
    penalty = 0.5 * 0.5 * 0.3**2 * (len(centre) - noise)
    assert found.value == pytest.approx(value(likelihood, centre + 0.3) + penalty)
    assert found.negative_log_likelihood == pytest.approx(value(likelihood, centre + 0.3))


class Walled(MarginalLikelihood):
    """A likelihood that cannot be factorised further than `RADIUS` from where it is looked for."""

    RADIUS = 1.5

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        if np.linalg.norm(vector - self.like.vector()) > self.RADIUS:
            raise FitError('beyond the wall')
        return super().value_and_gradient(vector)


def test_a_step_too_far_is_shortened() -> None:
    likelihood = Walled(**vars(small()))
    found = improve(likelihood, 30, 0.0)
    assert found.rejected > 0
    start, end = likelihood.like.vector(), found.hyperparameters.vector()
    assert 0.5 < np.linalg.norm(end - start) <= Walled.RADIUS
    assert found.value < value(likelihood, start) - 1.0


def test_a_start_that_cannot_be_factorised_is_an_error() -> None:
    likelihood = Walled(**vars(small()))
    away = likelihood.like.with_vector(likelihood.like.vector() + 1.0)
    with pytest.raises(FitError, match='beyond the wall'):
        maximise(Objective(likelihood, likelihood.like, 0.0), away, 10)


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
