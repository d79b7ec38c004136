"""What `serve` does with a message, without ROS."""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any

from adaptation.arms import known_model, message_of, with_friction
from feedforward.arms import arm, NAMES, point, Sum
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.adaptation.adapted_model import AdaptedModel
from lip_id_ros.adaptation.follow_settings import FollowRules
from lip_id_ros.adaptation.updates import Update
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.refinement import STEP_S
from lip_id_ros.feedforward.served_arm import EARLY_S
from lip_id_ros.feedforward.server import Server
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.model import EffortCalibration
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joints import Refusal, RefusedError
from lip_id_ros.signals.status import Level

POINT = point([1, 2], [3, 4], [5, 6])
TAU = np.array([531.0, 642.0])  # of POINT
PLAIN: dict[str, Any] = {
    'ramp_s': 0.0,
    'safe_ramp_s': 0.0,
    'rate_limits': (1e9,),
    'refine_plans': False,
}


def serving(**settings: Any) -> Server:
    server = Server()
    server.use(arm(), ServeSettings(**{**PLAIN, **settings}))
    server.enable()
    return server


def counted(server: Server) -> dict[str, int]:
    keys = ('limited', 'rate_limited', 'out_of_range', 'stale')
    return {key: server.values()[key] for key in keys if server.values()[key]}


def test_sample_is_answered_in_the_order_of_the_model() -> None:
    server = serving(torque_limits=[1000.0, 600.0])
    answer = server.sample(['b', 'tool', 'a'], [point([2, 9, 1], [4, 9, 3], [6, 9, 5])], 0.0)
    np.testing.assert_array_equal(answer.tau, [531.0, 600.0])
    assert answer.query.kinetic == 25.0
    assert server.values()['answered'] == {'samples': 1, 'plans': 0, 'measured': 0}
    assert counted(server) == {'limited': 1}


def test_a_model_that_is_served_again_begins_as_it_was_commissioned() -> None:
    """As after a deactivation: the update before it may be hours old."""
    model, changed = known_model(), with_friction(known_model(), 1.5)
    assert changed.arm is not None
    numbers = np.concatenate([changed.arm.links.ravel(), changed.arm.friction.coefficients])
    adapted = AdaptedModel(model, FollowRules(0.1, 5.0, np.full(3, 5.0)))
    loaded = LoadedModel(model, EffortCalibration.identity(3), adapted=adapted)
    settings = ServeSettings(**PLAIN, torque_limits=(1e3,), follow_adaptation=True)
    server, torques = Server(), []
    state = point([0.3, -0.4, 0.5], [1.0, -0.8, 0.6], [0.0, 0.0, 0.0])
    for start in (0.0, 3600.0):
        server.use(loaded, settings)
        server.enable()
        torques.append(server.sample(model.joint_names, [state], start).tau)
        server.take_update(message_of(Update(model.fingerprint, numbers, True)), start, 0)
        for k in range(4):
            last = server.sample(model.joint_names, [state], start + 0.1 * k)
        torques.append(last.tau)
        server.release()
    assert np.abs(torques[1] - torques[0]).min() > 0.1
    np.testing.assert_allclose(torques[2], torques[0])
    np.testing.assert_allclose(torques[3], torques[1])


def test_novelty_is_that_of_the_last_sample() -> None:
    """The one training state is zero, and left-out ones were at a distance of two."""
    server = serving()
    assert server.values()['novelty'] is None
    server.sample(['b', 'a'], [point([3, 2], [0, 0], [0, 0])], 0.0)
    server.sample(['b', 'a'], [point([0, 6], [8, 0], [0, 0])], 0.1)
    assert server.values()['novelty'] == 5.0
    server.sample(['b', 'a'], [point([0, 1e200], [0, 0], [0, 0])], 0.2)
    assert server.values()['novelty'] is None
    server.use(replace(arm(), known_states=None), ServeSettings(**PLAIN))
    assert server.values()['novelty'] is None


def test_plan_is_answered_in_the_order_of_its_message() -> None:
    server = serving(torque_limits=[1000.0, 600.0])
    plan = [point([2, 1], [4, 3], [6, 5]), point([0, 1], [0, 0], [0, 0], 1.0)]
    tau = server.plan(['b', 'a'], plan, 0.0).tau
    np.testing.assert_array_equal(tau, [[600.0, 531.0], [0.0, 1.0]])
    assert server.values()['answered'] == {'samples': 0, 'plans': 1, 'measured': 0}


def rest_to_rest(scale: float = 1.0) -> list[Any]:
    """One segment of degree 5, whose acceleration of up to 5.8 rad/s^2 is between its points."""
    return [point([0, 0], [0, 0], [0, 0]), point([1, 0], [0, 0], [0, 0], scale)]


def duration(server: Server, plan: list[Any]) -> float:
    return float(server.plan(NAMES, plan, 0.0).plan.t[-1])


def test_a_plan_beyond_limits_is_refused_where_that_is_asked_for() -> None:
    server = serving(torque_limits=[500.0], overload_policy='refuse')
    with pytest.raises(RefusedError, match='would exceed torque_limits'):
        server.plan(NAMES, rest_to_rest(), 0.0)
    assert server.values()['refused'] == {Refusal.BEYOND_LIMITS: 1}
    assert duration(server, rest_to_rest(1.2)) == 1.2
    assert server.values()['slowed'] == 0


def test_a_plan_beyond_limits_is_slowed_where_that_is_asked_for() -> None:
    server = serving(torque_limits=[500.0], overload_policy='slow')
    slower = duration(server, rest_to_rest())
    assert 1.05 < slower < 1.2
    assert duration(server, rest_to_rest(1.001 * slower)) == pytest.approx(1.001 * slower)
    assert server.values()['slowed'] == 1
    heavy = [point([600, 0], [0, 0], [0, 0]), point([601, 0], [0, 0], [0, 0], 1.0)]
    with pytest.raises(RefusedError, match='found no slower plan that fits'):
        server.plan(NAMES, heavy, 0.0)


def test_limits_hold_on_the_way_to_the_first_point() -> None:
    """Of 1 rad in 0.5 s from an arm at rest, 12 rad/s^2 at once."""
    goal = [point([1, 0], [0, 0], [], 0.5)]
    for policy in ('refuse', 'slow'):
        server = serving(torque_limits=[500.0], overload_policy=policy)
        assert duration(server, goal) == 0.5  # nobody knows from where
        assert server.measure(joint_state([0.0, 0.0]), 0.0)
        if policy == 'refuse':
            with pytest.raises(RefusedError, match='would exceed torque_limits'):
                server.plan(NAMES, goal, 0.1)
        else:
            found = server.plan(NAMES, goal, 0.1)
            assert found.plan.t[-1] > 1.0
            assert found.plan.t[0] == pytest.approx(EARLY_S * found.plan.t[-1] / 0.5)


def test_limits_hold_for_torques_at_the_speed_of_the_controller() -> None:
    server = serving(torque_limits=[500.0], overload_policy='slow')
    for speed in (0.5, 1.0, 2.0):
        found = server.plan(NAMES, rest_to_rest(), 0.0, speed=speed)
        assert found.plan.t[-1] == pytest.approx(max(1.0, 1.0743 * speed), rel=0.01)
    assert server.values()['slowed'] == 2


def test_limits_hold_for_what_is_commanded() -> None:
    """A fifth of the torque, and without the gravity that the robot adds."""
    less = serving(torque_limits=[150.0], overload_policy='refuse', output_scale=0.2)
    assert duration(less, rest_to_rest()) == 1.0
    heavy = [point([600, 0], [0, 0], [0, 0]), point([601, 0], [0, 0], [0, 0], 2.0)]
    without = serving(torque_limits=[500.0], overload_policy='refuse', gravity=False)
    assert duration(without, heavy) == 2.0


def test_a_plan_beyond_limits_keeps_its_times_by_default() -> None:
    assert duration(serving(torque_limits=[1.0]), rest_to_rest()) == 1.0
    assert duration(serving(overload_policy='slow'), rest_to_rest()) == 1.0  # no limits


def test_a_sparse_plan_gets_points_where_efforts_would_be_wrong() -> None:
    server = serving(refine_plans=True)
    found = server.plan(NAMES, rest_to_rest(), 0.0)
    assert found.added > 5
    assert np.abs(found.tau[:, 0]).max() > 570.0
    assert found.missed[0] < 6.0  # a hundredth
    assert server.values()['added_points'] == found.added
    sparse = serving()
    assert sparse.plan(NAMES, rest_to_rest(), 0.0).missed[0] > 570.0
    assert sparse.judge('', 0.0) == (Level.WARN, 'messages with trouble: sparse_plans 1')


def test_points_are_added_in_a_time_that_does_not_grow_with_the_duration() -> None:
    """Two points over 1000 s took 0.28 s; gravity along the way is a polynomial of degree 5."""
    loaded, looks = arm(), []
    server = Server()
    server.use(loaded, ServeSettings(**{**PLAIN, 'refine_plans': True}))
    server.enable()
    predict = Sum.predict

    def counted(self: Sum, *states: Any) -> Any:
        looks.append(len(states[0]))
        return predict(self, *states)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Sum, 'predict', counted)
        plan = [point([0, 0], [0, 0], [0, 0]), point([800, 0], [0, 0], [0, 0], 1000.0)]
        found = server.plan(NAMES, plan, 0.0)
    assert sum(looks) < 10_000
    s = np.linspace(0.0, 1.0, 100_000)
    exact = 800 * (
        s**3 * (10 - 15 * s + 6 * s**2)
        + 0.3 * s**2 * (1 - s) ** 2
        + 0.006 * s * (1 - s) * (1 - 2 * s)
    )
    error = np.abs(np.interp(1000 * s, found.plan.t, found.tau[:, 0]) - exact).max()
    assert found.added < 50
    assert error < 1.05 * max(1.0, 0.01 * np.abs(exact).max())  # noise, or a hundredth


def test_a_reversal_in_a_long_plan_is_found() -> None:
    """Friction jumps within a hundredth of a second, once in 1000 s."""
    server = Server()
    server.use(
        replace(arm(), model=Sum(dry=70.0)), ServeSettings(**{**PLAIN, 'refine_plans': True})
    )
    server.enable()
    plan = [point([0, 0], [1, 0], [], 0.0), point([0, 0], [-2, 0], [], 1000.0)]
    found = server.plan(NAMES, plan, 0.0)
    (reversal,) = np.flatnonzero(np.diff(np.sign(found.plan.states[1, :, 0])))
    assert np.diff(found.plan.t)[reversal] < 2 * STEP_S


def test_a_plan_that_needs_too_many_points_is_refused() -> None:
    server = serving(refine_plans=True, max_plan_points=10)
    with pytest.raises(RefusedError, match='those included that refine_plans adds'):
        server.plan(NAMES, rest_to_rest(), 0.0)
    assert server.values()['refused'] == {Refusal.TOO_LONG: 1}
    assert serving(max_plan_points=10).plan(NAMES, rest_to_rest(), 0.0).added == 0
    corners = [point([t % 2, 0], [0, 0], [0, 0], 0.1 * t) for t in range(9999)]
    with pytest.raises(RefusedError, match='those included that refine_plans adds'):
        serving(refine_plans=True).plan(NAMES, corners, 0.0)


def joint_state(q: list[float], stamp_ns: int = 1) -> JointMessage:
    return JointMessage(stamp_ns, NAMES, q, [0.0, 0.0], [])


def test_joints_that_a_plan_leaves_out_hold_their_position() -> None:
    server = serving()
    plan = [point([1], [0], [0]), point([2], [0], [0], 1.0)]
    with pytest.raises(RefusedError, match='one is missing'):
        server.plan(['b'], plan, 0.0)
    assert server.measure(joint_state([7.0, 1.0]), 0.0)
    found = server.plan(['b'], plan, 0.1)
    assert found.plan.joint_names == ('b', 'a')
    np.testing.assert_array_equal(found.tau[[0, -1]], [[1.0, 7.0], [2.0, 7.0]])
    np.testing.assert_array_equal(found.plan.states[:, :, 1], [[7.0] * 2, [0.0] * 2, [0.0] * 2])


def test_a_plan_of_one_point_begins_where_the_arm_is() -> None:
    server = serving(refine_plans=True)
    assert server.measure(joint_state([0.0, 0.0]), 0.0)
    found = server.plan(NAMES, [point([1, 0], [0, 0], [], 1.0)], 0.1)
    assert found.added > 1
    assert found.plan.t[0] > 0.0
    np.testing.assert_allclose(
        found.plan.states[0, :, 0], 3 * found.plan.t**2 - 2 * found.plan.t**3
    )
    np.testing.assert_array_equal(found.tau[-1], [1.0, 0.0])
    alone = server.plan(NAMES, [point([1, 0], [0, 0], [], 1.0)], 9.0)  # nobody knows where it is
    np.testing.assert_array_equal(alone.tau, [[1.0, 0.0]])


@pytest.mark.parametrize(
    ('goal', 'late'),
    [([1.0, 0.0], 1.0), ([1.0, 0.0], -5.0), ([3.5, 0.0], 0.0)],
    ids=['begun', 'later', 'shorter way'],
)
def test_no_points_are_added_where_the_way_to_the_first_is_not_known(
    goal: list[float], late: float
) -> None:
    """The arm jumped by half of the way, or went 6.2 rad round where 0.08 were left."""
    server = serving(refine_plans=True)
    server.measure(joint_state([0.0, 0.0]), 0.0)
    found = server.plan(NAMES, [point(goal, [0, 0], [], 2.0)], 0.1, late=late)
    assert found.added == 0
    assert found.plan.t.tolist() == [2.0]


def test_a_plan_that_begins_late_is_counted_and_one_that_has_ended_refused() -> None:
    server = serving()
    for late in (-9.0, 0.05, 0.9):
        server.plan(NAMES, rest_to_rest(), 0.0, late=late)
    assert server.values()['late_plans'] == 1
    with pytest.raises(RefusedError, match='would have ended by its stamp'):
        server.plan(NAMES, rest_to_rest(), 0.0, late=1.1)
    assert server.values()['refused'] == {Refusal.ENDED_PLAN: 1}
    assert server.values()['late_plans'] == 1


def test_references_that_contradict_each_other_are_refused_but_for_a_stop() -> None:
    server = serving()
    server.is_contradicted = True
    with pytest.raises(RefusedError, match='several publishers'):
        server.sample(NAMES, [POINT], 0.0)
    with pytest.raises(RefusedError, match='several publishers'):
        server.plan(NAMES, rest_to_rest(), 0.0)
    server.end_stream()
    server.is_contradicted = False
    server.sample(NAMES, [POINT], 0.0)


def test_a_plan_is_refused_at_a_speed_that_no_controller_has() -> None:
    for speed in (-1.0, 1000.0):
        with pytest.raises(RefusedError, match='speed'):
            serving().plan(NAMES, [point([0, 0], [0, 0], [0, 0], 1.0)], 0.0, speed=speed)


def test_a_place_of_long_ago_is_none_where_references_may_stop_for_ever() -> None:
    server = serving(stale_timeout_s=0.0)
    server.measure(joint_state([0.5, 0.5]), 0.0)
    some = [point([1], [0], [0], 1.0), point([2], [0], [0], 2.0)]
    assert server.plan(NAMES[:1], some, 0.4).tau.shape[1] == 2
    with pytest.raises(RefusedError):
        server.plan(NAMES[:1], some, 3600.0)


def test_efforts_are_those_of_the_speed_of_the_controller() -> None:
    full, slow, still = (
        serving().sample(NAMES, [POINT], 0.0, speed=speed).tau for speed in (1.0, 0.3, 0.0)
    )
    np.testing.assert_allclose(full, TAU)
    np.testing.assert_allclose(slow, [1 + 9 + 45, 2 + 12 + 54])
    np.testing.assert_array_equal(still, [1.0, 2.0])
    plan = [POINT, point([1, 2], [3, 4], [5, 6], 1.0)]
    np.testing.assert_allclose(serving().plan(NAMES, plan, 0.0, speed=0.3).tau[0], slow)
    with pytest.raises(RefusedError, match='speed_scaling_factor must be a number'):
        serving().sample(NAMES, [POINT], 0.0, speed=np.nan)


def test_the_rate_of_a_plan_follows_its_times() -> None:
    server = serving(rate_limits=[10.0])
    still = ([0, 0], [0, 0])
    plan = [point([t * 100, 0], *still, t) for t in (0.0, 0.5, 2.5)]
    np.testing.assert_array_equal(server.plan(NAMES, plan, 0.0).tau[:, 0], [0.0, 5.0, 25.0])
    assert counted(server) == {'rate_limited': 2}


def test_gravity_is_left_out_where_the_robot_adds_its_own() -> None:
    server = serving(gravity=False)
    np.testing.assert_array_equal(server.sample(NAMES, [POINT], 0.0).tau, TAU - [1, 2])
    np.testing.assert_array_equal(server.plan(NAMES, [POINT], 0.0).tau, [TAU - [1, 2]])


@pytest.mark.parametrize('gravity', [True, False])
def test_friction_is_left_out_where_the_drives_compensate_it(gravity: bool) -> None:
    dry = replace(arm(), model=Sum(dry=7.0))
    wanted = TAU - (0.0 if gravity else np.array([1.0, 2.0]))
    for friction in (True, False):
        settings = ServeSettings(gravity=gravity, friction=friction, **PLAIN)
        server = Server()
        server.use(dry, settings)
        server.enable()
        expected = wanted + 7.0 * friction
        np.testing.assert_array_equal(server.sample(NAMES, [POINT], 0.0).tau, expected)
        np.testing.assert_array_equal(server.plan(NAMES, [POINT], 0.0).tau, [expected])


def test_the_scale_is_one_of_gravity_too() -> None:
    at_rest = point([1, 2], [0, 0], [0, 0])
    weight = serving().sample(NAMES, [at_rest], 0.0).tau
    assert weight.all()
    scaled = serving(output_scale=0.2).sample(NAMES, [at_rest], 0.0).tau
    np.testing.assert_allclose(scaled, 0.2 * weight)


def test_plan_with_a_foreign_joint_is_refused_and_counted() -> None:
    server = serving()
    with pytest.raises(RefusedError, match='one is not in the model'):
        server.plan(['a', 'b', 'tool'], [point([1] * 3, [1] * 3, [1] * 3, t) for t in (0, 1)], 0.0)
    assert server.values()['refused'] == {Refusal.FOREIGN_JOINT: 1}


def test_torque_that_is_not_finite_never_leaves() -> None:
    server = serving()
    server.use(arm(np.nan), ServeSettings(**PLAIN))
    with pytest.raises(RefusedError, match='not be finite'):
        server.sample(NAMES, [POINT], 0.0)
    with pytest.raises(RefusedError, match='not be finite'):
        server.plan(NAMES, [POINT], 0.0)
    assert server.values()['refused'] == {Refusal.NOT_FINITE_TORQUE: 2}
    assert server.values()['answered'] == {'samples': 0, 'plans': 0, 'measured': 0}
    assert server.judge('', 0.0) == (
        Level.ERROR,
        'messages with trouble: torque not finite 2',
    )
    assert server.judge('', 0.0) == (Level.OK, 'answering')


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=6, max_size=6))
def test_whatever_comes_what_leaves_is_finite_and_within_limits(values: list[float]) -> None:
    server = serving(torque_limits=[5.0, 7.0], rate_limits=[50.0], range_policy='scale')
    for now in (0.1, 0.2, 0.9):
        try:
            tau = server.sample(NAMES, [point(values[:2], values[2:4], values[4:])], now).tau
        except RefusedError:
            continue
        assert tau.shape == (2,)
        assert (np.abs(tau) <= [5.0, 7.0]).all()


def test_nothing_is_answered_while_disabled_or_inactive() -> None:
    server = serving()
    server.disable(0.0)
    with pytest.raises(RefusedError, match='call its service enable'):
        server.sample(NAMES, [POINT], 0.0)
    assert server.judge('', 0.0) == (Level.OK, 'disabled')
    server.release()
    assert not server.active
    with pytest.raises(RefusedError, match='activate it through its lifecycle'):
        server.sample(NAMES, [POINT], 0.0)
    assert server.values()['refused'] == {Refusal.DISABLED: 1, Refusal.INACTIVE: 1}
    assert server.judge('', 0.0) == (Level.OK, 'inactive')
    assert server.judge('not configured: why', 0.0) == (Level.ERROR, 'not configured: why')


def test_another_model_is_ramped_in_and_counts_go_on() -> None:
    server = serving(output_scale=0.5)
    server.sample(NAMES, [POINT], 1.0)
    server.use(arm(2.0), ServeSettings(ramp_s=0.05))
    np.testing.assert_allclose(server.sample(NAMES, [POINT], 2.0).tau, 0.5 * TAU)
    np.testing.assert_allclose(server.sample(NAMES, [POINT], 2.06).tau, 2 * TAU)
    assert server.values()['answered'] == {'samples': 3, 'plans': 0, 'measured': 0}


def test_enable_begins_at_zero() -> None:
    server = serving(ramp_s=0.1)
    server.sample(NAMES, [POINT], 5.0)
    server.disable(0.0)
    server.enable()
    np.testing.assert_allclose(server.sample(NAMES, [POINT], 6.0).tau, 0.0)
    np.testing.assert_allclose(server.sample(NAMES, [POINT], 6.05).tau, 0.5 * TAU)


def test_a_silent_stream_gets_a_safe_torque_and_comes_back_by_a_ramp() -> None:
    server = serving(stale_timeout_s=0.5, ramp_s=0.1)
    assert server.safe_torque(99.0) is None  # nobody holds anything yet
    server.sample(NAMES, [POINT], 100.0)
    assert server.safe_torque(100.5) is None
    for now in (100.6, 101.0):
        safe = server.safe_torque(now)
        np.testing.assert_array_equal(safe, [0.0, 0.0])
    assert counted(server) == {'stale': 1}
    sentence = 'no reference for 2.0 s: zero torque published'
    assert server.judge('', 102.0) == (Level.WARN, sentence)
    with pytest.raises(RefusedError):  # what cannot be answered does not count as a reference
        server.sample(NAMES, [point([1], [1], [1])], 102.0)
    assert server.safe_torque(102.0) is not None
    np.testing.assert_allclose(server.sample(NAMES, [POINT], 103.0).tau, 0.0)
    assert server.safe_torque(103.01) is None
    np.testing.assert_allclose(server.sample(NAMES, [POINT], 103.05).tau, 0.5 * TAU)
    server.disable(0.0)
    assert server.safe_torque(200.0) is None


def test_a_stream_that_begins_late_is_ramped_in_all_the_same() -> None:
    server = serving(ramp_s=0.1)
    for begun in (100.0, 200.0, 300.0):
        np.testing.assert_allclose(server.sample(NAMES, [POINT], begun).tau, 0.0)
        np.testing.assert_allclose(server.sample(NAMES, [POINT], begun + 0.05).tau, 0.5 * TAU)
        np.testing.assert_allclose(server.sample(NAMES, [POINT], begun + 0.11).tau, TAU)
        if begun == 100.0:
            server.disable(0.0)
            server.enable()
        else:
            server.rest(0.0)  # after a fault of a callback


@pytest.mark.parametrize('refused', [([1], [1], [1]), ([1e308, 0], [1e308, 0], [1e308, 0])])
def test_refused_references_do_not_hold_a_torque(
    refused: tuple[list[float], list[float], list[float]],
) -> None:
    server = serving(stale_timeout_s=0.5, safe_ramp_s=0.1, range_policy='ignore')
    server.sample(NAMES, [POINT], 0.0)
    for tick, share in enumerate([1.0, 0.8, 0.6, 0.4, 0.2, 0.0, 0.0, 0.0]):
        now = 0.6 + 0.02 * tick
        for _ in range(20):
            with pytest.raises(RefusedError):
                server.sample(NAMES, [point(*refused)], now)
        safe = server.safe_torque(now)
        assert safe is not None
        np.testing.assert_allclose(safe, share * TAU, atol=1e-9)


def test_the_safe_torque_of_gravity_is_that_of_where_the_arm_is() -> None:
    server = serving(stale_timeout_s=0.5, stale_policy='gravity', torque_limits=[50.0])
    server.sample(NAMES, [POINT], 1.0)
    assert server.measure(joint_state([3.0, 70.0]), 1.9)
    np.testing.assert_array_equal(server.safe_torque(2.0), [3.0, 50.0])
    without = ServeSettings(stale_timeout_s=0.5, stale_policy='gravity', gravity=False, **PLAIN)
    server.adjust(without)
    np.testing.assert_array_equal(server.safe_torque(2.1), [0.0, 0.0])


def test_gravity_of_a_place_left_long_ago_is_not_held() -> None:
    """Joint states died at 1.5 rad, references went on to -1.5: +8 N m was held for -8."""
    server = serving(stale_timeout_s=0.5, stale_policy='gravity', safe_ramp_s=0.1)

    def safe(now: float) -> float:
        tau = server.safe_torque(now)
        assert tau is not None
        return float(tau[0])

    for tick in range(100):
        now = 0.02 * tick
        if tick < 25:
            assert server.measure(joint_state([1.5, 0.0], 1 + tick), now)
        server.sample(NAMES, [point([1.5 - 0.03 * tick, 0.0], [0.0, 0.0], [0.0, 0.0])], now)
    level, sentence = server.judge('', 1.98)
    assert level == Level.WARN
    assert sentence.startswith('no joint states: where references stop, zero torque is published')
    assert [safe(2.5 + 0.02 * tick) for tick in range(7)][-1] == 0.0
    for tick in range(100):  # one frozen stamp, of another position
        server.measure(joint_state([70.0, 0.0], 25), 3.0 + 0.02 * tick)
        assert safe(3.0 + 0.02 * tick) == 0.0
    assert server.measure(joint_state([20.0, 0.0], 26), 6.0)
    back = [safe(6.0 + 0.02 * tick) for tick in range(7)]
    np.testing.assert_allclose(back, [0.0, 4.0, 8.0, 12.0, 16.0, 20.0, 20.0])


def test_the_end_of_a_stream_is_followed_by_the_safe_torque_at_once() -> None:
    server = serving(stale_timeout_s=0.0)
    server.end_stream()
    assert server.safe_torque(0.0) is None
    server.sample(NAMES, [POINT], 1.0)
    assert server.safe_torque(99.0) is None
    server.end_stream()
    np.testing.assert_array_equal(server.safe_torque(99.0), [0.0, 0.0])
    server.sample(NAMES, [POINT], 100.0)
    assert server.safe_torque(100.1) is None


def test_the_rate_counts_from_a_zero_that_was_published() -> None:
    server = serving(rate_limits=[100.0])
    for now in np.arange(0.0, 1.0, 0.01):
        server.sample(NAMES, [POINT], float(now))
    server.disable(1.0)
    server.enable()
    np.testing.assert_allclose(server.sample(NAMES, [POINT], 1.01).tau, [1.0, 1.0])


def test_the_safe_torque_keeps_to_the_rate() -> None:
    server = serving(stale_timeout_s=0.5, rate_limits=[100.0])
    for now in np.arange(0.0, 1.0, 0.05):
        server.sample(NAMES, [POINT], float(now))
    first = server.safe_torque(2.0)
    second = server.safe_torque(2.01)
    assert first is not None
    assert second is not None
    np.testing.assert_allclose(first - second, 1.0)


@pytest.mark.parametrize(
    ('policy', 'expected', 'count'),
    [('ignore', 1.0, 0), ('warn', 1.0, 2), ('scale', 0.5, 2), ('zero', 0.0, 2)],
)
def test_references_outside_the_training_range(policy: str, expected: float, count: int) -> None:
    server = Server()
    settings = ServeSettings(range_policy=policy, range_margin=(0.0,), **PLAIN)
    server.use(arm(reach=4.0), settings)
    server.enable()
    np.testing.assert_array_equal(server.sample(NAMES, [POINT], 0.0).tau, expected * TAU)
    np.testing.assert_array_equal(server.plan(NAMES, [POINT], 0.0).tau, [expected * TAU])
    assert server.values()['out_of_range'] == count
    level, _ = server.judge('', 0.0)
    assert level == (Level.WARN if count else Level.OK)


def test_measured_states_that_cannot_be_used_are_counted() -> None:
    server = serving()
    assert server.measure(JointMessage(0, ('a',), [0.0], [0.0], []), 0.0) is None
    assert server.values()['unmeasured'] == {Refusal.MISSING_JOINT: 1}
    assert server.values()['refused'] == {}


def test_the_safe_torque_is_reached_in_its_own_time_and_the_diagnostics_state_it() -> None:
    server = serving(stale_timeout_s=0.5, ramp_s=30.0, safe_ramp_s=0.1)
    for now in np.arange(0.0, 40.0, 0.05):
        server.sample(NAMES, [POINT], float(now))
    server.adjust(ServeSettings(**{**PLAIN, 'ramp_s': 60.0, 'safe_ramp_s': 0.1}))
    for now, share in ((40.5, 1.0), (40.54, 0.6), (40.58, 0.2), (40.61, 0.0)):
        safe = server.safe_torque(now)
        assert safe is not None
        np.testing.assert_allclose(safe, share * TAU, atol=1e-9)
        published = f'torques up to {642 * share:.3g} N m or N' if share else 'zero torque'
        sentence = f'no reference for {now - 39.95:.1f} s: {published} published'
        assert server.judge('', now) == (Level.WARN, sentence)


def test_disable_ends_the_watch_over_the_stream() -> None:
    server = serving(stale_timeout_s=0.5)
    server.sample(NAMES, [POINT], 0.0)
    assert server.safe_torque(1.0) is not None
    server.disable(0.0)
    assert server.judge('', 1.5)[0] == Level.OK
    server.enable()
    assert server.safe_torque(99.0) is None  # no reference is expected yet
    server.sample(NAMES, [POINT], 100.0)
    server.disable(0.0)
    server.enable()
    assert server.safe_torque(200.0) is None
    assert server.values()['stale'] == 1


@pytest.mark.parametrize('t', [(0.0, 0.0), (1.0, 0.5), (-1.0, 1.0), (0.0, 1.0, 1.0)])
def test_a_plan_whose_times_do_not_increase_is_refused(t: tuple[float, ...]) -> None:
    server = serving()
    plan = [point([1, 2], [3, 4], [5, 6], time) for time in t]
    with pytest.raises(RefusedError, match='begin at 0 or later and increase'):
        server.plan(NAMES, plan, 0.0)
    assert server.values()['refused'] == {Refusal.NOT_INCREASING: 1}


def test_a_plan_beyond_the_bound_is_refused() -> None:
    server = serving(max_plan_points=3)
    plan = [point([1, 2], [3, 4], [5, 6], float(number)) for number in range(4)]
    assert server.plan(NAMES, plan[:3], 0.0).tau.shape == (3, 2)
    with pytest.raises(RefusedError, match='more points than max_plan_points'):
        server.plan(NAMES, plan, 0.0)
    assert server.values()['refused'] == {Refusal.TOO_LONG: 1}


def test_refused_joint_states_are_warned_of() -> None:
    server = serving()
    for _ in range(3):
        assert server.measure(JointMessage(0, NAMES, [0.0, 0.0], [], []), 0.0) is None
    assert server.values()['unmeasured'] == {Refusal.NO_VELOCITY: 3}
    sentence = 'messages with trouble: joint states: velocity missing 3'
    assert server.judge('', 0.0) == (Level.WARN, sentence)
    assert server.judge('', 0.0) == (Level.OK, 'answering')


def test_joint_states_of_another_robot_are_warned_of_where_no_others_come() -> None:
    server = serving()
    foreign = JointMessage(0, ('finger',), [0.0], [0.0], [])
    server.measure(foreign, 0.0)
    sentence = 'messages with trouble: joint states: only foreign joints 1'
    assert server.judge('', 0.0) == (Level.WARN, sentence)
    server.measure(foreign, 0.0)
    server.measure(JointMessage(1, NAMES, [0.0, 0.0], [0.0, 0.0], []), 0.0)
    assert server.judge('', 0.0) == (Level.OK, 'answering')


@given(st.lists(st.integers(0, 5), max_size=30))
def test_every_message_is_answered_or_refused(kinds: list[int]) -> None:
    server, plan = serving(), [POINT, point([1, 2], [3, 4], [5, 6], 1.0)]
    calls = (
        lambda: server.sample(NAMES, [POINT], 1.0),
        lambda: server.sample(('a',), [POINT], 1.0),
        lambda: server.plan(NAMES, plan, 0.0),
        lambda: server.plan(NAMES, plan[::-1], 0.0),
        lambda: server.disable(0.0),
        server.enable,
    )
    messages = 0
    for kind in kinds:
        messages += kind < 4
        with contextlib.suppress(RefusedError):
            calls[kind]()
    values = server.values()
    assert messages == sum(values['answered'].values()) + sum(values['refused'].values())


def test_an_old_reference_is_refused_and_feeds_nothing() -> None:
    server = serving(stale_timeout_s=0.5)
    server.sample(NAMES, [POINT], 0.0, age=0.5)
    with pytest.raises(RefusedError, match='sent more than stale_timeout_s ago'):
        server.sample(NAMES, [POINT], 0.4, age=0.6)
    assert server.silence(0.4) == 0.4
    assert server.values()['refused'] == {Refusal.OLD: 1}
    serving(stale_timeout_s=0.0).sample(NAMES, [POINT], 0.0, age=1e9)
