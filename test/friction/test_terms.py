"""Friction terms: their two forms agree, they never drive a joint, and files keep them."""

from __future__ import annotations

from pathlib import Path

from export.arms import EXTRA
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ModelError, ShapeError
from lip_id_ros.friction import drives, terms
from lip_id_ros.friction.conservative_terms import LeverShape, LeverSpring, Ripple, Spring
from lip_id_ros.friction.curves import PositionCurve, VelocityCurve
from lip_id_ros.friction.dahl import Dahl
from lip_id_ros.friction.drives import Drive, DriveTerm, LoadTorque, SharedFriction, SignWidth
from lip_id_ros.friction.model import FrictionBasis, FrictionModel
from lip_id_ros.friction.primitives import (
    ACCELERATION,
    ANYWHERE,
    COSINE,
    LEVER,
    LOAD,
    POSITION,
    Primitive,
    REVERSAL,
    SIGN,
    SQUARE,
    STEP,
    STEP_AT,
    VELOCITY,
)
from lip_id_ros.friction.terms import (
    Asymmetric,
    Coulomb,
    DriveState,
    FREE,
    FrictionTerm,
    Lag,
    LoadCoulomb,
    LoadViscous,
    Offset,
    PositionCoulomb,
    Presliding,
    QuadraticViscous,
    SaturatingViscous,
    smooth_sign,
    Stribeck,
    Viscous,
)
from lip_id_ros.identification.friction_candidates import (
    candidates,
    lever_candidate,
    plain_candidates,
    RISE_PERIODS,
)
from lip_id_ros.identification.sample_selection import remembering
from lip_id_ros.joint_types import JointHistory
from lip_id_ros.preprocessing.smoothing import low_pass

EVERY: list[FrictionTerm] = [
    Viscous(),
    Lag(),
    Coulomb(0.1),
    Offset(),
    Stribeck(0.05),
    Stribeck(0.03, 0.02),
    SaturatingViscous(0.05),
    QuadraticViscous(),
    LoadCoulomb(0.1),
    LoadViscous(),
    Presliding(0.1, 2.0),
    Asymmetric(0.1),
    PositionCoulomb(0.1),
    Ripple(1),
    Ripple(2),
    Spring(),
    LeverSpring(0.6, 0.4),
    PositionCurve(-1.0, 2.0, 8),
    VelocityCurve(-0.5, 1.0, 6),
    Dahl(0.1, 1e-3),
    LoadTorque(),
    SharedFriction(0.1),
]
SHAPES: list[FrictionTerm] = [SignWidth(0.1), LeverShape(0.6, 0.4)]
DISSIPATIVE = [
    term for term in EVERY if FREE not in term.lower and not isinstance(term, Presliding | Lag)
]
finite = st.floats(-20.0, 20.0)


def name(term: FrictionTerm) -> str:
    return term.name


def states(n_samples: int = 200) -> DriveState:
    rng = np.random.default_rng(0)
    sizes = np.array([[2.0], [1.0], [3.0], [30.0]])
    q, dq, ddq, load = rng.standard_normal((4, n_samples)) * sizes
    dq[:5] = 0.0
    return DriveState(q, dq, ddq, load, 0.05 * np.abs(ddq))


def primitive_value(primitive: Primitive, state: DriveState) -> Array:
    width = np.sqrt(primitive.width**2 + np.square(state.smoothing))
    shapes: dict[int, Array] = {
        VELOCITY: state.dq,
        SIGN: np.tanh(state.dq / width),
        SQUARE: state.dq * np.abs(state.dq),
        LOAD: state.load,
        ACCELERATION: state.ddq,
        STEP: np.tanh((state.dq - primitive.centre) / primitive.width),
        REVERSAL: np.tanh(state.ddq / primitive.acceleration) / np.cosh(state.dq / width) ** 2,
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
    if primitive.position == STEP_AT:
        return np.asarray(shape * np.tanh(primitive.harmonic * (state.q - primitive.centre)))
    at = state.q - primitive.centre
    if primitive.position == LEVER:
        return np.asarray(shape * np.sin(at) / np.sqrt(1.0 - primitive.harmonic * np.cos(at)))
    wave = np.cos if primitive.position == COSINE else np.sin
    return np.asarray(shape * wave(primitive.harmonic * at))


def test_every_term_is_tested() -> None:
    assert {type(term).__name__ for term in (*EVERY, SHAPES[0])} == {
        name
        for name, kind in (*vars(terms).items(), *vars(drives).items())
        if isinstance(kind, type) and hasattr(kind, 'columns') and name != 'FrictionTerm'
    }


@pytest.mark.parametrize('term', [*EVERY, *SHAPES], ids=name)
def test_primitives_add_up_to_the_features(term: FrictionTerm) -> None:
    state = states()
    sums = [
        sum((f * primitive_value(each, state) for f, each in column), start=0.0 * state.q)
        for column in term.columns()
    ]
    np.testing.assert_allclose(np.column_stack(sums), term.features(state), atol=1e-11)
    assert len(term.lower) == len(sums)


@given(st.floats(0.02, 0.2), st.floats(0.3, 0.5), st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_a_lever_spring_has_the_torque_of_its_energy(
    a: float, b: float, centre: float, rest: float
) -> None:
    """A coil of stiffness 1 and any length of rest, by differences of its energy."""
    q, h = np.linspace(-3.0, 3.0, 50), 1e-6
    square = a**2 + b**2

    def energy(at: Array) -> Array:
        length = np.sqrt(square - 2.0 * a * b * np.cos(at - centre))
        return np.asarray(0.5 * (length - rest) ** 2)

    eccentricity = 2.0 * a * b / square
    force, stiffness = LeverSpring(eccentricity, centre).features(states(q.size)._replace(q=q)).T
    half = 0.5 * square * eccentricity
    torque = half * (stiffness - rest / np.sqrt(square) * force)
    slope = (energy(q + h) - energy(q - h)) / (2.0 * h)
    np.testing.assert_allclose(torque, slope, atol=1e-9)


def test_shapes_of_levers_are_slopes() -> None:
    state, term, h = states(), LeverSpring(0.6, 0.4), 1e-5
    slopes = LeverShape(0.6, 0.4).features(state)
    wider, narrower = (LeverSpring(0.6 + k, 0.4).features(state) for k in (h, -h))
    later, earlier = (LeverSpring(0.6, 0.4 + k).features(state) for k in (h, -h))
    expected = [(wider - narrower)[:, 0], *(later - earlier).T]
    np.testing.assert_allclose(slopes, np.column_stack(expected) / (2.0 * h), atol=1e-6)
    model = FrictionModel(one_drive(term), np.array([2.0, -3.0])).with_shapes()
    assert model.basis.size == 5
    assert model.shape_std.shape == (3,)


def one_drive(term: FrictionTerm) -> FrictionBasis:
    return FrictionBasis(1, (DriveTerm(Drive.of_joint(0), term),))


@pytest.mark.parametrize('term', EVERY, ids=name)
def test_which_features_depend_on_the_load(term: FrictionTerm) -> None:
    state = states()
    other = state._replace(load=2.0 * state.load)
    changes = (term.features(state) != term.features(other)).any(axis=0)
    basis = FrictionBasis(1, (DriveTerm(Drive.of_joint(0), term),))
    np.testing.assert_array_equal(basis.is_loaded, changes)


@pytest.mark.parametrize('term', DISSIPATIVE, ids=name)
@given(state=st.tuples(*[finite] * 5))
def test_no_feature_drives_a_joint(term: FrictionTerm, state: tuple[float, ...]) -> None:
    features, dq = term.features(DriveState(*np.array(state)[:, None])), state[1]
    assert np.all(features * dq >= 0.0)


def test_presliding_friction_works_for_nothing_over_a_reversal() -> None:
    """It opposes the motion less after the reversal by as much as more before it."""
    t = np.linspace(-1.0, 1.0, 2001)
    for ddq in 3.0, -3.0:
        still = np.zeros_like(t)
        state = DriveState(0.5 * ddq * t**2, ddq * t, np.full_like(t, ddq), still)
        power = Presliding(0.1, 2.0).features(state)[:, 0] * state.dq
        assert np.all(power[t < 0.0] >= 0.0)
        assert np.all(power[t > 0.0] <= 0.0)
        assert abs(np.sum(power)) < 1e-9 * np.sum(np.abs(power))


@pytest.mark.parametrize('cutoff', [2.0, 4.0])
@pytest.mark.parametrize('ddq', [0.5, -3.0])
def test_a_smooth_sign_is_the_sign_of_a_velocity_after_the_low_pass(
    cutoff: float, ddq: float
) -> None:
    """Of a joint that reverses, in the time in which the low-pass responds."""
    rate = 1000.0
    t = np.arange(-2000.5, 2000.0) / rate
    state = DriveState(0.0 * t, ddq * t, np.full_like(t, ddq), 0.0 * t)
    filtered = low_pass(np.sign(state.dq), rate, cutoff)
    smooth = state._replace(smoothing=RISE_PERIODS / cutoff * abs(ddq))
    near = np.abs(t) < 0.5 / cutoff
    assert np.std((smooth_sign(smooth, 1e-3) - filtered)[near]) < 0.11
    assert np.std((smooth_sign(state, 1e-3) - filtered)[near]) > 0.35


def test_a_narrow_sign_is_the_low_passed_one_where_that_is_known() -> None:
    """A wide one is not that of the samples; what the low-pass does not widen stays as it is."""
    rate, cutoff, rise_time = 200.0, 4.0, RISE_PERIODS / 4.0
    t = np.arange(2000.0) / rate
    q, dq, ddq = np.sin(3.0 * t), 3.0 * np.cos(3.0 * t), -9.0 * np.sin(3.0 * t)
    motion = q[:, None], dq[:, None], ddq[:, None], np.zeros((t.size, 1))
    sign = low_pass(np.sign(motion[1]), rate, cutoff)
    inside = (np.abs(ddq) > 0.1) & (t > 0.5) & (t < 9.5)
    for width, most in (1e-4, 1e-5), (0.1, 0.01), (0.3, 0.03):
        terms = (DriveTerm(Drive((0,), (-2.0,), (1.0,)), Coulomb(width)),)
        basis = FrictionBasis(1, terms, rise_time)
        known, steady = basis.features(*motion, JointHistory(sign))[0], basis.features(*motion)[0]
        assert np.abs(known + sign)[inside].max() < most
        assert np.abs(steady + sign)[inside].max() > 0.14
    unfiltered = FrictionBasis(1, terms)
    np.testing.assert_array_equal(
        unfiltered.features(*motion, JointHistory(sign))[0], unfiltered.features(*motion)[0]
    )


def test_the_rise_time_is_that_of_the_low_pass() -> None:
    rate, cutoff = 2000.0, 4.0
    t = np.arange(-8000.5, 8000.0) / rate
    response = low_pass(np.sign(t), rate, cutoff)
    found = minimize_scalar(
        lambda rise_time: np.sum((np.tanh(t / rise_time) - response) ** 2),
        bounds=(0.01, 0.2),
        method='bounded',
    )
    np.testing.assert_allclose(RISE_PERIODS / cutoff, found.x, rtol=2e-3)


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
    q, dq, ddq, load = rng.standard_normal((4, 50, 3))
    got = coupled().torque(q, dq, ddq, load)
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
    q, dq, ddq, load = rng.standard_normal((4, 50, 3))
    got, model = transmitted().torque(q, dq, ddq, load), transmitted()
    shared = 0.2 * dq[:, 2] + 0.3 * np.tanh(dq[:, 2] / 0.1)
    np.testing.assert_allclose(got[:, 1], shared - 0.7 * load[:, 2])
    np.testing.assert_allclose(got[:, 2], 0.5 * dq[:, 2])
    friction = model.torque(q, dq, ddq, np.zeros_like(load))
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
    basis = FrictionBasis(2, tuple(DriveTerm(drive, term) for drive in drives), 0.05)
    model = FrictionModel(basis, np.arange(1.0, basis.size + 1))
    again = FrictionModel.from_json(model.to_json())
    assert again.basis == model.basis
    np.testing.assert_array_equal(again.coefficients, model.coefficients)


ONE = {'joints': [0], 'ratios': [1.0]}
HOSTILE: list[dict[str, object]] = [
    {'term': 'Viscous', 'ratios': [float('nan')]},
    {'term': 'Viscous', 'joints': [float('inf')]},
    {'term': 'Coulomb', 'width': 0.0},
    {'term': 'Coulomb', 'width': float('nan')},
    {'term': 'Coulomb', 'width': 1e300},
    {'term': 'Coulomb', 'width': '1'},
    {'term': 'Coulomb', 'width': True},
    {'term': 'Presliding', 'width': 0.1, 'acceleration': 0.0},
    {'term': 'Stribeck', 'width': 0.1, 'smoothing': -1.0},
    {'term': 'Ripple', 'harmonic': 0.5},
    {'term': 'Ripple', 'harmonic': 10**12},
    {'term': 'LeverSpring', 'eccentricity': 1.0, 'dead_centre': 0.0},
    {'term': 'LeverSpring', 'eccentricity': 0.5, 'dead_centre': float('nan')},
    {'term': 'Dahl', 'width': 0.1, 'displacement': 1e-12},
    {'term': 'Dahl', 'width': 0.1, 'displacement': float('nan')},
    {'term': 'PositionCurve', 'low': 0.0, 'high': 1.0, 'count': 10**12},
    {'term': 'PositionCurve', 'low': 0.0, 'high': 1e-300, 'count': 8},
    {'term': 'VelocityCurve', 'low': 0.0, 'high': float('inf'), 'count': 8},
]
"""Parameters that divide by zero, are none, or take all memory."""


def damaged(**changes: object) -> dict[str, object]:
    return {**coupled().to_json(), **changes}


@pytest.mark.parametrize(
    'entry',
    [
        {},
        damaged(coefficients=[1.0]),
        damaged(rise_time=-1.0),
        damaged(coefficients=['x'] * 4),
        damaged(coefficients=[0.5, -2.0, 0.1, 0.0]),
        damaged(coefficients=[0.5, float('nan'), 0.1, 0.0]),
        damaged(terms=[{'term': 'Magic', 'joints': [0], 'ratios': [1.0]}]),
        damaged(terms=[{'term': 'Viscous', 'joints': [7], 'ratios': [1.0]}]),
        damaged(terms=[{'term': 'Viscous', 'joints': [0], 'ratios': []}]),
        damaged(terms=None),
        damaged(n_joints=float('inf')),
        damaged(coefficients=[0.5, 1e300, 0.1, 0.0]),
        *(damaged(terms=[{**ONE, **changes}]) for changes in HOSTILE),
    ],
)
def test_damaged_files_are_refused_in_a_sentence(entry: dict[str, object]) -> None:
    with pytest.raises(ModelError, match='expected'):
        FrictionModel.from_json(entry)


def test_one_coefficient_per_feature() -> None:
    with pytest.raises(ShapeError, match='one per feature'):
        FrictionModel(coupled().basis, np.zeros(2))


MATHS = Path(__file__).resolve().parents[2] / 'docs' / 'explanation' / 'maths.md'
PLAIN = ('viscous', 'Coulomb', 'offset')


@pytest.mark.parametrize('term', EVERY, ids=lambda term: term.name)
def test_has_a_row_in_the_maths(term: FrictionTerm) -> None:
    text = MATHS.read_text(encoding='utf-8').partition('## 12.')[2].partition('## 13.')[0]
    rows = [line.split('|')[1] for line in text.splitlines() if line.startswith('|')]
    assert term.name in [name.strip() for row in rows for name in row.split(',')]


def test_the_selection_is_offered_every_term() -> None:
    q = np.linspace(-4.0, 4.0, 50)[:, None] * np.ones(2)
    dataset = Dataset.from_arrays(q, q, q, q)
    widths = np.array([0.1, 0.1])
    offered = [*plain_candidates(widths), *candidates(widths, remembering(dataset))]
    offered.append(lever_candidate(0, LeverSpring(0.5, 0.0), []))  # after a search
    names = {part.term.name for each in offered for part in each.terms}
    assert names | {Lag.name} == {term.name for term in EVERY}  # lag: beside links that can exist


def test_exports_are_tested_with_every_kind_of_term() -> None:
    tested = {type(term) for term in EXTRA} | {type(t) for t in EVERY if t.name in PLAIN}
    assert tested == {type(term) for term in EVERY}
