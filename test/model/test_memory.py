"""Friction with a memory in predictions: of motions, of single states, and along a stream."""

from __future__ import annotations

from dataclasses import replace

from model.models import random_model
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ShapeError
from lip_id_ros.evaluation.prediction import standard_deviation
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.dahl import LONGEST_GAP_S
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import dahl
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED

WIDTH, STRENGTH = 0.02, 2.0
States = tuple[Array, Array, Array]


@pytest.fixture(scope='module')
def model() -> InverseDynamicsModel:
    plain = random_model(ARTICULATED, residual_gp=False)
    assert plain.arm is not None
    n = plain.n_joints
    basis = plain_friction(n, np.full(n, WIDTH))
    term = DriveTerm(Drive.of_joint(0), dahl(WIDTH, 1e-3))
    basis = replace(basis, terms=(*basis.terms, term))
    coefficients = np.zeros(basis.size)
    coefficients[[1, -1]] = STRENGTH
    friction = FrictionModel(basis, coefficients)
    root = np.zeros((17 * n + basis.size, 1))
    return replace(plain, arm=replace(plain.arm, friction=friction, covariance_root=root))


def motion(model: InverseDynamicsModel) -> tuple[Array, States]:
    t = np.arange(0.0, 6.0, 0.02)
    rate = np.linspace(0.7, 1.3, model.n_joints)
    angle = rate * t[:, None]
    return t, (np.sin(angle), rate * np.cos(angle), -(rate**2) * np.sin(angle))


def remembered(model: InverseDynamicsModel, states: States, t: Array | None = None) -> Array:
    single = np.array([model.query(*each).tau for each in zip(*states, strict=True)])
    return np.asarray(model.predict(*states, t).tau - single)


def test_the_past_of_some_rows_is_that_of_all(model: InverseDynamicsModel) -> None:
    t, states = motion(model)
    rows = np.arange(32, len(t), 40)  # one of them at rest
    data = Dataset.from_arrays(*states, states[0], t=t, joint_names=model.joint_names)
    known = model.standard_deviation(*states, t).tau[rows]
    np.testing.assert_array_equal(standard_deviation(model, data, rows=rows).tau, known)
    q, dq, ddq = (each[rows] for each in states)
    alone = model.standard_deviation(q, dq, ddq).tau
    assert alone[:, 0].max() > 0.1 * STRENGTH > 10.0 * known[:, 0].max()


def test_a_joint_that_leaves_rest_has_an_unknown_friction_until_it_has_gone_some_way(
    model: InverseDynamicsModel,
) -> None:
    t, rates = np.arange(0.0, 0.2, 0.01), 5.0 * np.ones(model.n_joints)
    q, dq, ddq = 0.5 * rates * t[:, None] ** 2, rates * t[:, None], np.tile(rates, (len(t), 1))
    start = model.predict(q, dq, ddq, t, return_std=True)
    # the same after a motion backwards, which came to rest there
    rates, changes = (np.pad(x, ((1, 0), (0, 0))) for x in (dq, ddq))
    after = model.predict(np.vstack([q[:1] + 1.0, q]), rates, changes, np.append(-0.01, t))
    change = after.tau[1:, 0] - start.tau[:, 0]
    assert start.std is not None
    assert -change[1] > 0.5 * STRENGTH  # where the sign is that of the motion already
    np.testing.assert_allclose(start.std.tau[:, 0], -change, atol=1e-9)


def test_single_states_have_the_friction_of_an_unknown_past(model: InverseDynamicsModel) -> None:
    _, states = motion(model)
    order = np.random.default_rng(0).permutation(len(states[0]))
    some = states[0][order], states[1][order], states[2][order]
    assert np.abs(remembered(model, some)).max() < 1e-12
    rest = np.zeros((1, model.n_joints))
    known = model.standard_deviation(*states, motion(model)[0]).tau[-1]
    np.testing.assert_allclose(model.standard_deviation(rest, rest, rest).tau[0, 0], STRENGTH)
    assert known[0] < 1e-3 * STRENGTH


def test_an_array_that_is_used_again_spoils_no_memory(model: InverseDynamicsModel) -> None:
    t, states = motion(model)
    memory, expected = model.running_memory(), remembered(model, states, t)
    assert memory is not None
    rows, state = np.stack(states, axis=1), np.empty((3, model.n_joints))
    for now, row, torque in zip(t.tolist(), rows, expected, strict=True):
        state[:] = row
        np.testing.assert_allclose(memory.torque(state, now), torque, atol=1e-9)


def test_a_stream_that_was_silent_begins_anew(model: InverseDynamicsModel) -> None:
    t, states = motion(model)
    memory = model.running_memory()
    assert memory is not None
    rows = np.stack(states, axis=1)
    for now, state in zip(t.tolist(), rows, strict=True):
        memory.torque(state, now)
    still = np.stack([rows[-1, 0], 0.0 * rows[-1, 0], 0.0 * rows[-1, 0]])
    assert abs(memory.torque(still, t[-1] + 0.01)[0]) > 0.9 * STRENGTH
    assert not memory.torque(still, t[-1] + 2.0 * LONGEST_GAP_S).any()
    memory.torque(rows[-1], 100.0)
    assert memory.torque(still, 100.1).any()
    memory.torque(rows[-1], 100.0)
    assert not memory.torque(still, 99.0).any()  # a clock that was set back


def test_times_that_do_not_fit_are_refused(model: InverseDynamicsModel) -> None:
    t, states = motion(model)
    with pytest.raises(ShapeError, match='t must have shape'):
        model.predict(*states, t[1:])
    with pytest.raises(ShapeError, match='t must be an array of numbers'):
        model.predict(*states, [str(each) for each in t])


def test_a_state_that_is_not_finite_spoils_no_other(model: InverseDynamicsModel) -> None:
    t, states = motion(model)
    q = states[0].copy()
    q[100, 0] = np.nan
    for times in (t, None):
        found = model.predict(q, states[1], states[2], times).tau
        assert np.flatnonzero(~np.isfinite(found).all(axis=1)).tolist() == [100]
    std = model.standard_deviation(q, states[1], states[2], t).tau
    assert np.isfinite(np.delete(std, 100, axis=0)).all()
    memory = model.running_memory()
    assert memory is not None
    rows = zip(t.tolist(), np.stack([q, *states[1:]], axis=1), strict=True)
    found = np.array([memory.torque(state, now) for now, state in rows])
    assert np.isfinite(found).all()


def test_a_process_in_place_of_friction_has_no_memory(model: InverseDynamicsModel) -> None:
    """The last joint has a process in place of links and friction, the first one beside them."""
    assert model.arm is not None
    friction, n = model.arm.friction, model.n_joints
    last = DriveTerm(Drive.of_joint(n - 1), dahl(WIDTH, 1e-3))
    basis = replace(friction.basis, terms=(*friction.basis.terms, last))
    both = FrictionModel(basis, np.append(friction.coefficients, STRENGTH))
    root = np.zeros((17 * n + basis.size, 1))
    arm = replace(model.arm, friction=both, covariance_root=root)
    residual_gp = random_model(ARTICULATED).residual_gp
    assert residual_gp is not None
    assert residual_gp.replaces.tolist() == [False] * (n - 1) + [True]
    replaced = replace(model, arm=arm, residual_gp=residual_gp)
    t, states = motion(model)
    beside = remembered(replaced, states, t)
    assert np.abs(beside[:, 0]).max() > 0.1 * STRENGTH
    assert np.abs(beside[:, -1]).max() < 1e-12
    stream = replaced.running_memory()
    assert stream is not None
    rows = zip(t.tolist(), np.stack(states, axis=1), strict=True)
    added = np.array([stream.torque(state, now) for now, state in rows])
    np.testing.assert_allclose(added, beside, atol=1e-9)
    few = [each[:9] for each in states]
    known, unknown = (replaced.torque_std(few[0], few[1], few[2], at) for at in (t[:9], None))
    np.testing.assert_allclose(known[:, -1], unknown[:, -1])
