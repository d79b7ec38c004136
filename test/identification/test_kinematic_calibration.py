"""Least squares over placements, and the search for the lowest place."""

from __future__ import annotations

from dataclasses import replace

from gp.chains import P, R
from identification.arms import assert_gradient, samples_of
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import FitError
from lip_id_ros.identification.kinematic_calibration import PlacementProblem, Samples
from lip_id_ros.identification.placement_search import (
    calibrate,
    Calibration,
    FINEST,
    in_near_frames,
    quarter_turn_placements,
)
from lip_id_ros.progress import silent

ARMS = [(R,), (P, R), (R, P, R), (R, R, R, R)]


def problem_of(
    joint_types: tuple[str, ...], gravity: float = 9.81
) -> tuple[Samples, PlacementProblem]:
    _, samples = samples_of(joint_types, count=15, noise=0.1, gravity=gravity)
    rng = np.random.default_rng(7)
    friction = rng.standard_normal((*samples.tau.shape, 2))
    weights = rng.uniform(0.2, 1.0, samples.tau.shape)
    std = np.array([0.5, 2.0])
    samples = replace(samples, friction=friction, friction_std=std, weights=weights)
    return samples, PlacementProblem(samples, 0.05 * samples.tau.std(axis=0))


def start(n_joints: int, seed: int) -> tuple[Array, Array]:
    return quarter_turn_placements(n_joints, np.random.default_rng(seed))


@pytest.mark.parametrize('gravity', [9.81, 0.0])
@pytest.mark.parametrize('joint_types', ARMS)
def test_the_gradient_is_exact(joint_types: tuple[str, ...], gravity: float) -> None:
    """What Kaufman's approximation leaves out of the Jacobian is normal to the residuals."""
    _, problem = problem_of(joint_types, gravity)
    at = problem.at(*start(len(joint_types), seed=1))
    assert_gradient(problem, at, rtol=1e-5, atol=2e-6)


@pytest.mark.parametrize('joint_types', ARMS)
def test_linear_parameters_solve_the_ridge_problem(joint_types: tuple[str, ...]) -> None:
    _, problem = problem_of(joint_types)
    at = problem.at(*start(len(joint_types), seed=2))
    count = at.features.shape[1]
    target = at.residual + at.features @ at.parameters
    stacked = np.vstack([at.features, np.eye(count)])
    expected, *_ = np.linalg.lstsq(stacked, np.concatenate([target, np.zeros(count)]), rcond=None)
    np.testing.assert_allclose(at.parameters, expected, atol=1e-6 * np.abs(expected).max())


def test_weights_of_zero_leave_samples_out() -> None:
    samples, _ = problem_of((R, R))
    keep = np.arange(10)
    weights = np.ones_like(samples.weights)
    weights[10:] = 0.0
    spoiled = replace(samples, tau=np.where(weights > 0.0, samples.tau, 1e3), weights=weights)
    some = replace(samples, weights=np.ones_like(weights)).select(keep)
    noise = np.ones(2)
    placements = start(2, seed=3)
    found = PlacementProblem(spoiled, noise).at(*placements)
    expected = PlacementProblem(some, noise).at(*placements)
    np.testing.assert_allclose(found.parameters, expected.parameters, rtol=1e-9, atol=1e-12)
    assert found.cost == pytest.approx(expected.cost)


@pytest.mark.filterwarnings('ignore::RuntimeWarning')
def test_numbers_too_large_are_refused() -> None:
    samples, _ = problem_of((R, R))
    huge = replace(samples, tau=1e200 * samples.tau)
    with pytest.raises(FitError, match=r'finite in units of the noise but are not: check'):
        PlacementProblem(huge, np.full(2, 1e-200)).at(*start(2, seed=1))


def test_a_heavy_slide_beside_small_noise_is_solved() -> None:
    """Its weight in units of the noise squares to numbers beside which the prior is lost."""
    arm, samples = samples_of((P, R, R))
    heavy = replace(samples, link_std=1e6 * samples.link_std)
    problem = PlacementProblem(heavy, 1e-4 * samples.tau.std(axis=0))
    at = problem.at(arm.chain.rotations, arm.chain.translations)
    end = problem.descend(at.chain.rotations, at.chain.translations, evaluations=10)
    assert end.cost <= at.cost < np.inf


def test_starts_have_axes_at_quarter_turns() -> None:
    rotations, translations = start(500, seed=0)
    twists = np.degrees(np.arccos(np.clip(rotations[1:, 2, 2], -1.0, 1.0)))
    away = np.abs(twists - 90.0 * np.round(twists / 90.0))
    assert away.max() < 10.0
    assert 0.15 < np.mean(twists < 45.0) < 0.25
    assert not translations[0].any()


def found(samples: Samples, seed: int = 0) -> Calibration:
    return calibrate(samples, 60, seed, silent)


@pytest.mark.slow
@pytest.mark.parametrize(
    ('joint_types', 'seed'), [((R, R, R), 0), ((R, P, R), 1), ((P, R, R), 0), ((R, R, P), 1)]
)
def test_the_residuals_at_the_lowest_place_are_the_noise(
    joint_types: tuple[str, ...], seed: int
) -> None:
    arm, samples = samples_of(joint_types, noise=1e-3, seed=20 + seed)
    calibration = found(samples, seed)
    noise = 1e-3 * arm.torque(*samples.state).std(axis=0)
    np.testing.assert_allclose(calibration.noise_std, noise, rtol=0.3)
    assert calibration.agreed


def test_residuals_vanish_without_noise() -> None:
    _, samples = samples_of((R, P, R), noise=0.0)
    np.testing.assert_allclose(found(samples).noise_std, FINEST * samples.tau.std(axis=0))


@pytest.mark.slow
@pytest.mark.parametrize('joint_types', [(R, R, R), (P, R, R)])
def test_placements_are_those_of_any_start(joint_types: tuple[str, ...]) -> None:
    """Frames are free to turn about their axes, and arms to be mirrored: one of all is chosen."""
    _, samples = samples_of(joint_types, noise=1e-4)
    calibrations = [in_near_frames(samples, found(samples, seed)) for seed in range(3)]
    first, *others = (each.placements.chain for each in calibrations)
    for other in others:
        np.testing.assert_allclose(other.rotations, first.rotations, atol=0.01)
        np.testing.assert_allclose(other.translations, first.translations, atol=0.01)


@pytest.mark.slow
def test_a_seed_decides_everything() -> None:
    _, samples = samples_of((R, P))
    first, second, other = (found(samples, seed).placements.chain for seed in (0, 0, 1))
    np.testing.assert_array_equal(first.rotations, second.rotations)
    np.testing.assert_array_equal(first.translations, second.translations)
    assert not np.array_equal(first.rotations, other.rotations)
