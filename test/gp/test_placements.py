"""Least squares over placements: its gradient, its linear half, its rotations."""

from __future__ import annotations

from gp.arms import dataset_of, noise_of
from gp.chains import P, R, random_arm
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.errors import FitError
from lip_id_ros.gp.placement_search import prior_deviations, random_placements
from lip_id_ros.gp.placements import descend, PlacementProblem, REACH, right_jacobian

ARMS = [(R,), (P, R), (R, P, R), (R, R, R, R)]
FRICTIONS = 2


def random_problem(
    joint_types: tuple[str, ...], gravity: float = 9.81, size: float = 1.0
) -> PlacementProblem:
    rng = np.random.default_rng(7)
    arm = random_arm(joint_types, seed=3, gravity=gravity)
    motion = arm.motion(15, seed=4)
    tau = arm.torque(*motion)
    dataset = dataset_of(arm, motion, size * (tau + noise_of(tau, 0.1)), gravity == 0.0)
    friction = rng.standard_normal((*tau.shape, FRICTIONS))
    deviations = prior_deviations(dataset, 9.81)
    down = np.array([0.0, 0.0, -gravity])
    return PlacementProblem(dataset, friction, deviations, 0.05 * tau.std(axis=0), down)


def places(problem: PlacementProblem, seed: int, turned: float = 1.0) -> Array:
    rng = np.random.default_rng(seed)
    vector = random_placements(problem.n_joints, rng).reshape(-1, 6)
    vector[:, :3] *= turned
    vector[0, 3:] = rng.standard_normal(3)
    return vector.ravel()


def cost(problem: PlacementProblem, vector: Array) -> float:
    return 0.5 * float(np.sum(problem.residuals(vector) ** 2))


@pytest.mark.parametrize('turned', [0.0, 1e-5, 1.0, 5.0])
@pytest.mark.parametrize('gravity', [9.81, 0.0])
@pytest.mark.parametrize('joint_types', ARMS)
def test_the_gradient_is_exact(
    joint_types: tuple[str, ...], gravity: float, turned: float
) -> None:
    """What Kaufman's approximation leaves out of the Jacobian is normal to the residuals."""
    problem = random_problem(joint_types, gravity)
    vector = places(problem, seed=1, turned=turned)
    found = problem.jacobian(vector).T @ problem.residuals(vector)
    step = 1e-6
    expected = [
        (cost(problem, vector + way) - cost(problem, vector - way)) / (2.0 * step)
        for way in step * np.eye(len(vector))
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize('joint_types', ARMS)
def test_linear_parameters_solve_the_ridge_problem(joint_types: tuple[str, ...]) -> None:
    problem = random_problem(joint_types)
    vector = places(problem, seed=2)
    at = problem.fit(vector)
    count = at.features.shape[1]
    target = at.left_over.ravel() + at.features @ at.parameters
    stacked = np.vstack([at.features, np.eye(count)])
    expected, *_ = np.linalg.lstsq(stacked, np.concatenate([target, np.zeros(count)]), rcond=None)
    np.testing.assert_allclose(at.parameters, expected, atol=1e-6 * np.abs(expected).max())
    ends = np.concatenate([-at.parameters, vector.reshape(-1, 6)[:, 3:].ravel() / REACH])
    np.testing.assert_array_equal(problem.residuals(vector)[target.size :], ends)


@pytest.mark.parametrize('angle', [0.0, 1e-7, 0.9e-4, 1.1e-4, 1e-2, 1.0, 3.1, 6.0, 20.0])
def test_small_rotations_about_the_turned_axes(angle: float) -> None:
    vector = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    before = Rotation.from_rotvec(vector).inv()
    step = 1e-6
    columns = [
        ((before * Rotation.from_rotvec(vector + way)).as_rotvec())
        - ((before * Rotation.from_rotvec(vector - way)).as_rotvec())
        for way in step * np.eye(3)
    ]
    expected = np.stack(columns, axis=1) / (2.0 * step)
    np.testing.assert_allclose(right_jacobian(vector), expected, atol=1e-8)


def test_descents_go_down() -> None:
    problem = random_problem((R, P, R))
    start = places(problem, seed=5)
    half, end = descend(problem, start, evaluations=40)
    assert half == pytest.approx(cost(problem, end))
    assert half < 0.1 * cost(problem, start)
    further, _ = descend(problem, end, evaluations=40)
    assert further <= half


def test_links_have_their_joints_where_the_vector_says() -> None:
    problem = random_problem((R, P))
    vector = places(problem, seed=6)
    chain = problem.links(vector).chain
    placements = vector.reshape(-1, 6)
    np.testing.assert_array_equal(chain.translations, placements[:, 3:])
    np.testing.assert_allclose(
        chain.rotations, Rotation.from_rotvec(placements[:, :3]).as_matrix()
    )
    np.testing.assert_array_equal(chain.prismatic, [False, True])


@pytest.mark.filterwarnings('ignore::RuntimeWarning')
def test_numbers_too_large_are_refused() -> None:
    problem = random_problem((R, R), size=1e200)
    with pytest.raises(FitError, match=r'expected to be finite but is not: check the data'):
        problem.fit(places(problem, seed=1))
