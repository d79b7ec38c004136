"""Friction terms: their formulas, that they never drive a joint, and that files keep them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from export.arms import EXTRA
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ModelError, ShapeError
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.conservative_terms import (
    lever_shape,
    lever_spring,
    position_curve,
    ripple,
    spring,
    velocity_curve,
)
from lip_id_ros.friction.drives import Drive, DriveTerm, KINDS
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import (
    asymmetric,
    coulomb,
    dahl,
    FREE,
    lag,
    load_coulomb,
    load_torque,
    load_viscous,
    offset,
    position_coulomb,
    presliding,
    quadratic,
    saturating,
    shared_friction,
    sign_width,
    stribeck,
    Term,
    viscous,
)
from lip_id_ros.identification.friction_candidates import (
    candidates,
    lever_candidate,
    plain_candidates,
    RISE_PERIODS,
)
from lip_id_ros.identification.sample_selection import remembering
from lip_id_ros.joint_types import DISPLACEMENTS, JointHistory
from lip_id_ros.preprocessing.smoothing import low_pass

EVERY: list[Term] = [
    viscous(),
    lag(),
    coulomb(0.1),
    offset(),
    stribeck(0.05),
    stribeck(0.03, 0.02),
    saturating(0.05),
    quadratic(),
    load_coulomb(0.1),
    load_viscous(),
    presliding(0.1, 2.0),
    asymmetric(0.1),
    position_coulomb(0.1),
    ripple(1),
    ripple(2),
    spring(),
    lever_spring(0.6, 0.4),
    position_curve(-1.0, 2.0, 8),
    velocity_curve(-0.5, 1.0, 6),
    dahl(0.1, 1e-3),
    load_torque(),
    shared_friction(0.1),
]
SHAPES: list[Term] = [sign_width(0.1), lever_shape(0.6, 0.4)]
DISSIPATIVE = [
    term for term in EVERY if FREE not in term.lower and term.kind not in (presliding, lag)
]
RISE_TIME = 0.05
finite = st.floats(-20.0, 20.0)


class State(NamedTuple):
    """State of one drive at N samples, each of shape (N,)."""

    q: Array
    dq: Array
    ddq: Array
    load: Array

    def sign(self, width: float) -> Array:
        return np.asarray(np.tanh(self.dq / np.hypot(width, RISE_TIME * self.ddq)))


def lever_features(q: Array, eccentricity: float, dead_centre: float) -> Array:
    sine, cosine = np.sin(q - dead_centre), np.cos(q - dead_centre)
    return np.column_stack([sine / np.sqrt(1.0 - eccentricity * cosine), sine])


def steps(x: Array, low: float, high: float, count: int) -> list[Array]:
    breadth = 0.75 * (high - low) / (count - 1)
    return [np.tanh((x - centre) / breadth) for centre in np.linspace(low, high, count)]


def peaks(x: State, width: float, smoothing: float) -> list[Array]:
    narrow = np.hypot(width, smoothing)
    return [x.sign(narrow) - x.sign(times * narrow) for times in (3.0, 10.0, 30.0)]


def one_way(x: State, width: float) -> list[Array]:
    both = x.dq, x.sign(width)
    return [way(each, 0.0) for way in (np.maximum, np.minimum) for each in both]


def by_width(x: State, width: float) -> list[Array]:
    return [(x.sign(width * np.exp(0.01)) - x.sign(width * np.exp(-0.01))) / 0.02]


def by_shape(x: State, e: float, centre: float) -> list[Array]:
    h = 1e-4
    shorter, longer = (lever_features(x.q, e + k, centre) for k in (-h, h))
    earlier, later = (lever_features(x.q, e, centre + k) for k in (-h, h))
    return [each / (2.0 * h) for each in ((longer - shorter)[:, 0], *(later - earlier).T)]


FORMULAS: dict[Callable[..., Term], Callable[..., list[Array]]] = {
    viscous: lambda x: [x.dq],
    lag: lambda x: [-x.ddq],
    coulomb: lambda x, width: [x.sign(width)],
    offset: lambda x: [1.0 + 0.0 * x.q],
    stribeck: peaks,
    saturating: lambda x, width: [x.sign(times * width) for times in (3.0, 10.0, 30.0)],
    quadratic: lambda x: [x.dq * np.abs(x.dq)],
    load_coulomb: lambda x, width: [np.abs(x.load) * x.sign(width)],
    load_viscous: lambda x: [np.abs(x.load) * x.dq],
    presliding: lambda x, width, size: [-np.tanh(x.ddq / size) * (1.0 - x.sign(width) ** 2)],
    asymmetric: one_way,
    position_coulomb: lambda x, width: [
        x.sign(width) * (1.0 + np.cos(x.q - phase)) for phase in 0.5 * np.pi * np.arange(4)
    ],
    ripple: lambda x, often: [np.cos(often * x.q), np.sin(often * x.q)],
    spring: lambda x: [x.q],
    lever_spring: lambda x, e, centre: list(lever_features(x.q, e, centre).T),
    position_curve: lambda x, *shape: steps(x.q, *shape),
    velocity_curve: lambda x, *shape: steps(x.dq, *shape),
    dahl: lambda x, width, displacement: [0.0 * x.q],
    load_torque: lambda x: [x.load],
    shared_friction: lambda x, width: [x.dq, x.sign(width)],
    sign_width: by_width,
    lever_shape: by_shape,
}


def name(term: Term) -> str:
    return term.name


def states(n_samples: int = 200) -> State:
    rng = np.random.default_rng(0)
    sizes = np.array([[2.0], [1.0], [3.0], [30.0]])
    q, dq, ddq, load = rng.standard_normal((4, n_samples)) * sizes
    dq[:5] = 0.0
    return State(q, dq, ddq, load)


def features_of(term: Term, state: State, rise_time: float = RISE_TIME) -> Array:
    basis = FrictionBasis(1, one_drive(term).terms, rise_time)
    q, dq, ddq, load = np.array(state)[..., None]
    return basis.values(q, dq, ddq, load)


def test_every_term_is_tested() -> None:
    assert {term.kind for term in EVERY} == set(KINDS.values())


@pytest.mark.parametrize('term', [*EVERY, *SHAPES], ids=name)
def test_features_are_those_of_the_formulas(term: Term) -> None:
    state = states()
    expected = np.column_stack(FORMULAS[term.kind](state, *term.parameters.values()))
    np.testing.assert_allclose(features_of(term, state), expected, rtol=1e-12, atol=1e-11)
    assert len(term.lower) == expected.shape[1]


def test_dahl_friction_is_the_difference_of_its_state_to_the_sign() -> None:
    """Of a motor that turns the other way, with the sign that the low-pass makes."""
    state, rng = states(), np.random.default_rng(1)
    drive = Drive((0,), (-2.0,), (1.0,))
    terms = DriveTerm(drive, dahl(0.1, 1e-3)), DriveTerm(drive, coulomb(0.1))
    basis, (q, dq, ddq, load) = FrictionBasis(1, terms, RISE_TIME), np.array(state)[..., None]
    sign, memory = rng.standard_normal((200, 1)), rng.uniform(-1.0, 1.0, (200, 1, 5))
    history = JointHistory(sign, memory)
    found, smooth = basis.values(q, dq, ddq, load, history).T
    np.testing.assert_allclose(found, memory[:, 0, DISPLACEMENTS.index(1e-3)] - smooth)


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
    lever = lever_spring(eccentricity, centre)
    force, stiffness = features_of(lever, states(q.size)._replace(q=q)).T
    half = 0.5 * square * eccentricity
    torque = half * (stiffness - rest / np.sqrt(square) * force)
    slope = (energy(q + h) - energy(q - h)) / (2.0 * h)
    np.testing.assert_allclose(torque, slope, atol=1e-9)


def test_levers_have_their_shapes() -> None:
    term = lever_spring(0.6, 0.4)
    model = FrictionModel(one_drive(term), np.array([2.0, -3.0])).with_shapes()
    assert model.basis.size == 5
    assert model.shape_std.shape == (3,)


def one_drive(term: Term) -> FrictionBasis:
    return FrictionBasis(1, (DriveTerm(Drive.of_joint(0), term),))


@pytest.mark.parametrize('term', EVERY, ids=name)
def test_which_features_depend_on_the_load(term: Term) -> None:
    state = states()
    other = state._replace(load=2.0 * state.load)
    changes = (features_of(term, state) != features_of(term, other)).any(axis=0)
    np.testing.assert_array_equal(one_drive(term).is_loaded, changes)


@pytest.mark.parametrize('term', DISSIPATIVE, ids=name)
@given(state=st.tuples(*[finite] * 4))
def test_no_feature_drives_a_joint(term: Term, state: tuple[float, ...]) -> None:
    features, dq = features_of(term, State(*np.array(state)[:, None])), state[1]
    assert np.all(features * dq >= -1e-14)  # sums of waves round


def test_presliding_friction_works_for_nothing_over_a_reversal() -> None:
    """It opposes the motion less after the reversal by as much as more before it."""
    t = np.linspace(-1.0, 1.0, 2001)
    for ddq in 3.0, -3.0:
        still = np.zeros_like(t)
        state = State(0.5 * ddq * t**2, ddq * t, np.full_like(t, ddq), still)
        power = features_of(presliding(0.1, 2.0), state)[:, 0] * state.dq
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
    state = State(0.0 * t, ddq * t, np.full_like(t, ddq), 0.0 * t)
    filtered = low_pass(np.sign(state.dq), rate, cutoff)
    near = np.abs(t) < 0.5 / cutoff
    smooth, sharp = (
        features_of(coulomb(1e-3), state, rise_time)[:, 0]
        for rise_time in (RISE_PERIODS / cutoff, 0.0)
    )
    assert np.std((smooth - filtered)[near]) < 0.11
    assert np.std((sharp - filtered)[near]) > 0.35


def test_a_narrow_sign_is_the_low_passed_one_where_that_is_known() -> None:
    """A wide one is not that of the samples; what the low-pass does not widen stays as it is."""
    rate, cutoff, rise_time = 200.0, 4.0, RISE_PERIODS / 4.0
    t = np.arange(2000.0) / rate
    q, dq, ddq = np.sin(3.0 * t), 3.0 * np.cos(3.0 * t), -9.0 * np.sin(3.0 * t)
    motion = q[:, None], dq[:, None], ddq[:, None], np.zeros((t.size, 1))
    sign = low_pass(np.sign(motion[1]), rate, cutoff)
    inside = (np.abs(ddq) > 0.1) & (t > 0.5) & (t < 9.5)
    for width, most in (1e-4, 1e-5), (0.1, 0.01), (0.3, 0.03):
        terms = (DriveTerm(Drive((0,), (-2.0,), (1.0,)), coulomb(width)),)
        basis = FrictionBasis(1, terms, rise_time)
        known, steady = basis.values(*motion, JointHistory(sign)), basis.values(*motion)
        assert np.abs(known + sign)[inside].max() < most
        assert np.abs(steady + sign)[inside].max() > 0.14
    unfiltered = FrictionBasis(1, terms)
    np.testing.assert_array_equal(
        unfiltered.values(*motion, JointHistory(sign)), unfiltered.values(*motion)
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
        DriveTerm(Drive.of_joint(0), viscous()),
        DriveTerm(Drive((2, 1), (1.0, -1.0)), coulomb(0.1)),
        DriveTerm(Drive.of_joint(1), load_coulomb(0.2)),
        DriveTerm(Drive.of_joint(1), offset()),
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
    own = DriveTerm(Drive.of_joint(2), viscous())
    drive = Drive.transmitted(2, to=1)
    terms = own, DriveTerm(drive, load_torque()), DriveTerm(drive, shared_friction(0.1))
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
def test_a_file_keeps_the_term(term: Term) -> None:
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
def test_has_a_row_in_the_maths(term: Term) -> None:
    text = MATHS.read_text(encoding='utf-8').partition('## 12.')[2].partition('## 13.')[0]
    rows = [line.split('|')[1] for line in text.splitlines() if line.startswith('|')]
    assert term.name in [name.strip() for row in rows for name in row.split(',')]


def test_the_selection_is_offered_every_term() -> None:
    q = np.linspace(-4.0, 4.0, 50)[:, None] * np.ones(2)
    dataset = Dataset.from_arrays(q, q, q, q)
    widths = np.array([0.1, 0.1])
    offered = [*plain_candidates(widths), *candidates(widths, remembering(dataset))]
    offered.append(lever_candidate(0, lever_spring(0.5, 0.0), []))  # after a search
    names = {part.term.name for each in offered for part in each.terms}
    # lag: beside links that can exist
    assert names | {lag().name} == {term.name for term in EVERY}


def test_exports_are_tested_with_every_kind_of_term() -> None:
    tested = {term.kind for term in EXTRA} | {t.kind for t in EVERY if t.name in PLAIN}
    assert tested == {term.kind for term in EVERY}
