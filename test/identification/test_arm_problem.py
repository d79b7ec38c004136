"""Placements, links and friction fitted together."""

from __future__ import annotations

from dataclasses import replace

from gp.chains import P, R
from identification.arms import assert_gradient, samples_of
import numpy as np
import pytest
from rigid_body.arms import angles_between, distances_between

from lip_id_ros.arrays import Array
from lip_id_ros.errors import FitError
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.arm_problem import ArmProblem, ArmState
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, scale_of

SCALE = scale_of(2.0, 0.2)
ARMS = [(R,), (P, R), (R, P, R), (R, R, R, R)]
POSITIVE = np.array([True, False])


def prior_of(joint_types: tuple[str, ...]) -> ArmPrior:
    return ArmPrior.vague(len(joint_types), SCALE)


def problem_of(
    joint_types: tuple[str, ...], count: int = 12
) -> tuple[ArmProblem, ArmState, Array]:
    arm, samples = samples_of(joint_types, count=count, noise=0.1)
    rng = np.random.default_rng(3)
    friction = rng.standard_normal((*samples.tau.shape, 2))
    weights = rng.uniform(0.2, 1.0, samples.tau.shape)
    std = np.array([0.5, 2.0])
    samples = replace(samples, friction=friction, friction_std=std, weights=weights)
    noise_std = 0.05 * samples.tau.std(axis=0)
    problem = ArmProblem(samples, noise_std, POSITIVE, prior_of(joint_types))
    links = arm.parameters
    return problem, problem.start(arm.chain, links, np.array([0.7, -0.4])), links


@pytest.mark.parametrize('joint_types', ARMS)
def test_the_jacobian_by_differences(joint_types: tuple[str, ...]) -> None:
    problem, state, _ = problem_of(joint_types)
    found = problem.jacobian(state)
    step, by_steps = 1e-6, np.ones(found.shape[2])
    by_steps[-2:] = problem.coefficient_slopes(state)
    for k, way in enumerate(step * np.eye(found.shape[2])):
        up, down = (problem.torque(problem.stepped(state, w)) for w in (way, -way))
        expected = (up - down) / (2.0 * step * by_steps[k])
        scale = max(np.abs(expected).max(), 1.0)
        np.testing.assert_allclose(found[:, :, k], expected, rtol=1e-5, atol=1e-5 * scale)


@pytest.mark.parametrize('joint_types', ARMS)
def test_the_gradient_by_differences(joint_types: tuple[str, ...]) -> None:
    problem, state, _ = problem_of(joint_types)
    assert_gradient(problem, state, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize('joint_types', ARMS)
def test_most_likely_links_explain_exact_torques(joint_types: tuple[str, ...]) -> None:
    """So a descent starts at its end where the joints are in the right places."""
    arm, samples = samples_of(joint_types, noise=1e-4)
    rng = np.random.default_rng(3)
    friction = rng.standard_normal((*samples.tau.shape, 2))
    tau = samples.tau + friction @ np.array([0.7, -0.4])
    samples = replace(samples, tau=tau, friction=friction, friction_std=np.array([0.5, 2.0]))
    noise_std = 1e-4 * samples.tau.std(axis=0)
    problem = ArmProblem(samples, noise_std, POSITIVE, prior_of(joint_types))
    found = problem.most_likely(arm.chain)
    error = np.sqrt(np.mean((problem.torque(found) - tau) ** 2, axis=0))
    assert (error < 2.0 * noise_std).all()
    np.testing.assert_allclose(problem.coefficients(found), [0.7, -0.4], rtol=1e-2)


def test_most_likely_links_are_the_usual_ones_where_nothing_is_known() -> None:
    """Whatever the weight of the barrier is: torques count for nothing beside this noise."""
    arm, samples = samples_of((R, P))
    friction = np.ones((*samples.tau.shape, 2))
    samples = replace(samples, friction=friction, friction_std=np.array([0.5, 2.0]))
    problem = ArmProblem(samples, np.full(2, 1e9), POSITIVE, prior_of((R, P)))
    found = problem.most_likely(arm.chain)
    np.testing.assert_allclose(found.numbers, 0.0, atol=0.02)
    np.testing.assert_allclose(problem.coefficients(found), [0.5, 0.0], rtol=0.2, atol=1e-6)


def test_most_likely_links_need_finite_torques() -> None:
    arm, samples = samples_of((R, R))
    samples = replace(samples, tau=np.full_like(samples.tau, np.nan))
    problem = ArmProblem(samples, np.ones(2), np.zeros(0, dtype=bool), prior_of((R, R)))
    with pytest.raises(FitError, match='finite'):
        problem.most_likely(arm.chain)


def test_the_prior_of_links_is_quadratic_near_its_centre() -> None:
    prior = prior_of((R, P))
    rng = np.random.default_rng(0)
    numbers = 1e-4 * rng.standard_normal((2, 11))
    centre, precision = prior.of_links()
    change = link_parameters(numbers, prior.scale) - centre
    found = np.einsum('na,nab,nb->', change, precision, change)
    still = prior.precision[-22:] * numbers.ravel()
    assert found == pytest.approx(still @ still, rel=1e-2)


def test_a_geometry_is_kept_by_every_step() -> None:
    arm, samples = samples_of((R, R))
    geometry = Geometry(np.array([np.nan, 0.5 * np.pi]), np.array([False, True]))
    problem = ArmProblem(
        samples, samples.tau.std(axis=0), np.zeros(0, dtype=bool), prior_of((R, R)), geometry
    )
    chain = geometry.projected(arm.chain)
    start = problem.start(chain, 1.3 * arm.parameters, np.zeros(0))
    end = problem.minimised(start, 20)
    assert end.cost < start.cost
    assert angles_between(end.chain)[0] == pytest.approx(0.5 * np.pi, abs=1e-9)
    assert distances_between(end.chain)[0] == pytest.approx(0.0, abs=1e-9)
    assert not np.allclose(end.chain.translations[1], chain.translations[1], atol=1e-9)
