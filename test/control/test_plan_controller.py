"""Plans are followed between their points, refused where they cannot be, and limited."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field, replace
import math

import numpy as np
import pytest

from lip_id_ros.control.computed_torque import ControlSettings, PlanController
from lip_id_ros.errors import ConfigError
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Level

NAMES = ('a', 'b')
SETTINGS = ControlSettings(
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
]


def measured(
    t: float, q: list[float], dq: list[float], names: tuple[str, ...] = NAMES
) -> JointMessage:
    return JointMessage(START + round(1e9 * t), names, q, dq, [])


def following(plan: list[Point] = PLAN, names: tuple[str, ...] = NAMES) -> PlanController:
    controller = PlanController(SETTINGS)
    controller.take(names, plan)
    return controller


def test_without_a_plan_there_is_no_torque() -> None:
    assert PlanController(SETTINGS).torques(measured(0, [0, 0], [0, 0])) is None


def test_effort_and_feedback_between_two_points() -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    torques = controller.torques(measured(0.5, [0.4, 1.0], [1.0, 0.2]))
    assert torques is not None
    np.testing.assert_allclose(torques, [3.0 + 100 * 0.1, -4.0 - 5 * 0.2])


def test_clock_is_the_stamp_of_the_measurements_and_begins_with_the_first() -> None:
    controller = following()
    first = controller.torques(measured(7.0, [0.0, 1.0], [1.0, 0.0]))
    later = controller.torques(measured(7.5, [0.5, 1.0], [1.0, 0.0]))
    assert first is not None
    assert later is not None
    np.testing.assert_allclose(first, [2.0, -4.0])
    np.testing.assert_allclose(later, [3.0, -4.0], atol=1e-9)


def test_the_last_point_is_held_at_rest() -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    held = controller.torques(measured(5.0, [1.0, 1.0], [0.0, 0.0]))
    assert held is not None
    np.testing.assert_allclose(held, [4.0, -4.0])


def test_joints_are_mapped_by_name_on_both_sides() -> None:
    swapped = [
        Point(p.positions[::-1], p.velocities[::-1], p.time_from_start, p.effort[::-1])
        for p in PLAN
    ]
    controller = following(swapped, ('b', 'a'))
    torques = controller.torques(measured(0.0, [9.0, 0.8, 0.0], [0, 0, 1.0], ('x', 'b', 'a')))
    assert torques is not None
    np.testing.assert_allclose(torques, [2.0, -4.0 + 50 * 0.2])


def test_without_efforts_feedback_is_all() -> None:
    bare = [Point(p.positions, p.velocities, p.time_from_start) for p in PLAN]
    torques = following(bare).torques(measured(0.0, [0.1, 1.0], [1.0, 0.0]))
    assert torques is not None
    np.testing.assert_allclose(torques, [-10.0, 0.0])


@pytest.mark.parametrize('state', [([1e12, 1.0], [1.0, 0.0]), ([0.0, 1.0], [1.0, -1e300])])
def test_a_measurement_of_no_arm_moves_none(state: tuple[list[float], list[float]]) -> None:
    """Its feedback was the largest torque."""
    controller = following()
    with pytest.raises(RefusedError, match=r'larger than that of any arm; check its unit'):
        controller.torques(measured(0.0, *state))
    assert controller.status().values['refused'] == {'value too large': 1}


def test_torques_keep_their_limits() -> None:
    torques = following().torques(measured(0.0, [9.0, -9.0], [0.0, 0.0]))
    assert torques is not None
    np.testing.assert_array_equal(torques, [-30.0, 20.0])


def test_limits_are_kept_to_the_last_digit() -> None:
    # -14.6 + (12 - -14.6) is more than 12: nothing may be added to what was limited
    controller = PlanController(replace(SETTINGS, torque_limits=(12.0, 12.0)))
    points = [replace(point, effort=[-14.6, -14.6]) for point in PLAN]
    controller.take(NAMES, points)
    torques = controller.torques(measured(0.0, [-9.0, -9.0], [0.0, 0.0]))
    assert torques is not None
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
    ],
)
def test_a_bad_plan_is_refused_and_the_one_before_goes_on(
    points: list[Point], sentence: str
) -> None:
    controller = following()
    with pytest.raises(RefusedError, match=sentence):
        controller.take(NAMES, points)
    torques = controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    assert torques is not None
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
        (ControlSettings(joints=NAMES, damping=(1.0, 1.0)), 'stiffness must have one number for'),
        (
            ControlSettings(
                joints=NAMES, stiffness=(1.0, 1.0), damping=(1.0, 1.0), torque_limits=(1.0,)
            ),
            'torque_limits must have one number for each of 2 joints, but has 1',
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
        controller.torques(measured(wrong_s, [0.25, 1.0], [1.0, 0.0]))
    torques = controller.torques(measured(0.5, [0.5, 1.0], [1.0, 0.0]))
    assert torques is not None
    np.testing.assert_allclose(torques, [3.0, -4.0], atol=1e-6)


def test_a_clock_that_jumped_ends_the_plan() -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    for step in (0.0, 0.01):
        with pytest.raises(RefusedError):
            controller.torques(measured(-100.0 + step, [0.0, 1.0], [1.0, 0.0]))
    assert controller.torques(measured(-99.98, [0.0, 1.0], [1.0, 0.0])) is None
    controller.take(NAMES, PLAN)
    torques = controller.torques(measured(-99.97, [0.0, 1.0], [1.0, 0.0]))
    assert torques is not None
    np.testing.assert_allclose(torques, [2.0, -4.0], atol=1e-6)


def test_another_robot_on_the_topic_neither_ends_a_plan_nor_is_warned_of() -> None:
    controller = following()
    controller.torques(measured(0.0, [0.0, 1.0], [1.0, 0.0]))
    for step in range(5):
        with pytest.raises(RefusedError, match='has no joint of the model'):
            controller.torques(measured(1000.0 + step, [0.0], [0.0], ('finger',)))
    torques = controller.torques(measured(0.5, [0.5, 1.0], [1.0, 0.0]))
    assert torques is not None
    np.testing.assert_allclose(torques, [3.0, -4.0], atol=1e-6)
    assert controller.status().values['refused'] == {'only foreign joints': 5}
    assert controller.status().level == Level.OK
    with pytest.raises(RefusedError):
        controller.torques(measured(1000.0, [0.0], [0.0], ('finger',)))
    assert controller.status().level == Level.WARN  # nothing else comes


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
    controller = PlanController(SETTINGS)
    sent = 0
    for plan in (PLAN, PLAN[:1], [], PLAN[::-1]):
        sent += 1
        with contextlib.suppress(RefusedError):
            controller.take(NAMES, plan)
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
