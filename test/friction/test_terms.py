"""Friction terms: their two forms agree, they never drive a joint, and files keep them."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError, ShapeError
from lip_id_ros.friction import drives, terms
from lip_id_ros.friction.drives import Drive, DriveTerm, LoadTorque, SharedFriction, SignWidth
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.primitives import (
    ANYWHERE,
    COSINE,
    LOAD,
    POSITION,
    Primitive,
    SIGN,
    SQUARE,
    VELOCITY,
)
from lip_id_ros.friction.terms import (
    Asymmetric,
    Coulomb,
    DriveState,
    FREE,
    FrictionTerm,
    LoadCoulomb,
    LoadViscous,
    Offset,
    PositionCoulomb,
    QuadraticViscous,
    Ripple,
    SaturatingViscous,
    Spring,
    Stribeck,
    Viscous,
)

EVERY: list[FrictionTerm] = [
    Viscous(),
    Coulomb(0.1),
    Offset(),
    Stribeck(0.05),
    SaturatingViscous(0.05),
    QuadraticViscous(),
    LoadCoulomb(0.1),
    LoadViscous(),
    Asymmetric(0.1),
    PositionCoulomb(0.1),
    Ripple(1),
    Ripple(2),
    Spring(),
    LoadTorque(),
    SharedFriction(0.1),
]
DISSIPATIVE = [term for term in EVERY if FREE not in term.lower]
finite = st.floats(-20.0, 20.0)


def name(term: FrictionTerm) -> str:
    return term.name


def states(n_samples: int = 200) -> DriveState:
    rng = np.random.default_rng(0)
    q, dq, load = rng.standard_normal((3, n_samples)) * np.array([[2.0], [1.0], [30.0]])
    dq[:5] = 0.0
    return DriveState(q, dq, load)


def primitive_value(primitive: Primitive, state: DriveState) -> Array:
    shapes = {
        VELOCITY: state.dq,
        SIGN: np.tanh(state.dq / primitive.width),
        SQUARE: state.dq * np.abs(state.dq),
        LOAD: state.load,
    }
    shape = shapes.get(primitive.shape, np.ones_like(state.dq))
    if primitive.side:
        shape = np.where(np.sign(shape) == primitive.side, shape, 0.0)
    if primitive.loaded:
        shape = shape * np.abs(state.load)
    if primitive.position == ANYWHERE:
        return shape
    if primitive.position == POSITION:
        return shape * state.q
    wave = np.cos if primitive.position == COSINE else np.sin
    return np.asarray(shape * wave(primitive.harmonic * state.q))


def test_every_term_is_tested() -> None:
    assert {type(term).__name__ for term in (*EVERY, SignWidth(0.1))} == {
        name
        for name, kind in (*vars(terms).items(), *vars(drives).items())
        if isinstance(kind, type) and hasattr(kind, 'columns') and name != 'FrictionTerm'
    }


@pytest.mark.parametrize('term', [*EVERY, SignWidth(0.1)], ids=name)
def test_primitives_add_up_to_the_features(term: FrictionTerm) -> None:
    state = states()
    sums = [
        sum(factor * primitive_value(primitive, state) for factor, primitive in column)
        for column in term.columns()
    ]
    np.testing.assert_allclose(np.column_stack(sums), term.features(state), atol=1e-13)
    assert len(term.lower) == len(sums)


@pytest.mark.parametrize('term', EVERY, ids=name)
def test_which_features_depend_on_the_load(term: FrictionTerm) -> None:
    state = states()
    other = DriveState(state.q, state.dq, 2.0 * state.load)
    changes = (term.features(state) != term.features(other)).any(axis=0)
    basis = FrictionBasis(1, (DriveTerm(Drive.of_joint(0), term),))
    np.testing.assert_array_equal(basis.is_loaded, changes)


@pytest.mark.parametrize('term', DISSIPATIVE, ids=name)
@given(q=finite, dq=finite, load=finite)
def test_no_feature_drives_a_joint(term: FrictionTerm, q: float, dq: float, load: float) -> None:
    features = term.features(DriveState(np.array([q]), np.array([dq]), np.array([load])))
    assert np.all(features * dq >= 0.0)


def test_stribeck_friction_decays() -> None:
    dq = np.array([0.1, 0.3, 1.0, 3.0, 10.0])
    features = Stribeck(0.02).features(DriveState(dq, dq, dq))
    assert np.all(np.diff(features, axis=0) <= 0.0)
    np.testing.assert_allclose(features[-1], 0.0, atol=1e-9)


def coupled() -> FrictionModel:
    drives = [
        DriveTerm(Drive.of_joint(0), Viscous()),
        DriveTerm(Drive((2, 1), (1.0, -1.0)), Coulomb(0.1)),
        DriveTerm(Drive.of_joint(1), LoadCoulomb(0.2)),
        DriveTerm(Drive.of_joint(1), Offset()),
    ]
    return FrictionModel(FrictionBasis(3, tuple(drives)), np.array([0.5, 2.0, 0.1, -0.3]))


def test_friction_of_coupled_motors() -> None:
    """The motor's torque acts on each joint times the ratio of speeds: by virtual work."""
    rng = np.random.default_rng(1)
    q, dq, load = rng.standard_normal((3, 50, 3))
    got = coupled().torque(q, dq, load)
    motor = 2.0 * np.tanh((dq[:, 2] - dq[:, 1]) / 0.1)
    np.testing.assert_allclose(got[:, 0], 0.5 * dq[:, 0])
    np.testing.assert_allclose(got[:, 2], motor)
    own = 0.1 * np.abs(load[:, 1]) * np.tanh(dq[:, 1] / 0.2) - 0.3
    np.testing.assert_allclose(got[:, 1], own - motor)
    power = np.sum((got - np.array([0.0, -0.3, 0.0])) * dq, axis=1)
    assert np.all(power >= 0.0)


def transmitted() -> FrictionModel:
    """Return what motors of a coupled wrist have: the second effort contains the third torque."""
    own = DriveTerm(Drive.of_joint(2), Viscous())
    drive = Drive.transmitted(2, to=1)
    terms = own, DriveTerm(drive, LoadTorque()), DriveTerm(drive, SharedFriction(0.1))
    return FrictionModel(FrictionBasis(3, terms), np.array([0.5, -0.7, 0.2, 0.3]))


def test_efforts_of_coupled_motors_contain_torques_of_other_joints() -> None:
    rng = np.random.default_rng(2)
    q, dq, load = rng.standard_normal((3, 50, 3))
    got, model = transmitted().torque(q, dq, load), transmitted()
    shared = 0.2 * dq[:, 2] + 0.3 * np.tanh(dq[:, 2] / 0.1)
    np.testing.assert_allclose(got[:, 1], shared - 0.7 * load[:, 2])
    np.testing.assert_allclose(got[:, 2], 0.5 * dq[:, 2])
    friction = model.torque(q, dq, np.zeros_like(load))
    np.testing.assert_allclose(model.efforts(load) + friction, load + got)
    assert model.names()[1] == ('torque coupled with joint 3', 'friction coupled with joint 3')


def test_names_in_the_words_of_the_field() -> None:
    assert coupled().names() == (
        ('viscous',),
        ('Coulomb coupled with joint 3', 'load-dependent Coulomb', 'offset'),
        ('Coulomb coupled with joint 2',),
    )


@pytest.mark.parametrize('term', EVERY, ids=name)
def test_a_file_keeps_the_term(term: FrictionTerm) -> None:
    drives = Drive((1, 0), (1.0, 0.5)), Drive.transmitted(0, to=1)
    basis = FrictionBasis(2, tuple(DriveTerm(drive, term) for drive in drives))
    model = FrictionModel(basis, np.arange(1.0, basis.size + 1))
    again = FrictionModel.from_json(model.to_json())
    assert again.basis == model.basis
    np.testing.assert_array_equal(again.coefficients, model.coefficients)


def damaged(**changes: object) -> dict[str, object]:
    return {**coupled().to_json(), **changes}


@pytest.mark.parametrize(
    'entry',
    [
        {},
        damaged(coefficients=[1.0]),
        damaged(coefficients=['x'] * 4),
        damaged(coefficients=[0.5, -2.0, 0.1, 0.0]),
        damaged(coefficients=[0.5, float('nan'), 0.1, 0.0]),
        damaged(terms=[{'term': 'Magic', 'joints': [0], 'ratios': [1.0]}]),
        damaged(terms=[{'term': 'Viscous', 'joints': [7], 'ratios': [1.0]}]),
        damaged(terms=[{'term': 'Coulomb', 'joints': [0], 'ratios': [1.0]}]),
        damaged(terms=[{'term': 'Viscous', 'joints': [0], 'ratios': []}]),
        damaged(terms=None),
    ],
)
def test_damaged_files_are_refused_in_a_sentence(entry: dict[str, object]) -> None:
    with pytest.raises(ModelError, match='expected'):
        FrictionModel.from_json(entry)


def test_one_coefficient_per_feature() -> None:
    with pytest.raises(ShapeError, match='one per feature'):
        FrictionModel(coupled().basis, np.zeros(2))
