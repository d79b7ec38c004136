"""Compiled friction, against the features in numpy."""

from __future__ import annotations

from friction.test_terms import EVERY
from hypothesis import given
from hypothesis import strategies as st
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.compiled import (
    add_friction,
    CompiledFriction,
    friction_features,
    FrictionFeatures,
    set_load_slopes,
)
from lip_id_ros.friction.dahl import Dahl
from lip_id_ros.friction.dahl_friction import DahlFriction
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.terms import smooth_sign
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
    compiled, out = CompiledFriction.of(model), np.zeros_like(q)
    for row in range(len(q)):
        add_friction(compiled, q[row], dq[row], ddq[row], load[row], out[row])
    return out


@given(seed=st.integers(0, 10_000))
def test_same_as_in_numpy(seed: int) -> None:
    model = everything(seed)
    state = np.random.default_rng(seed).standard_normal((4, 20, 3))
    state[1, :2] = 0.0
    np.testing.assert_allclose(evaluated(model, *state), model.torque(*state), atol=1e-12)


@given(seed=st.integers(0, 10_000))
def test_features_with_their_history_are_the_same_as_in_numpy(seed: int) -> None:
    basis = everything(seed).basis
    rng = np.random.default_rng(seed)
    state = rng.standard_normal((4, 20, 3))
    state[1:3, :2] = 0.0
    dahl = rng.uniform(-1.0, 1.0, (20, 3, len(DISPLACEMENTS)))
    history = JointHistory(rng.standard_normal((20, 3)), dahl)
    q, dq, ddq, load = state
    found = friction_features(basis, q, dq, ddq, load, history)
    expected = basis.features(q, dq, ddq, load, history)
    for joint, column in enumerate(basis.columns()):
        np.testing.assert_allclose(found[:, joint, column], expected[joint], atol=1e-12)
        others = np.setdiff1d(np.arange(basis.size), column)
        np.testing.assert_array_equal(found[:, joint, others], 0.0)


@given(seed=st.integers(0, 10_000))
def test_slopes_by_loads_by_differences(seed: int) -> None:
    model = everything(seed)
    q, dq, ddq, load = np.random.default_rng(seed).standard_normal((4, 4, 3))
    load += np.copysign(0.1, load)  # away from zero, where the slope jumps
    found = FrictionFeatures(model.basis).load_slopes(model.coefficients, q, dq, ddq, load)
    for j, step in enumerate(1e-4 * np.eye(3)):
        ends = [model.torque(q, dq, ddq, load + sign * step) for sign in (1.0, -1.0)]
        change = ends[0] - ends[1]
        np.testing.assert_allclose(found[:, :, j], change / 2e-4, atol=1e-9)
    features, loaded = CompiledFriction.features_of(model.basis), model.basis.is_loaded
    fast = np.empty_like(found)
    for row in range(len(q)):
        state = q[row], dq[row], ddq[row], load[row]
        set_load_slopes(features, np.flatnonzero(loaded), model.coefficients, *state, fast[row])
    np.testing.assert_allclose(fast, found, atol=1e-12)


def test_no_friction_at_all() -> None:
    model = FrictionModel(FrictionBasis(2, ()), np.zeros(0))
    slopes = FrictionFeatures(model.basis).load_slopes(np.zeros(0), *np.ones((4, 4, 2)))
    np.testing.assert_array_equal(slopes, np.zeros((4, 2, 2)))
    np.testing.assert_array_equal(evaluated(model, *np.ones((4, 4, 2))), 0.0)


@given(seed=st.integers(0, 10_000))
def test_what_joints_remember_is_the_same_as_in_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    drives = [
        Drive.of_joint(0),
        Drive.of_joint(2),
        Drive((1, 2), (1.0, -0.5)),
        Drive((1,), (-2.0,)),
    ]
    displacements = rng.choice(DISPLACEMENTS, 8)
    terms = tuple(
        DriveTerm(drives[k % 4], Dahl(rng.uniform(0.01, 1.0), float(x)))
        for k, x in enumerate(displacements)
    )
    basis = FrictionBasis(3, terms, 0.05 * rng.integers(2))
    model = FrictionModel(basis, rng.uniform(0.0, 2.0, basis.size))
    q, dq, ddq, load = rng.standard_normal((4, 20, 3))
    dahl = rng.uniform(-1.0, 1.0, (20, 3, len(DISPLACEMENTS)))
    expected = model.torque(q, dq, ddq, load, JointHistory(dahl=dahl))
    compiled = DahlFriction.of(model, np.zeros(model.n_joints, dtype=bool))
    np.testing.assert_allclose(compiled.torque(dq, ddq, dahl), expected, atol=1e-12)
    # the variance of a state that is one or minus one: at the sign of the velocity in the mean
    # where nothing else is known, and at the start of a path of which a share is left
    share, single, unknown = np.abs(dahl), np.zeros((20, 3)), np.zeros((20, 3))
    for part, coefficient in zip(terms, model.coefficients, strict=True):
        if isinstance(part.term, Dahl) and len(part.drive.joints) == 1:
            j, place = part.drive.joints[0], DISPLACEMENTS.index(part.term.displacement)
            sign = smooth_sign(
                part.drive.state(q, dq, ddq, load, basis.rise_time), part.term.width
            )
            single[:, j] += coefficient**2 * (1.0 - sign**2)
            unknown[:, j] += (coefficient * share[:, j, place]) ** 2
    np.testing.assert_allclose(compiled.single_std(dq, ddq) ** 2, single, atol=1e-12)
    np.testing.assert_allclose(compiled.unknown_std(share) ** 2, unknown, atol=1e-12)
