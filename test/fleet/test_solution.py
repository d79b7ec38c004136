"""The sum over recordings and its solution, against the dense problem."""

from __future__ import annotations

from dataclasses import replace

from fleet.fleets import arm_of, friction_of, linearisation_of, recording
import numpy as np
from numpy.testing import assert_allclose
import pytest
from scipy.linalg import block_diag

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import fitted_alone, Known, solve, system_of
from lip_id_ros.identification.total import FOLDS, FrictionDeviations, gather, Total
from lip_id_ros.rigid_body.regressor import torque_regressor

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
AROUND = linearisation_of(ARM, DATA[0])
TOTAL = Total(AROUND, [gather(each, AROUND) for each in DATA], GROUPS)
FITTER = ArmFitter(concatenate(DATA))
FIXED = replace(Geometry.free(N), rigid=True)
KNOWN = Known(FITTER.torque_std, FITTER.prior, FIXED)
K, SIZE = AROUND.n_friction, AROUND.size


def dense_rows(data: Dataset, around: Linearisation) -> tuple[Array, Array]:
    """All features and the torque of all joints of a recording in units of the noise."""
    features, target = around.rows(data)
    every = []
    for joint, (rows, own) in enumerate(zip(features, around.columns, strict=True)):
        block = np.zeros((data.n_samples, SIZE))
        block[:, np.concatenate(own)] = rows / NOISE[joint]
        every.append(block)
    return np.vstack(every), (target / NOISE).T.ravel()


def test_the_system_is_that_of_generalised_least_squares() -> None:
    within, between = np.full(K, 0.05), np.full(K, 0.2)
    system = TOTAL.merged(NOISE, FrictionDeviations(within, between)).system(NOISE)
    rows = [dense_rows(data, AROUND) for data in DATA]
    design = np.vstack([each[0] for each in rows])
    rows_torque = np.concatenate([each[1] for each in rows])
    own = block_diag(*(each[0][:, :K] for each in rows))
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


def parameters(links: Array, friction: Array) -> Array:
    out = np.zeros(SIZE)
    out[:K], out[SIZE - links.size :] = friction, links.ravel()
    return out


def test_residuals_are_those_of_all_samples() -> None:
    friction = np.array(FRICTION).reshape(len(DATA), -1)
    found = TOTAL.residual_squares(parameters(ARM.parameters, np.zeros(K)), friction)
    for data, squares in zip(DATA, found, strict=True):
        assert data.tau_noiseless is not None
        expected = np.sum((data.tau - data.tau_noiseless) ** 2, axis=0)
        assert_allclose(squares, expected, rtol=1e-6)


@pytest.mark.parametrize('free', [False, True])
def test_links_friction_and_noise_are_found(free: bool) -> None:
    known = replace(KNOWN, geometry=Geometry.free(N)) if free else KNOWN
    found = solve(TOTAL, known, known.geometry)
    truth = np.array(FRICTION).reshape(len(DATA), -1)
    deviation = np.abs(found.recordings.friction - truth)
    assert np.mean(deviation < 2.0 * found.recordings.friction_std) > 0.85
    assert_allclose(found.noise_std, NOISE, rtol=0.03)
    assert found.inflation < 1.5  # the noise is white
    assert_allclose(found.recordings.residual_rms, NOISE[None] * np.ones((8, 1)), rtol=0.1)
    test = recording(ARM, np.zeros((N, 3)), seed=99)
    assert test.tau_noiseless is not None
    regressor = torque_regressor(found.chain, test.q, test.dq, test.ddq)
    error = regressor @ found.links.ravel() - test.tau_noiseless
    error -= error.mean(axis=0)  # an offset is friction
    assert np.sqrt(np.mean(error**2)) < 0.005 * test.tau_noiseless.std()


def test_a_recording_of_another_load_stands_out() -> None:
    found = solve(TOTAL, KNOWN, FIXED)
    loaded = ARM.parameters.copy()
    loaded[-1, 0] += 0.5
    heavy = recording(type(ARM)(ARM.joint_types, ARM.chain, loaded), FRICTION[0], seed=50)
    alone = Total(AROUND, [gather(heavy, AROUND)], ['a'])
    assert fitted_alone(alone, found).residual_rms.max() > 5.0 * NOISE[0]
    same = Total(AROUND, TOTAL.recordings[:1], ['a'])
    assert_allclose(fitted_alone(same, found).residual_rms, NOISE[None], rtol=0.1)


def test_the_solution_is_least_in_what_has_no_bounds() -> None:
    known = replace(KNOWN, geometry=replace(FIXED, rigid=False))
    deviations = FrictionDeviations(np.full(K, 0.05), np.full(K, 0.2))
    problem = system_of(TOTAL, known, NOISE, deviations)
    system = TOTAL.merged(NOISE, deviations).system(NOISE)
    state = problem.solved()
    prior = problem.prior_rows(state)
    rows = np.vstack([system[:, :-1] @ problem.slopes(state), prior[:, :-1]])
    residual = np.append(system @ np.append(problem.parameters(state), -1.0), -prior[:, -1])
    free = np.flatnonzero(~AROUND.friction.basis.is_positive)
    rows = rows[:, free]
    slope = rows.T @ residual
    size = np.linalg.norm(rows, axis=0) * np.linalg.norm(residual)
    assert (np.abs(slope) < 1e-6 * size).all()


def test_joints_of_a_single_recording_have_residuals_of_their_own() -> None:
    data = DATA[0]
    assert data.tau_noiseless is not None
    loud = data.tau_noiseless + (data.tau - data.tau_noiseless) * (1.0, 10.0)
    alone = gather(replace(data, tau=loud), AROUND, FOLDS)
    found = solve(Total(AROUND, [alone]), KNOWN, FIXED)
    assert_allclose(np.sqrt(found.left_out.mean_squares), (NOISE[0], 10.0 * NOISE[1]), rtol=0.15)
