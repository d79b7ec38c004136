"""Updates are followed within bounds, torques are blended, and the fit comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from adaptation.arms import known_model, message_of, stream, with_friction
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from model.models import random_model
import numpy as np
import pytest

from lip_id_ros.adaptation.adapted_model import AdaptedModel
from lip_id_ros.adaptation.follow_settings import FollowRules
from lip_id_ros.adaptation.followed import FollowedArm, WalkSettings
from lip_id_ros.adaptation.updates import Update
from lip_id_ros.arrays import Array
from lip_id_ros.model import InverseDynamicsModel, Query
from lip_id_ros.signals.joints import Refusal, RefusedError

RULES = FollowRules(blend_s=1.0, timeout_s=5.0, limits=np.full(3, 5.0))
STATE = np.array([[0.3, -0.4, 0.5], [1.0, -0.8, 0.6], [0.5, 1.0, -2.0]])
STEP_S, START_NS = 0.02, 10**18


def numbers_of(model: InverseDynamicsModel) -> Array:
    assert model.arm is not None
    return np.concatenate([model.arm.links.ravel(), model.arm.friction.coefficients])


def update_to(model: InverseDynamicsModel) -> Update:
    """Return an update of the known model that makes another of it."""
    return Update(known_model().fingerprint, numbers_of(model), True, '/adapt')


def take(adapted: AdaptedModel, update: Update, now: float, age: float = 0.0) -> None:
    """Have an update followed that was stamped so long ago [s]."""
    clock_ns = START_NS + round(1e9 * now)
    stamped = replace(update, stamp_ns=clock_ns - round(1e9 * age))
    adapted.take(message_of(stamped), now, clock_ns)


def assert_same(found: Query, expected: Query) -> None:
    for name in Query._fields:
        values = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(*values, rtol=1e-9, atol=1e-12)


def torques(adapted: AdaptedModel, seconds: float, start: float) -> Array:
    """Return torques of one state over a time."""
    times = start + np.arange(0.0, seconds, STEP_S)
    return np.array([adapted.query(STATE, t).tau for t in times])


def test_without_an_update_it_is_the_commissioned_model() -> None:
    model = known_model()
    adapted = AdaptedModel(model, RULES)
    assert_same(adapted.query(STATE, 0.0), model.query(*STATE))
    assert adapted.newest is model
    assert adapted.numbers is None


def test_torques_blend_to_an_update_and_back_when_updates_stop() -> None:
    model, other = known_model(), with_friction(known_model(), 0.6)
    adapted = AdaptedModel(model, RULES)
    adapted.query(STATE, 0.0)
    take(adapted, update_to(other), 0.0)
    before, after = model.query(*STATE).tau, other.query(*STATE).tau
    tau = torques(adapted, 1.2, 0.0)
    np.testing.assert_allclose(tau[0], before, atol=1e-12)
    np.testing.assert_allclose(tau[25], 0.5 * (before + after), rtol=1e-9)
    np.testing.assert_allclose(tau[-1], after, rtol=1e-12)
    steps = np.abs(np.diff(tau, axis=0))
    assert (steps <= 1.001 * STEP_S * np.abs(after - before) + 1e-12).all()
    adapted.watch(4.9)
    assert adapted.values()['model'] == 'adapted'
    adapted.watch(5.1)
    assert adapted.values()['model'] == 'commissioned'
    assert adapted.values()['why'] == 'no update for 5 s'
    tau = torques(adapted, 1.2, 1.2)
    assert (np.abs(np.diff(tau, axis=0)) <= 1.001 * STEP_S * np.abs(after - before)).all()
    np.testing.assert_allclose(tau[-1], before, rtol=1e-12)
    take(adapted, update_to(other), 8.0)  # a counter begins anew after that
    assert adapted.values()['model'] == 'adapted'


def test_an_update_amid_a_blend_makes_no_jump() -> None:
    model = known_model()
    adapted = AdaptedModel(model, RULES)
    adapted.query(STATE, 0.0)
    take(adapted, update_to(with_friction(model, 0.6)), 0.0)
    before = torques(adapted, 0.5, 0.0)[-1]
    take(adapted, update_to(with_friction(model, 1.5)), 0.5)
    np.testing.assert_allclose(adapted.query(STATE, 0.48).tau, before, rtol=1e-9)


def test_parts_and_energies_are_blended_too() -> None:
    model, other = known_model(), with_friction(known_model(), 0.6)
    adapted = AdaptedModel(model, replace(RULES, blend_s=2 * STEP_S))
    adapted.advance(0.0)
    take(adapted, update_to(other), 0.0)
    adapted.advance(STEP_S)
    found = adapted.predict(*STATE[:, None])
    parts = [each.predict(*STATE[:, None]) for each in (model, other)]
    for name in ('tau', 'friction', 'gravity', 'kinetic', 'potential'):
        expected = 0.5 * sum(getattr(each, name) for each in parts)
        np.testing.assert_allclose(getattr(found, name), expected, rtol=1e-9)


def test_friction_that_remembers_goes_on_through_an_update() -> None:
    model = known_model(memory=True)
    other = with_friction(model, 0.8)
    data = stream(model, 10.0)
    adapted = AdaptedModel(model, replace(RULES, blend_s=0.0))
    half = data.t.size // 2
    update = Update(model.fingerprint, numbers_of(other), True)
    found = []
    for k, (t, q, dq, ddq) in enumerate(zip(*data[:4], strict=True)):
        if k == half:
            take(adapted, update, t)
        found.append(adapted.query(np.stack([q, dq, ddq]), t).tau)
    whole = np.array(found)
    state = data.q, data.dq, data.ddq, data.t
    np.testing.assert_allclose(whole[:half], model.predict(*state).tau[:half], atol=1e-9)
    expected = other.predict(*state).tau
    np.testing.assert_allclose(whole[half + 1 :], expected[half + 1 :], atol=1e-9)


def foreign(update: Update) -> Update:
    return replace(update, model='b' * 64)


def of_another_node(update: Update) -> Update:
    return replace(update, source='/other/adapt')


def cut(update: Update) -> Update:
    return replace(update, numbers=update.numbers[1:])


def impossible(update: Update) -> Update:
    numbers = update.numbers.copy()
    numbers[22] = -1.0  # a mass
    return replace(update, numbers=numbers)


def driving(update: Update) -> Update:
    numbers = update.numbers.copy()
    numbers[-9] = -0.1  # viscous friction
    return replace(update, numbers=numbers)


def heavy(update: Update) -> Update:
    numbers = update.numbers.copy()
    numbers[22:32] *= 100.0
    return replace(update, numbers=numbers)


@pytest.mark.parametrize(
    ('spoil', 'reason'),
    [
        (foreign, Refusal.OTHER_MODEL),
        (of_another_node, Refusal.OTHER_SOURCE),
        (cut, Refusal.NO_UPDATE),
        (impossible, Refusal.IMPOSSIBLE_ARM),
        (driving, Refusal.BEYOND_TRUST),
        (heavy, Refusal.BEYOND_TRUST),
    ],
)
def test_an_update_that_is_not_to_be_followed_is_refused_and_counted(
    spoil: Callable[[Update], Update], reason: Refusal
) -> None:
    model = known_model()
    other = with_friction(model, 0.9)
    adapted = AdaptedModel(model, RULES)
    take(adapted, update_to(other), 0.0)
    with pytest.raises(RefusedError) as refused:
        take(adapted, spoil(update_to(other)), 1.0)
    assert refused.value.reason is reason
    assert adapted.values()['refused'] == {reason.value: 1}
    np.testing.assert_array_equal(adapted.numbers, numbers_of(other))
    assert adapted.values()['received'] == 2


def test_what_adapt_follows_at_most_is_followed_where_a_low_pass_softened_friction() -> None:
    model = known_model().with_rise_time(0.05)
    arm = FollowedArm(model, WalkSettings())
    numbers = numbers_of(model)
    numbers[arm.friction] = arm.bounds[1][-numbers[arm.friction].size :]
    adapted = AdaptedModel(model, replace(RULES, limits=np.full(3, np.inf)))
    take(adapted, Update(model.fingerprint, numbers, True), 0.0)
    assert adapted.values()['model'] == 'adapted'


def test_an_update_that_is_not_trusted_brings_the_commissioned_model_back() -> None:
    model = known_model()
    adapted = AdaptedModel(model, RULES)
    good = update_to(with_friction(model, 0.9))
    take(adapted, good, 0.0)
    assert adapted.newest is not model
    take(adapted, replace(good, trusted=False, numbers=numbers_of(model)), 1.0)
    assert adapted.newest is model
    counted = {key: adapted.values()[key] for key in ('followed', 'untrusted')}
    assert counted == {'followed': 1, 'untrusted': 1}


def test_what_is_no_longer_followed_goes_back() -> None:
    model = known_model()
    adapted = AdaptedModel(model, RULES)
    take(adapted, update_to(with_friction(model, 0.9)), 0.0)
    adapted.adjust(replace(RULES, follows=False))
    assert adapted.newest is model


@pytest.mark.parametrize('kind', ['articulated', 'known', 'memory'])
def test_torques_and_energies_are_those_of_a_model_with_the_numbers(kind: str) -> None:
    fitted = random_model(kind) if kind == 'articulated' else known_model(kind == 'memory')
    adapted = AdaptedModel(fitted, replace(RULES, limits=np.full(fitted.n_joints, 10.0)))
    numbers = numbers_of(fitted)
    numbers *= np.repeat([1.1, 0.8], [11 * fitted.n_joints, len(numbers) - 11 * fitted.n_joints])
    state = np.random.default_rng(0).uniform(-0.5, 0.5, (3, fitted.n_joints))
    adapted.advance(0.0)
    adapted.use(numbers)
    for t in np.arange(0.0, 2.0, STEP_S):
        adapted.advance(t)
    model = adapted.newest
    assert_same(adapted.query(state, 9.0, False), model.query(*state))
    rows = state[:, None]
    for name in ('tau', 'inertial', 'coriolis', 'gravity', 'friction', 'kinetic', 'potential'):
        found = getattr(adapted.predict(*rows), name)
        np.testing.assert_allclose(found, getattr(model.predict(*rows), name), rtol=1e-9)
    assert np.abs(model.query(*state).tau - fitted.query(*state).tau).max() > 0.1


def test_an_old_update_is_not_followed_nor_one_of_a_clock_that_is_ahead() -> None:
    """The payload of a latched update may have been put down since."""
    model = known_model()
    adapted, update = AdaptedModel(model, RULES), update_to(with_friction(model, 0.9))
    for age in (47.0, -47.0):
        with pytest.raises(RefusedError) as refused:
            take(adapted, update, 0.0, age)
        assert refused.value.reason is Refusal.OLD_UPDATE
    take(adapted, update, 0.0, 4.0)
    adapted.watch(0.9)
    assert adapted.values()['model'] == 'adapted'
    adapted.watch(1.1)
    assert adapted.values()['model'] == 'commissioned'


def test_updates_are_followed_in_the_order_of_their_stamps() -> None:
    model = known_model()
    adapted = AdaptedModel(model, RULES)
    take(adapted, update_to(with_friction(model, 0.9)), 1.0)
    with pytest.raises(RefusedError) as refused:
        take(adapted, update_to(with_friction(model, 0.8)), 1.1, 0.2)
    assert refused.value.reason is Refusal.NOT_NEWER_UPDATE


def test_an_update_that_never_comes_is_told() -> None:
    adapted = AdaptedModel(known_model(), RULES)
    adapted.watch(10.0)
    assert adapted.take_new_trouble() == ''
    adapted.watch(15.1)
    sentence = 'follows the commissioned model: no update for 5 s; start adapt, or set '
    assert adapted.take_new_trouble().startswith(sentence)
    assert adapted.values()['gone_back'] == 0
    adapted.adjust(replace(RULES, follows=False))
    adapted.watch(30.0)
    assert adapted.take_new_trouble() == ''


FINITE = st.floats(allow_nan=False, allow_infinity=False)
GOOD = Update('a' * 64, np.arange(4.0), True, '/adapt', 5)


@given(arrays(np.float64, st.integers(0, 20), elements=FINITE), st.booleans())
def test_an_update_reads_back_exactly(numbers: np.ndarray, trusted: bool) -> None:
    update = Update('hash', numbers, trusted, '/left/adapt', 10**18 + 1)
    found = Update.from_message(message_of(update))
    np.testing.assert_array_equal(found.numbers, numbers)
    assert (found.model, found.trusted) == ('hash', trusted)
    assert (found.source, found.stamp_ns) == ('/left/adapt', 10**18 + 1)


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'interface_groups': []}, Refusal.NO_UPDATE),
        ({'interface_groups': ['a', 'b']}, Refusal.NO_UPDATE),
        ({'interface_values': []}, Refusal.NO_UPDATE),
        ({'interface_names': ['position']}, Refusal.NO_UPDATE),
        ({'values': [1.0]}, Refusal.NO_UPDATE),
        ({'values': [1.0, 0.0, 1.0, np.nan, 3.0]}, Refusal.NOT_FINITE_UPDATE),
        ({'values': [np.inf, 0.0, 1.0, 2.0, 3.0]}, Refusal.NOT_FINITE_UPDATE),
    ],
)
def test_what_is_no_update_is_refused(changes: dict[str, Any], reason: Refusal) -> None:
    message = message_of(GOOD)
    for name, value in changes.items():
        holds = message if hasattr(message, name) else message.interface_values[0]
        setattr(holds, name, value)
    with pytest.raises(RefusedError) as refused:
        Update.from_message(message)
    assert refused.value.reason is reason
