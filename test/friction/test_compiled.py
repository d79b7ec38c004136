"""Compiled friction, against the features in numpy."""

from __future__ import annotations

import timeit

from friction.test_terms import coupled, EVERY
from hypothesis import given
from hypothesis import strategies as st
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.compiled import add_friction, CompiledFriction, set_load_slopes
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.terms import Coulomb, LoadCoulomb, Offset, Stribeck, Viscous
from lip_id_ros.numba_jit import jit


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
def test_slopes_by_loads_by_differences(seed: int) -> None:
    model = everything(seed)
    q, dq, ddq, load = np.random.default_rng(seed).standard_normal((4, 4, 3))
    load += np.copysign(0.1, load)  # away from zero, where the slope jumps
    found = model.load_slopes(q, dq, ddq, load)
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


def test_added_to_what_is_there() -> None:
    model = coupled()
    q, dq, ddq, load = np.random.default_rng(0).standard_normal((4, 3))
    out = load.copy()
    add_friction(CompiledFriction.of(model), q, dq, ddq, load, out)
    expected = load + model.torque(q[None], dq[None], ddq[None], load[None])[0]
    np.testing.assert_allclose(out, expected, rtol=1e-12)


def test_no_friction_at_all() -> None:
    model = FrictionModel(FrictionBasis(2, ()), np.zeros(0))
    np.testing.assert_array_equal(evaluated(model, *np.ones((4, 4, 2))), 0.0)


@jit
def repeated(
    friction: CompiledFriction,
    q: Array,
    dq: Array,
    ddq: Array,
    load: Array,
    out: Array,
    times: int,
) -> None:
    for _ in range(times):
        add_friction(friction, q, dq, ddq, load, out)


@jit
def tanh_repeated(dq: Array, times: int) -> float:
    total = 0.0
    for k in range(times):
        for j in range(len(dq)):
            total += np.tanh(dq[j] + 1e-9 * k)
    return total


def test_costs_little_more_than_its_signs() -> None:
    """Seven joints with four terms and an offset each: a few tanh per joint, and nothing else."""
    terms = (Viscous(), Coulomb(0.1), Offset(), Stribeck(0.1), LoadCoulomb(0.1))
    parts = tuple(DriveTerm(Drive.of_joint(j), term) for j in range(7) for term in terms)
    basis = FrictionBasis(7, parts)
    compiled = CompiledFriction.of(FrictionModel(basis, np.ones(basis.size)))
    q, dq, ddq, load = np.random.default_rng(0).standard_normal((4, 7))
    out, times = np.zeros(7), 5_000
    repeated(compiled, q, dq, ddq, load, out, 1)
    tanh_repeated(dq, 1)
    spent = min(
        timeit.repeat(
            lambda: repeated(compiled, q, dq, ddq, load, out, times), number=1, repeat=20
        )
    )
    signs = 4 * min(timeit.repeat(lambda: tanh_repeated(dq, times), number=1, repeat=20))
    assert spent < 5.0 * signs
