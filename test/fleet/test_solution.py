"""The sum over recordings and its solution, against the dense problem."""

from __future__ import annotations

from dataclasses import replace

from fleet.fleets import arm_of, friction_of, recording, regression_of
import numpy as np
from numpy.testing import assert_allclose
import pytest
from scipy.linalg import block_diag

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.fleet.fleet_statistics import FleetStatistics, FrictionDeviations, tree_sum
from lip_id_ros.fleet.link_problem import LinkProblem
from lip_id_ros.fleet.recording_statistics import Regression, statistics_of
from lip_id_ros.fleet.solution import fitted_alone, Sizes, solve
from lip_id_ros.identification.arm_fit import ArmFitter

ARM = arm_of()
N = len(ARM.joint_types)
NOISE = np.full(N, 0.02)
GROUPS = ['a', 'a', 'b', 'b', 'c', 'c', 'd', 'd']


def fleet(spread: float = 0.3) -> tuple[list[Dataset], list[Array]]:
    rng = np.random.default_rng(7)
    robots = {name: friction_of(ARM, rng, spread) for name in sorted(set(GROUPS))}
    friction = [robots[g] * (1.0 + 0.05 * rng.standard_normal((N, 3))) for g in GROUPS]
    return [recording(ARM, each, seed=k) for k, each in enumerate(friction)], friction


DATA, FRICTION = fleet()
REGRESSION = regression_of(ARM, DATA[0])
STATISTICS = FleetStatistics(
    REGRESSION, [statistics_of(each, REGRESSION) for each in DATA], GROUPS
)
SIZES = Sizes(
    ArmFitter(concatenate(DATA)).torque_std, ArmFitter(concatenate(DATA)).prior, inflation=1.0
)
K, P = REGRESSION.n_friction, REGRESSION.links.size


def dense_rows(data: Dataset, regression: Regression) -> tuple[Array, Array, Array]:
    """Friction, links and torque of all joints of a recording in units of the noise."""
    features = regression.rows(data)
    friction, links, torque = [], [], []
    for joint, (own, column) in enumerate(regression.columns()):
        block = np.zeros((data.n_samples, K + P))
        block[:, np.concatenate([own, K + column])] = features[joint] / NOISE[joint]
        friction.append(block[:, :K])
        links.append(block[:, K:])
        torque.append(data.tau[:, joint] / NOISE[joint])
    return np.vstack(friction), np.vstack(links), np.concatenate(torque)


def test_the_system_is_that_of_generalised_least_squares() -> None:
    within, between = np.full(K, 0.05), np.full(K, 0.2)
    system = STATISTICS.system(NOISE, FrictionDeviations(within, between))
    rows = [dense_rows(data, REGRESSION) for data in DATA]
    design = np.hstack(
        [np.vstack([each[0] for each in rows]), np.vstack([each[1] for each in rows])]
    )
    rows_torque = np.concatenate([each[2] for each in rows])
    own = block_diag(*(each[0] for each in rows))
    same = np.equal.outer(GROUPS, GROUPS).astype(float)
    effects = np.kron(np.eye(len(DATA)), np.diag(within**2)) + np.kron(same, np.diag(between**2))
    # Woodbury: the covariance of all rows has no inverse that fits in memory
    inner = np.linalg.inv(np.linalg.inv(effects) + own.T @ own)
    every = np.column_stack([design, rows_torque])
    half = own.T @ every
    expected = every.T @ every - half.T @ inner @ half
    found = system.T @ system
    scale = np.sqrt(np.diagonal(expected))
    scale[scale == 0.0] = 1.0
    assert_allclose(found / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-8)


def test_residuals_are_those_of_all_samples() -> None:
    friction = np.array(FRICTION).reshape(len(DATA), -1)
    found = STATISTICS.residual_squares(ARM.parameters, friction)
    for data, squares in zip(DATA, found, strict=True):
        assert data.tau_noiseless is not None
        expected = np.sum((data.tau - data.tau_noiseless) ** 2, axis=0)
        assert_allclose(squares, expected, rtol=1e-6)


def test_order_and_tree_do_not_matter() -> None:
    order = np.random.default_rng(0).permutation(len(DATA))
    one = FleetStatistics(REGRESSION, STATISTICS.recordings, GROUPS).links
    other = FleetStatistics(
        REGRESSION, [STATISTICS.recordings[k] for k in order], [GROUPS[k] for k in order]
    ).links
    linear = tree_sum([one, one.empty(one.columns)])
    for a, b, c in zip(one.factors, other.factors, linear.factors, strict=True):
        scale = np.abs(a).max()
        assert_allclose(a.T @ a, b.T @ b, atol=1e-12 * scale**2)
        assert_allclose(a.T @ a, c.T @ c, atol=1e-12 * scale**2)


def test_links_friction_and_noise_are_found() -> None:
    found = solve(STATISTICS, SIZES)
    truth = np.array(FRICTION).reshape(len(DATA), -1)
    deviation = np.abs(found.recordings.friction - truth)
    assert np.mean(deviation < 2.0 * found.recordings.friction_std) > 0.85
    assert_allclose(found.noise_std, NOISE, rtol=0.03)
    assert found.inflation < 1.5  # the noise is white
    assert_allclose(found.recordings.residual_rms, NOISE[None] * np.ones((8, 1)), rtol=0.1)
    test = recording(ARM, np.zeros((N, 3)), seed=99)
    assert test.tau_noiseless is not None
    regressor = np.stack(
        [row @ found.links.ravel()[column] for row, column in link_rows(test)], axis=1
    )
    error = regressor - test.tau_noiseless
    error -= error.mean(axis=0)  # an offset is friction
    assert np.sqrt(np.mean(error**2)) < 0.005 * test.tau_noiseless.std()


def link_rows(data: Dataset) -> list[tuple[Array, IndexArray]]:
    features = REGRESSION.rows(data)
    return [
        (rows[:, own.size :], column)
        for rows, (own, column) in zip(features, REGRESSION.columns(), strict=True)
    ]


def test_a_recording_of_another_load_stands_out() -> None:
    found = solve(STATISTICS, SIZES)
    loaded = ARM.parameters.copy()
    loaded[-1, 0] += 0.5
    heavy = recording(type(ARM)(ARM.joint_types, ARM.chain, loaded), FRICTION[0], seed=50)
    alone = FleetStatistics(REGRESSION, [statistics_of(heavy, REGRESSION)], ['a'])
    assert fitted_alone(alone, found).residual_rms.max() > 5.0 * NOISE[0]
    same = FleetStatistics(REGRESSION, STATISTICS.recordings[:1], ['a'])
    assert_allclose(fitted_alone(same, found).residual_rms, NOISE[None], rtol=0.1)


def test_the_gradient_by_differences() -> None:
    system = STATISTICS.system(NOISE, FrictionDeviations(np.full(K, 0.05), np.full(K, 0.2)))
    positive = REGRESSION.friction.basis.is_positive
    problem = LinkProblem(system / 100.0, SIZES.prior, positive, np.ones(K))
    state = problem.start(ARM.parameters, REGRESSION.friction.coefficients)
    _, gradient = problem.normal_equations(state)
    for k in np.random.default_rng(0).choice(K + P, 12, replace=False):
        step = 1e-5 * np.eye(K + P)[k]
        slope = (problem.stepped(state, step).cost - problem.stepped(state, -step).cost) / 2e-5
        assert slope == pytest.approx(gradient[k], rel=1e-4, abs=1e-4 * np.abs(gradient).max())


def test_joints_of_a_single_recording_have_residuals_of_their_own() -> None:
    data = DATA[0]
    assert data.tau_noiseless is not None
    loud = data.tau_noiseless + (data.tau - data.tau_noiseless) * (1.0, 10.0)
    alone = statistics_of(replace(data, tau=loud), REGRESSION)
    found = solve(FleetStatistics(REGRESSION, [alone], ['a']), SIZES)
    assert_allclose(np.sqrt(found.left_out), (NOISE[0], 10.0 * NOISE[1]), rtol=0.15)
