"""Plans are followed between their points, refused where they cannot be, and limited."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np
import pytest

from lip_id_ros.control.plan_controller import PlanController
from lip_id_ros.control.settings import ControlSettings
from lip_id_ros.errors import ConfigError
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Level, Status

NAMES = ('a', 'b')
SETTINGS = ControlSettings(
    joints=NAMES,
    stiffness=(100.0, 50.0),
    damping=(10.0, 5.0),
    torque_limits=(30.0, 20.0),
    # what is tested of them is tested with the defaults below
    rate_limits=(1e9,),
    ramp_s=0.0,
    stale_timeout_s=10.0,
    start_tolerance=(20.0,),
    path_tolerance=(20.0,),
)
DEFAULTS = ControlSettings(
    joints=NAMES, stiffness=(100.0, 50.0), damping=(10.0, 5.0), torque_limits=(30.0, 20.0)
)
START = 1_700_000_000_000_000_000


@dataclass
class Time:
    sec: int
    nanosec: int = 0


@dataclass
class Point:
    positions: list[float]
    velocities: list[float]
    time_from_start: Time
    effort: list[float] = field(default_factory=list)
    accelerations: list[float] = field(default_factory=lambda: [0.0, 0.0])


PLAN = [
    Point([0.0, 1.0], [1.0, 0.0], Time(0), [2.0, -4.0]),
    Point([1.0, 1.0], [1.0, 0.0], Time(1), [4.0, -4.0]),
    Point([1.5, 1.0], [0.0, 0.0], Time(2), [4.0, -4.0]),
]
STILL = [Point([0.0, 1.0], [0.0, 0.0], Time(second), [20.0, -4.0]) for second in (0, 3)]


def later(plan: list[Point]) -> list[Point]:
    return [replace(point, time_from_start=Time(point.time_from_start.sec + 10)) for point in plan]


def measured(
    t: float, q: list[float], dq: list[float], names: tuple[str, ...] = NAMES
) -> JointMessage:
    return JointMessage(START + round(1e9 * t), names, q, dq, [])


class Arm:
    def __init__(self, settings: ControlSettings = SETTINGS) -> None:
        self.controller = PlanController(settings)
        self.now = 0.0

    def take(self, plan: list[Point], names: tuple[str, ...] = NAMES) -> None:
        self.controller.take(names, plan, self.now)

    def torques(self, message: JointMessage, now: float | None = None) -> Any:
        self.now = max(self.now, 1e-9 * (message.stamp_ns - START)) if now is None else now
        return self.controller.torques(message, self.now)

    def status(self) -> Status:
        return self.controller.status()


def following(plan: list[Point] = PLAN, names: tuple[str, ...] = NAMES) -> Arm:
    arm = Arm()
    arm.take(plan, names)
    return arm


def test_without_a_plan_there_is_no_torque() -> None:
    assert Arm().torques(measured(0, [0, 0], [0, 0])) is None


def test_effort_and_feedback_between_two_points() -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    torques = controller.torques(measured(0.5, [0.4, 1.0], [1.0, 0.2]))
    np.testing.assert_allclose(torques, [3.0 + 100 * 0.1, -4.0 - 5 * 0.2])


def test_clock_is_the_stamp_of_the_measurements_and_begins_with_the_first() -> None:
    controller = following()
    first = controller.torques(measured(7.0, [0.0, 1.0], [1.0, 0.0]))
    later = controller.torques(measured(7.5, [0.5, 1.0], [1.0, 0.0]))
    np.testing.assert_allclose(first, [2.0, -4.0])
    np.testing.assert_allclose(later, [3.0, -4.0], atol=1e-9)


def test_the_last_point_is_held_at_rest() -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    held = controller.torques(measured(5.0, [1.5, 1.0], [0.0, 0.0]))
    np.testing.assert_allclose(held, [4.0, -4.0])


def test_a_plan_that_ends_slowly_is_held_at_rest() -> None:
    slow = [*PLAN[:2], replace(PLAN[2], velocities=[0.009, 0.0])]
    controller = following(slow)
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    held = controller.torques(measured(5.0, [1.5, 1.0], [0.0, 0.0]))
    np.testing.assert_allclose(held, [4.0, -4.0])


def test_joints_are_mapped_by_name_on_both_sides() -> None:
    swapped = [
        Point(p.positions[::-1], p.velocities[::-1], p.time_from_start, p.effort[::-1])
        for p in PLAN
    ]
    controller = following(swapped, ('b', 'a'))
    torques = controller.torques(measured(0.0, [9.0, 0.8, 0.0], [0, 0, 1.0], ('x', 'b', 'a')))
    np.testing.assert_allclose(torques, [2.0, -4.0 + 50 * 0.2])


def test_without_efforts_feedback_is_all() -> None:
    bare = [Point(p.positions, p.velocities, p.time_from_start) for p in PLAN]
    torques = following(bare).torques(measured(0.0, [0.1, 1.0], [1.0, 0.0]))
    np.testing.assert_allclose(torques, [-10.0, 0.0])


@pytest.mark.parametrize('state', [([1e12, 1.0], [1.0, 0.0]), ([0.0, 1.0], [1.0, -1e300])])
def test_a_measurement_of_no_arm_moves_none(state: tuple[list[float], list[float]]) -> None:
    controller = following()
    with pytest.raises(RefusedError, match=r'larger than that of any arm; check its unit'):
        controller.torques(measured(0.0, *state))
    assert controller.status().values['refused'] == {'value too large': 1}


def test_torques_keep_their_limits() -> None:
    torques = following().torques(measured(0.0, [9.0, -9.0], [0.0, 0.0]))
    np.testing.assert_array_equal(torques, [-30.0, 20.0])


def test_limits_are_kept_to_the_last_digit() -> None:
    # -14.6 + (12 - -14.6) is more than 12: nothing may be added to what was limited
    controller = Arm(replace(SETTINGS, torque_limits=(12.0, 12.0)))
    controller.take([replace(point, effort=[-14.6, -14.6]) for point in PLAN])
    torques = controller.torques(measured(0.0, [-9.0, -9.0], [0.0, 0.0]))
    assert torques.tolist() == [12.0, 12.0]


@pytest.mark.parametrize(
    ('points', 'sentence'),
    [
        ([PLAN[0]], 'increase from point to point'),
        ([PLAN[1], PLAN[0]], 'increase from point to point'),
        ([], 'at least one point'),
        ([PLAN[0], Point([0, 0], [0, 0], Time(1), [1.0])], 'as long as the joint names'),
        ([PLAN[0], Point([0, 0], [0, 0], Time(1))], 'as long as the joint names'),
        ([PLAN[0], Point([0], [0, 0], Time(1), [1, 1])], 'as long as the joint names'),
        ([PLAN[0], Point([0, 0], [0, 0], Time(1), [math.nan, 1])], 'must be finite'),
        ([PLAN[0], Point([0, 1e300], [0, 0], Time(1), [1, 1])], 'larger than that of any arm'),
        ([PLAN[0], Point([0, 0], [0, -1e300], Time(1), [1, 1])], 'larger than that of any arm'),
        ([PLAN[0], Point([0, 0], [0, 0], Time(1), [1e300, 1])], 'larger than that of any arm'),
        ([PLAN[0], Point([0, 2], [0, 0], Time(0, 1), [1, 1])], 'larger than that of any arm'),
        ([PLAN[0], Point([0, math.inf], [0, 0], Time(1), [1, 1])], 'must be finite'),
        (PLAN[:2], r'must end at rest, within 0\.01 rad/s'),
        (
            [
                Point([0, 1], [9, 0], Time(0), [1, 1]),
                Point([0, 1], [9, 0], Time(1), [1, 1]),
                *later(PLAN),
            ],
            r'must follow from its velocities, to 0\.05 rad or m and the way',
        ),
    ],
)
def test_a_bad_plan_leaves_the_one_before_going_on(points: list[Point], sentence: str) -> None:
    controller = following()
    with pytest.raises(RefusedError, match=sentence):
        controller.take(points)
    torques = controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    np.testing.assert_allclose(torques, [2.0, -4.0])


@pytest.mark.parametrize(
    ('message', 'sentence'),
    [
        (measured(0, [0.0], [0.0], ('a',)), 'one is missing'),
        (measured(0, [0.0, 0.0], [], NAMES), 'has no velocities'),
        (measured(0, [0.0, 0.0], [1.0], NAMES), 'as long as the joint names'),
        (measured(-START * 1e-9, [0.0, 0.0], [0.0, 0.0], NAMES), 'the stamp is zero'),
        (measured(0, [0.0, math.nan], [0.0, 0.0], NAMES), 'must be finite'),
    ],
)
def test_a_bad_measurement_is_not_answered(message: JointMessage, sentence: str) -> None:
    with pytest.raises(RefusedError, match=sentence):
        following().torques(message)


@pytest.mark.parametrize(
    ('settings', 'sentence'),
    [
        (ControlSettings(), 'joints must name the joints to control'),
        (
            replace(DEFAULTS, torque_limits=()),
            'torque_limits must hold the largest torque of each joint or one for all, but is '
            'empty; give the word none',
        ),
        (ControlSettings(joints=NAMES, damping=(1.0, 1.0)), 'stiffness must have one number for'),
        (
            ControlSettings(
                joints=NAMES, stiffness=(1.0, 1.0), damping=(1.0, 1.0), torque_limits=(1.0,) * 3
            ),
            r'torque_limits must hold one value per joint \(2\), one for all or none, but holds 3',
        ),
    ],
)
def test_settings_that_do_not_fit(settings: ControlSettings, sentence: str) -> None:
    with pytest.raises(ConfigError, match=sentence):
        PlanController(settings)


@pytest.mark.parametrize(
    ('wrong_s', 'sentence'), [(-START * 1e-9, 'is zero'), (-3600.0, 'before'), (3600.0, 'ahead')]
)
def test_a_wrong_stamp_moves_nothing(wrong_s: float, sentence: str) -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    with pytest.raises(RefusedError, match=sentence):
        controller.torques(measured(wrong_s, [0.25, 1.0], [1.0, 0.0]), 0.25)
    torques = controller.torques(measured(0.5, [0.5, 1.0], [1.0, 0.0]))
    np.testing.assert_allclose(torques, [3.0, -4.0], atol=1e-6)


def test_another_robot_on_the_topic_neither_ends_a_plan_nor_is_warned_of() -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    for step in range(5):
        with pytest.raises(RefusedError, match='has no joint of the model'):
            controller.torques(measured(1000.0 + step, [0.0], [0.0], ('finger',)), 0.1)
    torques = controller.torques(measured(0.5, [0.5, 1.0], [1.0, 0.0]))
    np.testing.assert_allclose(torques, [3.0, -4.0], atol=1e-6)
    assert controller.status().values['refused'] == {'only foreign joints': 5}
    assert controller.status().level == Level.OK
    with pytest.raises(RefusedError):
        controller.torques(measured(1000.0, [0.0], [0.0], ('finger',)), 0.6)
    assert controller.status().level == Level.WARN  # nothing else comes


def test_without_limits_the_status_says_so_at_every_level() -> None:
    controller = Arm(replace(SETTINGS, torque_limits='none'))
    assert controller.status().summary == 'all messages are answered; torques are not limited'
    with contextlib.suppress(RefusedError):
        controller.take([])
    assert controller.status().summary == 'messages refused: no points 1; torques are not limited'


def test_a_joint_named_twice_is_refused() -> None:
    twice = replace(SETTINGS, joints=('a', 'a'))
    with pytest.raises(ConfigError, match=r"^joints must name each joint once, but 'a' comes"):
        PlanController(twice)


def test_a_joint_state_that_comes_again_gets_the_same_torque() -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    for _ in range(3):
        torques = controller.torques(measured(0.5, [0.5, 1.0], [1.0, 0.0]))
        assert torques is not None
        np.testing.assert_allclose(torques, [3.0, -4.0], atol=1e-9)


def test_every_message_is_used_or_refused_and_new_refusals_are_warned_of() -> None:
    controller = Arm()
    sent = 0
    for plan in (PLAN, PLAN[:1], [], PLAN[::-1]):
        sent += 1
        with contextlib.suppress(RefusedError):
            controller.take(plan)
    rows = [[0.0, 0.0], [math.nan, 0.0], [], [0.0]]
    for number, row in enumerate(rows):
        sent += 1
        with contextlib.suppress(RefusedError):
            controller.torques(measured(0.01 * number, row, [0.0, 0.0]))
    status = controller.status()
    assert status.level == Level.WARN
    assert status.summary.startswith('messages refused: no points 1, position missing 1, times ')
    values = status.values
    assert (values['received'], values['plans'], values['torques']) == (sent, 1, 1)
    assert values['idle'] == 0
    assert sum(values['refused'].values()) == sent - 2
    assert len(values['refused']) == 5
    assert controller.status().level == Level.OK


AT_START = ([0.0, 1.0], [0.0, 0.0])
"""Positions and velocities of an arm that stands where `STILL` holds it."""


def holding(settings: ControlSettings = DEFAULTS) -> Arm:
    """Let an arm follow `STILL` until its torque has come, at 1 kHz."""
    arm = Arm(settings)
    arm.take(STILL)
    for step in range(200):
        arm.torques(measured(0.001 * step, *AT_START))
    np.testing.assert_allclose(arm.torques(measured(0.2, *AT_START)), [20.0, -4.0])
    return arm


def released(arm: Arm) -> np.ndarray:
    """Return torques of the watch, every 5 ms from now on, until there are none."""
    torques: list[np.ndarray] = []
    for step in range(100):
        tau = arm.controller.watch(arm.now + 0.005 * step)
        if tau is None and torques:
            break
        if tau is not None:
            torques.append(tau)
    return np.array(torques)


def assert_goes_to_zero(torques: np.ndarray, within_s: float) -> None:
    assert len(torques) <= 1 + round(within_s / 0.005)
    assert torques[-1].tolist() == [0.0, 0.0]
    steps = np.abs(np.diff(torques, axis=0))
    assert (steps <= 0.005 * 20 * np.array([30.0, 20.0]) + 1e-9).all()
    assert (np.diff(np.abs(torques), axis=0) <= 0.0).all()


def test_joint_states_that_stop_are_an_error_and_torques_go_to_zero() -> None:
    arm = holding()
    assert arm.controller.watch(arm.now + 0.05) is None
    arm.now += 0.051
    torques = released(arm)
    np.testing.assert_allclose(torques[0], [20.0, -4.0], atol=1.0)
    assert_goes_to_zero(torques, 0.04)
    status = arm.status()
    assert status.level == Level.ERROR
    assert status.summary == 'let go: no joint state has come for 0.05 s'
    assert status.values['let_go'] == {'joint states stopped': 1}
    # they come again: nothing moves, and the reason stays until the next plan begins
    assert arm.torques(measured(0.4, *AT_START)) is None
    assert arm.status().level == Level.ERROR
    arm.take(STILL)
    arm.torques(measured(0.401, *AT_START))
    assert arm.status().level == Level.OK


def test_a_pause_of_seconds_gets_no_torque_of_the_plan_whether_or_not_it_was_watched() -> None:
    arm = holding()
    torques = arm.torques(measured(2.9, *AT_START))
    np.testing.assert_allclose(torques, [20.0, -4.0])  # the first on the way to zero
    assert arm.controller.releasing
    assert_goes_to_zero(released(arm), 0.04)


def test_one_frozen_stamp_is_silence() -> None:
    arm = holding()
    for _ in range(10):
        arm.now += 0.001
        np.testing.assert_allclose(arm.torques(measured(0.2, *AT_START), arm.now), [20.0, -4.0])
    arm.now += 0.05
    assert_goes_to_zero(released(arm), 0.04)
    assert arm.status().summary == 'let go: no joint state was usable for 0.05 s (stamp repeated)'


def test_a_stamp_that_is_ahead_of_its_receipt_moves_nothing() -> None:
    arm = holding()
    with pytest.raises(RefusedError, match='far ahead'):
        arm.torques(measured(9.2, *AT_START), arm.now + 0.001)
    for step in range(1, 50):
        torques = arm.torques(measured(0.2 + 0.001 * step, *AT_START))
        np.testing.assert_allclose(torques, [20.0, -4.0])
    status = arm.status()
    assert status.level == Level.WARN
    assert status.summary == 'messages refused: stamp far ahead 1'


def test_a_clock_that_jumps_lets_the_plan_go_to_zero() -> None:
    arm = holding()
    for step in range(2):
        with pytest.raises(RefusedError, match='lies before'):
            arm.torques(measured(-100 + 0.001 * step, *AT_START), arm.now + 0.001 * (step + 1))
    assert arm.torques(measured(-99.998, *AT_START), arm.now + 0.001) is not None
    assert arm.status().summary == 'let go: the stamps of the joint states jumped'
    assert_goes_to_zero(released(arm), 0.04)
    assert arm.torques(measured(-99.99, *AT_START), arm.now + 0.01) is None
    arm.take(STILL)
    assert arm.torques(measured(-99.98, *AT_START), arm.now + 0.01) is not None
    assert arm.status().level == Level.OK


def test_a_plan_that_begins_elsewhere_is_not_followed_and_the_one_before_goes_on() -> None:
    arm = Arm(DEFAULTS)
    arm.take([replace(point, positions=[1.0, 1.0]) for point in STILL])
    assert arm.torques(measured(0.0, *AT_START)) is None
    status = arm.status()
    assert status.level == Level.ERROR
    assert status.summary == (
        'refused: the plan begins 1 rad or m from joint a, more than the tolerance of 0.1'
    )
    arm = holding()
    arm.take([replace(point, positions=[0.0, 1.2]) for point in STILL])
    np.testing.assert_allclose(arm.torques(measured(0.201, *AT_START)), [20.0, -4.0])
    assert arm.status().values['let_go'] == {'plan begins elsewhere': 1}


def test_an_arm_that_leaves_the_plan_is_let_go() -> None:
    arm = holding()
    torques = arm.torques(measured(0.201, [0.0, 1.3], [0.0, 0.0]))
    np.testing.assert_allclose(torques, [20.0, -4.0])
    assert_goes_to_zero(released(arm), 0.04)
    status = arm.status()
    assert status.level == Level.ERROR
    assert status.summary == (
        'let go: the plan is 0.3 rad or m from joint b, more than the tolerance of 0.2'
    )


def test_each_joint_has_its_own_tolerance() -> None:
    arm = holding(replace(DEFAULTS, path_tolerance=(0.05, 0.2)))
    arm.torques(measured(0.201, [0.1, 1.15], [0.0, 0.0]))
    assert 'from joint a, more than the tolerance of 0.05' in arm.status().summary


def test_a_plan_without_efforts_takes_over_in_a_ramp_within_the_rates() -> None:
    arm = holding(replace(DEFAULTS, ramp_s=0.1))
    arm.take([replace(point, effort=[]) for point in STILL])
    torques = [arm.torques(measured(0.2 + 0.001 * step, *AT_START)) for step in range(1, 111)]
    first = np.array(torques)[:, 0]
    assert first[0] == pytest.approx(20.0)
    assert first[-1] == pytest.approx(0.0)
    np.testing.assert_allclose(-np.diff(first)[:95], 0.2, atol=1e-9)


def test_a_plan_begins_from_zero_torque_within_the_rates() -> None:
    arm = Arm(replace(DEFAULTS, ramp_s=0.0))
    arm.now = 5.0
    arm.take(STILL)
    torques = [arm.torques(measured(5.0 + 0.001 * step, *AT_START)) for step in range(60)]
    first = np.array(torques)[:, 0]
    assert first[0] == pytest.approx(0.0, abs=1e-3)
    assert np.diff(first).max() == pytest.approx(0.001 * 20 * 30.0)
    assert first[-1] == pytest.approx(20.0)


def test_a_plan_that_waits_for_joint_states_is_not_followed_later() -> None:
    arm = Arm(DEFAULTS)
    arm.take(STILL)
    assert arm.controller.watch(0.06) is None
    assert arm.torques(measured(0.07, *AT_START)) is None
    assert arm.status().summary == 'let go: no joint state has come for 0.05 s'


def test_a_torque_that_is_not_finite_is_refused_and_lets_the_plan_go() -> None:
    huge = replace(SETTINGS, stiffness=(1e308, 1.0), torque_limits='none', stale_timeout_s=0.05)
    arm = Arm(huge)
    arm.take([replace(point, effort=[]) for point in PLAN])
    arm.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    for step in range(1, 50):
        with pytest.raises(RefusedError, match='would not be finite'):
            arm.torques(measured(0.001 * step, [-10.0, 1.0], [1.0, 0.0]))
    assert arm.torques(measured(0.06, [-10.0, 1.0], [1.0, 0.0])) is not None
    assert arm.status().values['let_go'] == {'joint states stopped': 1}
