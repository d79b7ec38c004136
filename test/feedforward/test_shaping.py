"""Shaping: whatever the model predicts, what leaves is finite, within limits, and no jump."""

from __future__ import annotations

from collections import Counter
from typing import Any
import warnings

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.feedforward.settings import (
    make_rules,
    Policy,
    require_bounded,
    ServeSettings,
    unbounded,
)
from lip_id_ros.feedforward.shaping import factors, Shaper, TrainingRange
from lip_id_ros.signals.joints import by_joint, RefusedError
from lip_id_ros.signals.torque_steps import LONGEST_TORQUE_STEP_S, Sent

NAMES = ('a', 'b', 'c')
LIMITS = (87.0, 12.0, 0.0)
RATES = (100.0, 1.0, 5.0)
ANY = st.floats(allow_nan=False, allow_infinity=False)
ROWS = arrays(np.float64, (6, 3), elements=ANY)
STILL = np.zeros((3, 3))
STEPS = st.lists(st.floats(0.0, 2.0), min_size=6, max_size=6)


def shaper(counts: Counter[str] | None = None, **settings: Any) -> Shaper:
    chosen = ServeSettings(**{'ramp_s': 0.0, **settings})
    rules = make_rules(chosen, NAMES)
    trained = TrainingRange(STILL, STILL)
    return Shaper(rules, trained, Sent(np.zeros(3)), Counter() if counts is None else counts)


def sampled(stream: Shaper, tau: Array, now: float) -> Array:
    return stream.sample(tau, now, STILL)


def planned(stream: Shaper, tau: Array, t: Array) -> Array:
    return stream.plan(tau, t, np.zeros((3, *tau.shape)))


@given(ROWS, STEPS, st.floats(0.0, 1.0), st.floats(0.0, 3.0))
def test_a_stream_stays_within_limits_and_rates(
    tau: Array, steps: list[float], scale: float, ramp_s: float
) -> None:
    stream = shaper(torque_limits=LIMITS, rate_limits=RATES, output_scale=scale, ramp_s=ramp_s)
    now, before = 0.0, np.zeros(3)
    stream.sent = Sent(before, now)
    stream.begin()
    for row, step in zip(tau, steps, strict=True):
        now += step
        safe = sampled(stream, row, now)
        assert np.isfinite(safe).all()
        assert (np.abs(safe) <= LIMITS).all()
        allowed = np.array(RATES) * min(max(step, 1e-6), LONGEST_TORQUE_STEP_S)
        assert (np.abs(safe - before) <= allowed * (1 + 1e-9) + 1e-9).all()
        before = safe


@given(ROWS, st.floats(0.0, 1.0))
def test_a_plan_stays_within_limits_and_rates(tau: Array, scale: float) -> None:
    t = 0.25 * np.arange(6, dtype=np.float64)
    safe = planned(shaper(torque_limits=LIMITS, rate_limits=RATES, output_scale=scale), tau, t)
    assert (np.abs(safe) <= LIMITS).all()
    assert (np.abs(np.diff(safe, axis=0)) <= 0.25 * np.array(RATES) * (1 + 1e-9) + 1e-9).all()


@given(ROWS, st.floats(0.0, 1.0))
def test_what_is_within_limits_is_scaled_the_rest_counted(tau: Array, scale: float) -> None:
    counts: Counter[str] = Counter()
    safe = planned(shaper(counts, torque_limits=LIMITS, output_scale=scale), tau, np.arange(6.0))
    within = (np.abs(scale * tau) <= LIMITS).all(axis=1)
    np.testing.assert_array_equal(safe[within], scale * tau[within])
    assert counts['limited'] == np.count_nonzero(~within)


def test_a_ramp_leads_from_what_was_sent_to_what_is_asked() -> None:
    stream = shaper(ramp_s=0.1)
    stream.begin()
    asked = np.array([4.0, -8.0, 1.0])
    np.testing.assert_allclose(sampled(stream, asked, 10.0), 0.0)
    np.testing.assert_allclose(sampled(stream, asked, 10.025), 0.25 * asked)
    np.testing.assert_allclose(sampled(stream, asked, 10.075), 0.75 * asked)
    np.testing.assert_allclose(sampled(stream, asked, 10.125), asked)
    stream.begin()
    np.testing.assert_allclose(sampled(stream, -asked, 20.0), asked)
    np.testing.assert_allclose(sampled(stream, -asked, 20.05), 0.0, atol=1e-9)
    np.testing.assert_allclose(sampled(stream, -asked, 20.11), -asked)


def test_a_pause_is_no_step_of_the_ramp() -> None:
    stream = shaper(ramp_s=0.5)
    stream.begin()
    asked = np.array([80.0, -8.0, 1.0])
    np.testing.assert_allclose(sampled(stream, asked, 0.0), 0.0)
    np.testing.assert_allclose(sampled(stream, asked, 0.05), 0.1 * asked)
    np.testing.assert_allclose(sampled(stream, asked, 0.5), 0.2 * asked)
    np.testing.assert_allclose(sampled(stream, asked, 0.55), 0.3 * asked)


def test_narrower_limits_hold_at_once_though_the_rate_is_low() -> None:
    stream = shaper(rate_limits=(1.0,), torque_limits=(50.0,))
    stream.sent = Sent(np.array([40.0, 40.0, 40.0]), 0.0)
    stream.rules = make_rules(ServeSettings(torque_limits=(5.0,), rate_limits=(1.0,)), NAMES)
    np.testing.assert_array_equal(sampled(stream, np.full(3, 40.0), 0.01), 5.0)


@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_torque_that_is_not_finite_is_refused(value: float) -> None:
    tau = np.array([1.0, value, 0.0])
    with pytest.raises(RefusedError, match=r'torque would not be finite'):
        sampled(shaper(torque_limits=LIMITS), tau, 0.0)
    with pytest.raises(RefusedError, match=r'torque would not be finite'):
        planned(shaper(torque_limits=LIMITS), tau[None], np.zeros(1))


def test_no_limits_leave_torques_as_they_are() -> None:
    np.testing.assert_array_equal(sampled(shaper(), np.array([1e9, -3, 0]), 0.0), [1e9, -3, 0])


def test_values_follow_their_joints() -> None:
    def values(given: tuple[float, ...], named: tuple[str, ...]) -> list[float]:
        return list(by_joint('torque_limits', given, named, ('a', 'b'), 7.0))

    assert values((1.0, 2.0), ('b', 'a')) == [2.0, 1.0]
    assert values((1.0, 2.0), ()) == [1.0, 2.0]
    assert values((3.0,), ()) == [3.0, 3.0]
    assert values((), ()) == [7.0, 7.0]


@pytest.mark.parametrize('name', ['torque_limits', 'rate_limits', 'range_margin'])
def test_wrong_number_of_values_gives_one_sentence(name: str) -> None:
    sentence = rf'^{name} must hold one value per joint \(3\).*holds 2: .* of a, b, c\.$'
    with pytest.raises(ConfigError, match=sentence):
        shaper(None, **{name: (1.0, 2.0)})


def test_a_ramp_goes_on_from_its_share_when_its_duration_changes() -> None:
    stream = shaper(ramp_s=0.1)
    stream.begin()
    asked = np.array([4.0, -8.0, 1.0])
    np.testing.assert_allclose(sampled(stream, asked, 0.0), 0.0)
    np.testing.assert_allclose(sampled(stream, asked, 0.05), 0.5 * asked)
    stream.adjust(make_rules(ServeSettings(ramp_s=0.5), NAMES))
    np.testing.assert_allclose(sampled(stream, asked, 0.05), 0.5 * asked)
    np.testing.assert_allclose(sampled(stream, asked, 0.1), 0.6 * asked)
    stream.adjust(make_rules(ServeSettings(ramp_s=0.1), NAMES))
    np.testing.assert_allclose(sampled(stream, asked, 0.12), 0.8 * asked)
    np.testing.assert_allclose(sampled(stream, asked, 0.15), asked)
    stream.adjust(make_rules(ServeSettings(ramp_s=60.0), NAMES))  # the ramp is over
    np.testing.assert_allclose(sampled(stream, asked, 0.15), asked)


@pytest.mark.parametrize(
    'changed',
    [
        {'gravity': False},
        {'output_scale': 0.0},
        {'range_policy': 'zero'},
    ],
)
def test_a_setting_that_changes_torques_is_ramped_to(changed: dict[str, Any]) -> None:
    stream = shaper(ramp_s=0.1)
    before, after = np.full(3, 20.0), np.zeros(3)
    np.testing.assert_array_equal(sampled(stream, before, 0.0), before)
    stream.adjust(make_rules(ServeSettings(**{'ramp_s': 0.1, **changed}), NAMES))
    np.testing.assert_allclose(sampled(stream, after, 1.0), before)
    np.testing.assert_allclose(sampled(stream, after, 1.025), 0.75 * before)
    np.testing.assert_allclose(sampled(stream, after, 1.075), after + 0.25 * before)
    np.testing.assert_allclose(sampled(stream, after, 1.125), after)


def test_rates_are_bounded_by_default_where_limits_are() -> None:
    stream = shaper(torque_limits=(40.0,))
    stream.sent = Sent(np.full(3, -40.0), 0.0)
    np.testing.assert_allclose(sampled(stream, np.full(3, 40.0), 0.01), -32.0)
    now, steps = 0.01, 0
    while not (stream.sent.tau == 40.0).all():
        now, steps = now + 0.01, steps + 1
        sampled(stream, np.full(3, 40.0), now)
    assert steps == 9  # a full swing in 0.1 s


def test_rates_with_which_a_torque_could_not_be_taken_back_are_refused() -> None:
    with pytest.raises(ConfigError, match='rate_limits must be above zero'):
        shaper(torque_limits=(40.0,), rate_limits=(0.0,))


def test_limits_beyond_all_numbers_bound_no_rate() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        rules = make_rules(ServeSettings(torque_limits=(1e308,)), NAMES)
    assert np.isinf(rules.rates).all()


def test_a_missing_bound_is_warned_of() -> None:
    assert unbounded(ServeSettings(torque_limits=(1.0,))) is None
    both = 'torques are not limited, and neither are their steps'
    assert unbounded(ServeSettings()) == both
    assert unbounded(ServeSettings(torque_limits=(1.0,), torque_limits_from='none')) == both
    assert unbounded(ServeSettings(rate_limits=(1.0,))) == 'torques are not limited'


def test_limits_of_an_active_node_are_changed_not_removed() -> None:
    before = make_rules(ServeSettings(torque_limits=(5.0,)), NAMES)
    require_bounded(ServeSettings(torque_limits=(9.0,)), before, NAMES)
    for source, sentence in (
        ('parameters', 'must hold the largest'),
        ('none', 'not removed while'),
        ('robot_description', 'deactivate the node first'),
    ):
        with pytest.raises(ConfigError, match=rf'torque_limits.* .*{sentence}'):
            require_bounded(ServeSettings(torque_limits_from=source), before, NAMES)
    before = make_rules(ServeSettings(torque_limits_from='none', rate_limits=(9.0,)), NAMES)
    with pytest.raises(ConfigError, match=r'rate_limits .*not removed'):
        require_bounded(ServeSettings(torque_limits_from='none'), before, NAMES)


def test_limits_that_are_still_to_be_read_let_no_torque_out() -> None:
    rules = make_rules(ServeSettings(torque_limits_from='robot_description'), NAMES)
    assert (rules.limits == 0.0).all()


BOX = TrainingRange(np.array([[-1.0, 0.0]] * 3), np.array([[1.0, 4.0]] * 3))


@given(arrays(np.float64, (3, 5, 2), elements=st.integers(-99, 99).map(lambda k: k / 10)))
def test_excess_is_above_one_outside_and_only_there(states: Array) -> None:
    inside = ((states >= [-1.0, 0.0]) & (states <= [1.0, 4.0])).all(axis=(0, 2))
    excess = BOX.excess(states)
    np.testing.assert_array_equal(excess <= 1.0 + 1e-12, inside)
    for column in range(5):
        assert BOX.excess(states[:, column]) == excess[column]


def test_a_margin_widens_the_range_of_its_joint() -> None:
    states = np.array([[0.0, 4.4], [0.0, 2.0], [0.0, 2.0]])
    assert BOX.excess(states) == pytest.approx(1.2)
    assert BOX.widened(np.array([0.0, 0.5])).excess(states) == pytest.approx(0.8)
    assert BOX.widened(np.array([0.5, 0.0])).excess(states) == pytest.approx(1.2)


def test_the_known_range_stays_the_same_however_often_settings_change() -> None:
    settings = ServeSettings(range_policy='zero', range_margin=(0.5,), ramp_s=0.0)
    rules, counts = make_rules(settings, NAMES), Counter[str]()
    trained = TrainingRange(-np.ones((3, 3)), np.ones((3, 3)))
    stream, tau = Shaper(rules, trained, Sent(np.zeros(3)), counts), np.ones(3)
    for _ in range(3):
        stream.adjust(rules)
    np.testing.assert_array_equal(stream.sample(tau, 0.0, np.full((3, 3), 1.4)), tau)
    assert not stream.sample(tau, 0.1, np.full((3, 3), 1.6)).any()
    assert counts['out_of_range'] == 1


def test_a_joint_that_did_not_move_may_not_move() -> None:
    still = TrainingRange(np.full((3, 1), 0.5), np.full((3, 1), 0.5))
    assert still.excess(np.full((3, 1), 0.5)) == 0.0
    assert still.excess(np.full((3, 1), 0.6)) > 2.0


@pytest.mark.parametrize(
    ('policy', 'expected'),
    [
        (Policy.WARN, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
        (Policy.SCALE, [1.0, 1.0, 0.75, 0.0, 0.0, 0.0]),
        (Policy.ZERO, [1.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
    ],
)
def test_policies(policy: Policy, expected: list[float]) -> None:
    counts: Counter[str] = Counter()
    excess = np.array([0.0, 1.0, 1.25, 3.0, np.inf, np.nan])
    np.testing.assert_array_equal(factors(policy, excess, counts, 'far'), expected)
    assert counts == {'far': 4}
