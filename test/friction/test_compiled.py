"""Compiled friction of an arm, against its features."""

from __future__ import annotations

from friction.test_terms import EVERY
from hypothesis import given
from hypothesis import strategies as st
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.compiled import add_friction
from lip_id_ros.friction.dahl_friction import DahlFriction
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import dahl
from lip_id_ros.joint_types import DISPLACEMENTS, JointHistory


def everything(seed: int) -> FrictionModel:
    """Every term on one of three joints, or on a motor that turns with two."""
    rng = np.random.default_rng(seed)
    drives = [Drive.of_joint(0), Drive.of_joint(2), Drive((1, 2), (1.0, -0.5))]
    drives.append(Drive.transmitted(1, to=2))
    terms = tuple(DriveTerm(drives[rng.integers(4)], term) for term in EVERY)
    basis = FrictionBasis(3, terms, 0.05 * rng.integers(2))
    return FrictionModel(basis, rng.uniform(0.0, 2.0, basis.size))


def evaluated(model: FrictionModel, q: Array, dq: Array, ddq: Array, load: Array) -> Array:
    out = np.zeros_like(q)
    for row in range(len(q)):
        add_friction(model.compiled, q[row], dq[row], ddq[row], load[row], out[row])
    return out


@given(seed=st.integers(0, 10_000))
def test_one_state_has_the_torque_of_many(seed: int) -> None:
    model = everything(seed)
    state = np.random.default_rng(seed).standard_normal((4, 20, 3))
    state[1, :2] = 0.0
    np.testing.assert_allclose(evaluated(model, *state), model.torque(*state), atol=1e-12)


@given(seed=st.integers(0, 10_000))
def test_features_of_joints_make_the_torques(seed: int) -> None:
    model, rng = everything(seed), np.random.default_rng(seed)
    basis, (q, dq, ddq, load) = model.basis, rng.standard_normal((4, 20, 3))
    states = rng.uniform(-1.0, 1.0, (20, 3, len(DISPLACEMENTS)))
    known = q, dq, ddq, load, JointHistory(rng.standard_normal((20, 3)), states)
    found, torque = basis.features(*known), model.torque(*known)
    np.testing.assert_allclose(found @ model.coefficients, torque, atol=1e-12)
    parts = zip(basis.features_of_joints(*known), basis.columns(), strict=True)
    for joint, (own, column) in enumerate(parts):
        np.testing.assert_array_equal(found[:, joint, column], own)
        others = np.setdiff1d(np.arange(basis.size), column)
        np.testing.assert_array_equal(found[:, joint, others], 0.0)


@given(seed=st.integers(0, 10_000))
def test_slopes_by_loads_by_differences(seed: int) -> None:
    model = everything(seed)
    q, dq, ddq, load = np.random.default_rng(seed).standard_normal((4, 4, 3))
    load += np.copysign(0.1, load)  # away from zero, where the slope jumps
    found = model.load_slopes(q, dq, ddq, load)
    for j, step in enumerate(1e-4 * np.eye(3)):
        ends = [model.torque(q, dq, ddq, load + sign * step) for sign in (1.0, -1.0)]
        change = ends[0] - ends[1]
        np.testing.assert_allclose(found[:, :, j], change / 2e-4, atol=1e-9)


def test_no_friction_at_all() -> None:
    model = FrictionModel(FrictionBasis(2, ()), np.zeros(0))
    slopes = model.load_slopes(*np.ones((4, 4, 2)))
    np.testing.assert_array_equal(slopes, np.zeros((4, 2, 2)))
    np.testing.assert_array_equal(evaluated(model, *np.ones((4, 4, 2))), 0.0)


@given(seed=st.integers(0, 10_000))
def test_what_joints_remember_is_the_same_by_states(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drives = [
        Drive.of_joint(0),
        Drive.of_joint(2),
        Drive((1, 2), (1.0, -0.5)),
        Drive((1,), (-2.0,)),
    ]
    displacements = rng.choice(DISPLACEMENTS, 8)
    terms = tuple(
        DriveTerm(drives[k % 4], dahl(rng.uniform(0.01, 1.0), float(x)))
        for k, x in enumerate(displacements)
    )
    basis = FrictionBasis(3, terms, 0.05 * rng.integers(2))
    model = FrictionModel(basis, rng.uniform(0.0, 2.0, basis.size))
    q, dq, ddq, load = rng.standard_normal((4, 20, 3))
    states = rng.uniform(-1.0, 1.0, (20, 3, len(DISPLACEMENTS)))
    expected = model.torque(q, dq, ddq, load, JointHistory(dahl=states))
    compiled = DahlFriction.of(model, np.zeros(model.n_joints, dtype=bool))
    np.testing.assert_allclose(compiled.torque(dq, ddq, states), expected, atol=1e-12)
    # the variance of a state that is one or minus one: at the sign of the velocity in the mean
    # where nothing else is known, and at the start of a path of which a share is left
    share, single, unknown = np.abs(states), np.zeros((20, 3)), np.zeros((20, 3))
    for part, coefficient in zip(terms, model.coefficients, strict=True):
        if part.term.kind is dahl and len(part.drive.joints) == 1:
            j, known, ratio = part.drive.joints[0], part.term.parameters, part.drive.ratios[0]
            place = DISPLACEMENTS.index(known['displacement'])
            width = np.hypot(known['width'], basis.rise_time * ddq[:, j] * ratio)
            sign = np.tanh(ratio * dq[:, j] / width)
            single[:, j] += coefficient**2 * (1.0 - sign**2)
            unknown[:, j] += (coefficient * share[:, j, place]) ** 2
    np.testing.assert_allclose(compiled.single_std(dq, ddq) ** 2, single, atol=1e-12)
    np.testing.assert_allclose(compiled.unknown_std(share) ** 2, unknown, atol=1e-12)
