"""The fast posterior mean against covariances times alpha, and the physics that it must obey."""

from __future__ import annotations

import copy
from dataclasses import replace
import pickle
from typing import Any

from gp.processes import process_of
from kernels.cases import ARMS, MEMBERS, random_states
from model.models import (
    KERNELS,
    random_model,
    random_model_without_gravity,
    random_model_without_potential,
    torque_of_processes,
)
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ShapeError
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import load_torque
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.model.process_mean import evaluate_many, evaluate_one
from lip_id_ros.numba_jit import LANES
from lip_id_ros.rigid_body.regressor import kinetic_regressor, potential_regressor

States = tuple[Array, Array, Array]
CASES = [(member, types) for member in KERNELS for types in ARMS]


def queries(n: int, n_samples: int = 5) -> States:
    return random_states(n_samples, n, np.random.default_rng(9))


def assert_close(got: Array, expected: Array) -> None:
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-11 * abs(expected).max())


def check_against_covariances(model: InverseDynamicsModel) -> None:
    x = queries(model.n_joints)
    if model.arm is not None:
        check_against_regressors(model, x)
        return
    prior, alpha = process_of(model).prior, process_of(model).alpha.ravel()
    states = prior.kernel.states(*x)
    tau = (prior.cross_gram(states, process_of(model).states) @ alpha).reshape(x[0].shape)
    kinetic, potential = (
        c @ alpha for c in prior.energy_covariance(states, process_of(model).states)
    )
    rest = prior.kernel.states(model.potential_reference[None], *np.zeros((2, 1, model.n_joints)))
    _, reference = prior.energy_covariance(rest, process_of(model).states)
    predictor = model
    got = predictor.predict(*x)
    assert got.potential is not None
    assert_close(got.tau, tau)
    assert_close(got.kinetic, kinetic)
    assert_close(got.potential, potential - reference @ alpha)
    for t in range(len(tau)):
        one = predictor.query(x[0][t], x[1][t], x[2][t])
        assert_close(one.tau, tau[t])
        assert one.kinetic == pytest.approx(got.kinetic[t], rel=1e-12)
        assert one.potential == pytest.approx(got.potential[t], rel=1e-12)


def check_against_regressors(model: InverseDynamicsModel, x: States) -> None:
    """Compare with regressors times parameters, friction and residual GP as they are defined."""
    arm, got = model.arm, model.predict(*x)
    assert arm is not None
    assert got.potential is not None
    tau = arm.torque(*x)
    if model.residual_gp is not None:
        tau = tau * ~model.residual_gp.replaces + torque_of_processes(model.residual_gp, *x)
    assert_close(got.tau, tau)
    assert_close(got.inertial + got.coriolis + got.gravity + got.friction, tau)
    assert_close(got.kinetic, kinetic_regressor(arm.chain, *x[:2]) @ arm.links.ravel())
    at = np.vstack([x[0], model.potential_reference])
    potential = potential_regressor(arm.chain, at) @ arm.links.ravel()
    assert_close(got.potential, potential[:-1] - potential[-1])
    for t, expected in enumerate(tau):
        one = model.query(x[0][t], x[1][t], x[2][t])
        assert_close(one.tau, expected)
        assert_close(one.gravity, got.gravity[t])
        assert one.kinetic == pytest.approx(got.kinetic[t], rel=1e-12)
        assert one.potential == pytest.approx(got.potential[t], rel=1e-9)


@pytest.mark.parametrize(('member', 'types'), CASES)
def test_every_member_and_arm(member: str, types: tuple[str, ...]) -> None:
    check_against_covariances(random_model(member, types))


@pytest.mark.parametrize('n_samples', [1, LANES - 1, LANES, LANES + 1, 2 * LANES, 2 * LANES + 1])
@pytest.mark.parametrize('member', KERNELS)
def test_numbers_of_samples_around_the_width_of_the_loops(member: str, n_samples: int) -> None:
    check_against_covariances(random_model(member, n_samples=n_samples))


@pytest.mark.parametrize('member', KERNELS)
def test_parts_of_the_torque(member: str) -> None:
    q, dq, ddq = queries(3)
    predictor = random_model(member)
    got = predictor.predict(q, dq, ddq)
    assert_close(got.inertial + got.coriolis + got.gravity + got.friction, got.tau)
    faster = predictor.predict(q, 2.0 * dq, -3.0 * ddq)
    assert_close(faster.inertial, -3.0 * got.inertial)
    assert_close(faster.coriolis, 4.0 * got.coriolis)
    assert_close(faster.gravity, got.gravity)
    assert_close(faster.kinetic, 4.0 * got.kinetic)
    assert faster.potential is not None
    assert got.potential is not None
    assert_close(faster.potential, got.potential)
    assert abs(got.coriolis).max() > 1e-3
    assert abs(got.friction).max() > 1e-3


@pytest.mark.parametrize('member', KERNELS)
def test_inertia_matrix(member: str) -> None:
    q, dq, ddq = queries(3)
    predictor = random_model(member)
    matrix = predictor.inertia_matrix(q)
    got = predictor.predict(q, dq, ddq)
    np.testing.assert_array_equal(matrix, matrix.transpose(0, 2, 1))
    assert_close(np.einsum('tij,tj->ti', matrix, ddq), got.inertial)
    assert_close(0.5 * np.einsum('ti,tij,tj->t', dq, matrix, dq), got.kinetic)


def test_gravity_of_coupled_motors_is_that_of_their_efforts() -> None:
    """A still arm without friction needs these efforts, whatever turns what."""
    q, _, _ = queries(3)
    model = random_model(ARTICULATED, residual_gp=False)
    assert model.arm is not None
    friction = model.arm.friction
    shares = [
        (each.term.kind is load_torque) * np.ones(each.size) for each in friction.basis.terms
    ]
    free = FrictionModel(friction.basis, np.concatenate(shares) * friction.coefficients)
    still = replace(model, arm=replace(model.arm, friction=free)).predict(q, 0.0 * q, 0.0 * q)
    assert_close(model.efforts(still.gravity), still.tau)
    assert abs(still.tau - still.gravity).max() > 1e-3


@pytest.mark.parametrize('member', KERNELS)
def test_gravity_is_the_slope_of_the_potential(member: str) -> None:
    q, dq, ddq = queries(3)
    predictor = random_model(member)
    gravity = predictor.predict(q, dq, ddq).gravity
    for joint, step in enumerate(1e-5 * np.eye(3)):
        up = predictor.predict(q + step, dq, ddq).potential
        down = predictor.predict(q - step, dq, ddq).potential
        assert up is not None
        assert down is not None
        slope = (up - down) / 2e-5
        np.testing.assert_allclose(gravity[:, joint], slope, atol=1e-8 * abs(gravity).max())


def swing(t: Array) -> States:
    """Return a smooth motion of three joints with its true derivatives, at times t."""
    w = np.array([1.0, 1.7, 2.3])
    phase = np.array([0.3, 1.1, 2.0])
    angle = t[:, None] * w + phase
    return 0.8 * np.sin(angle), 0.8 * w * np.cos(angle), -0.8 * w**2 * np.sin(angle)


@pytest.mark.parametrize('member', KERNELS)
def test_power_balance(member: str) -> None:
    """d(T + V)/dt = dq . tau for any weights, since torques and energies are of one Lagrangian."""
    predictor = random_model(member)
    t, step = np.linspace(0.0, 3.0, 40), 1e-3

    def energy(steps: int) -> Array:
        got = predictor.predict(*swing(t + steps * step))
        assert got.potential is not None
        return got.kinetic + got.potential

    change = (8.0 * (energy(1) - energy(-1)) - (energy(2) - energy(-2))) / (12.0 * step)
    x = swing(t)
    got = predictor.predict(*x)
    power = (x[1] * (got.inertial + got.coriolis + got.gravity)).sum(axis=1)
    np.testing.assert_allclose(power, change, rtol=0.0, atol=1e-8 * abs(power).max())


@pytest.mark.parametrize('member', MEMBERS)
def test_without_potential(member: str) -> None:
    predictor = random_model_without_potential(member)
    q, dq, ddq = queries(3)
    got = predictor.predict(q, dq, ddq)
    assert got.potential is None
    assert not got.gravity.any()
    one = predictor.query(q[0], dq[0], ddq[0])
    assert np.isnan(one.potential)
    assert_close(one.tau, got.tau[0])


def test_links_without_gravity_have_no_potential() -> None:
    q, dq, ddq = queries(3)
    model = random_model_without_gravity()
    got = model.predict(q, dq, ddq)
    assert got.potential is None
    assert not got.gravity.any()
    assert model.arm is not None
    assert_close(got.tau, model.arm.torque(q, dq, ddq))


def test_the_potential_is_zero_at_its_reference() -> None:
    model = random_model('recursive')
    got = model.query(model.potential_reference, *np.ones((2, 3)))
    assert got.potential == 0.0


def test_nothing_is_compiled_once_a_predictor_stands() -> None:
    predictor = random_model('recursive')
    states = queries(3)
    predictor.predict(*states)
    random_model(ARTICULATED).predict(*states)
    before = len(evaluate_one.signatures), len(evaluate_many.signatures)  # type: ignore[attr-defined]
    expected = predictor.predict(*states).tau
    for x in states:
        x.flags.writeable = False
    wide = [np.asfortranarray(np.repeat(x, 2, axis=1)) for x in states]
    np.testing.assert_array_equal(predictor.predict(*states).tau, expected)
    np.testing.assert_array_equal(predictor.predict(*(x[:, ::2] for x in wide)).tau, expected)
    np.testing.assert_array_equal(predictor.predict(*(x.tolist() for x in states)).tau, expected)
    assert_close(predictor.query(*(x[0] for x in states)).tau, expected[0])
    assert_close(predictor.query(*(x[0, ::2] for x in wide)).tau, expected[0])
    after = len(evaluate_one.signatures), len(evaluate_many.signatures)  # type: ignore[attr-defined]
    assert after == before


def test_a_query_keeps_its_answer() -> None:
    predictor = random_model('recursive')
    q, dq, ddq = queries(3)
    first = predictor.query(q[0], dq[0], ddq[0])
    kept = first.tau.copy()
    predictor.query(q[1], dq[1], ddq[1])
    np.testing.assert_array_equal(first.tau, kept)


@pytest.mark.parametrize('member', KERNELS)
@pytest.mark.parametrize(
    'copied', [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_copies_have_working_memory_of_their_own(member: str, copied: Any) -> None:
    model = random_model(member)
    first, second = np.stack(queries(model.n_joints, 2), axis=1)
    expected = model.query(*second).tau
    model.query(*first)
    twin = copied(model)
    np.testing.assert_array_equal(twin.query(*second).tau, expected)
    assert twin._mean is not model._mean


def test_no_queries_have_no_answers() -> None:
    predictor = random_model('recursive')
    empty = np.empty((0, 3))
    assert predictor.predict(empty, empty, empty).tau.shape == (0, 3)
    assert predictor.inertia_matrix(empty).shape == (0, 3, 3)
    deviation = predictor.standard_deviation(empty, empty, empty)
    assert deviation.tau.shape == (0, 3)
    assert deviation.kinetic.shape == (0,)


@pytest.mark.parametrize(
    'states',
    [
        *(
            [['a', 'b', 'c']],
            [['1', '2', '3']],
            [[0.0], [0.0, 1.0]],
            [[None] * 3, 2.0],
            [[1j] * 3],
        ),
        np.ma.masked_array(np.zeros((2, 3)), mask=np.eye(2, 3, dtype=bool)),
    ],
)
def test_states_that_are_no_numbers(states: Any) -> None:
    predictor = random_model('recursive')
    sentence = r'^joint states must be arrays of numbers with rows of equal length; '
    for query in (predictor.gravity, predictor.potential_energy, predictor.inertia_matrix):
        with pytest.raises(ShapeError, match=sentence):
            query(states)
    with pytest.raises(ShapeError, match=sentence):
        predictor.predict(states, states, states)


@pytest.mark.parametrize('shapes', [((5, 2),) * 3, ((5, 3), (4, 3), (5, 3)), ((3,),) * 3])
def test_wrong_shapes(shapes: tuple[tuple[int, ...], ...]) -> None:
    predictor = random_model('recursive')
    arrays = [np.zeros(shape) for shape in shapes]
    sentence = r'must have shape \(N, 3\), but one has \(.*\); pass one row per sample'
    with pytest.raises(ShapeError, match=sentence):
        predictor.predict(*arrays)
    with pytest.raises(ShapeError, match=sentence):
        predictor.standard_deviation(*arrays)
