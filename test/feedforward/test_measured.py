"""Measured joint states: energies and torque residual, whatever the order and the stamps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from feedforward.arms import arm, NAMES, Sum
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.measured import MeasuredArm
from lip_id_ros.model import EffortCalibration, Query
from lip_id_ros.model.effort_calibration import effort_calibrations
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.filters import LowPass
from lip_id_ros.signals.joint_states import MeasuredState
from lip_id_ros.signals.joints import Refusal, RefusedError

STEP_S = 0.002
SCALE, OFFSET = np.array([2.0, -1.0]), np.array([0.5, 0.0])
UNEXPLAINED = np.array([3.0, -4.0])


def measured_arm(cutoff_hz: float = 20.0) -> MeasuredArm:
    return MeasuredArm(replace(arm(), calibration=EffortCalibration(SCALE, OFFSET)), cutoff_hz)


def message(number: int, names: tuple[str, ...] = ('b', 'tool', 'a')) -> JointMessage:
    """Joints that swing, with an effort that the model explains but for a constant."""
    t = number * STEP_S
    q = {'a': np.sin(t), 'b': np.cos(2 * t), 'tool': 9.0}
    dq = {'a': np.cos(t), 'b': -2 * np.sin(2 * t), 'tool': 9.0}
    ddq = np.array([-np.sin(t), -4 * np.cos(2 * t)])
    both = np.array([[q[name], dq[name]] for name in NAMES])
    tau = both[:, 0] + 10 * both[:, 1] + 100 * ddq + UNEXPLAINED
    effort = dict(zip(NAMES, (tau - OFFSET) / SCALE, strict=True)) | {'tool': 9.0}
    position, velocity, torque = ([values[name] for name in names] for values in (q, dq, effort))
    return JointMessage(round(1e9 * (5.0 + t)), names, position, velocity, torque)


def read(followed: MeasuredArm, number: int) -> MeasuredState:
    return followed.read(message(number), number * STEP_S)


def residuals(numbers: range, followed: MeasuredArm) -> list[Any]:
    return [followed.residual(read(followed, number)) for number in numbers]


def test_the_residual_is_what_the_model_does_not_explain() -> None:
    found = residuals(range(1000), measured_arm())
    settled = [each for each in found if each is not None]
    assert found[0] is None
    assert len(settled) > 900
    # discretisation of the filter: below a hundredth of torques of up to 400
    np.testing.assert_allclose(settled, np.tile(UNEXPLAINED, (len(settled), 1)), atol=1.0)


class Pendulum(Sum):
    """A robot whose torques are 10 sin q (gravity)."""

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        found = super().query(q, dq, ddq)
        return found._replace(tau=10.0 * np.sin(q))


def test_a_position_that_is_reported_within_a_turn_is_no_residual() -> None:
    followed, found = MeasuredArm(replace(arm(), model=Pendulum()), 20.0), []
    for number in range(2000):
        q = np.array([1.0, -2.0]) * number * STEP_S
        reported = q - 2.0 * np.pi * np.round(q / (2.0 * np.pi))
        tau = (10.0 * np.sin(q)).tolist()
        stamp = 10**9 + round(1e9 * STEP_S) * number
        row = JointMessage(stamp, NAMES, reported.tolist(), [1.0, -2.0], tau)
        found.append(followed.residual(followed.read(row, number * STEP_S)))
    settled = [each for each in found if each is not None]
    assert len(settled) > 1900
    assert np.abs(settled).max() < 0.1


def test_after_a_gap_the_residual_begins_anew() -> None:
    followed = measured_arm()
    assert residuals(range(201), followed)[-1] is not None
    assert residuals(range(500, 501), followed) == [None]


def test_another_cut_off_is_used_from_the_next_joint_state_on() -> None:
    followed = measured_arm(20.0)
    assert residuals(range(201), followed)[-1] is not None
    followed.adjust(20.0)
    assert residuals(range(201, 202), followed)[-1] is not None
    followed.adjust(5.0)
    found = residuals(range(202, 602), followed)
    settling = sum(each is None for each in found)
    # ten time constants
    assert settling * STEP_S == pytest.approx(10.0 / (2 * np.pi * 5.0), abs=2 * STEP_S)


def test_of_two_clocks_the_first_is_followed() -> None:
    """Two publishers in turn, three seconds apart: the residual is that of the first alone."""
    followed, refused = measured_arm(), []
    found = []
    for number in range(1000):
        found += residuals(range(number, number + 1), followed)
        for apart_s in (3.0, -3.0):
            other = message(number + round(apart_s / STEP_S))
            with pytest.raises(RefusedError) as doubted:
                followed.read(other, number * STEP_S)
            refused.append(doubted.value.reason)
    assert refused == [Refusal.FAR_STAMP, Refusal.BACKWARD_STAMP] * 1000
    settled = [each for each in found if each is not None]
    assert len(settled) > 900
    np.testing.assert_allclose(settled, np.tile(UNEXPLAINED, (len(settled), 1)), atol=1.0)


def test_energies_come_from_positions_and_velocities() -> None:
    followed = measured_arm()
    measured = followed.read(message(0)._replace(effort=[]), 0.0)
    assert measured.tau is None
    assert followed.residual(measured) is None
    assert followed.energies(measured).kinetic == pytest.approx(1.0)


@pytest.mark.parametrize(
    ('changed', 'reason'),
    [
        ({'names': ('a', 'tool', 'gripper')}, Refusal.MISSING_JOINT),
        ({'names': ('a', 'b', 'b')}, Refusal.REPEATED_NAME),
        ({'velocity': []}, Refusal.NO_VELOCITY),
        ({'position': []}, Refusal.NO_POSITION),
        ({'effort': [1.0]}, Refusal.WRONG_LENGTH),
        ({'position': [0.0, 0.0, np.nan]}, Refusal.NOT_FINITE),
        ({'stamp_ns': 0}, Refusal.NO_STAMP),
    ],
)
def test_what_cannot_be_used_has_a_reason(changed: dict[str, Any], reason: Refusal) -> None:
    with pytest.raises(RefusedError) as refused:
        measured_arm().read(message(0)._replace(**changed), 0.0)
    assert refused.value.reason is reason


def test_the_filter_has_the_derivative_of_what_it_gives() -> None:
    low_pass = LowPass(5.0)
    given = [low_pass.add(0.001 * k, np.array([2.0 + 3.0 * 0.001 * k])) for k in range(1000)]
    (value, slope) = given[-1] or (np.nan, np.nan)
    assert slope == pytest.approx(3.0, rel=1e-6)
    # late by two time constants
    assert value == pytest.approx(2.0 + 3.0 * (0.999 - 2 / (2 * np.pi * 5.0)), abs=3e-3)


def test_the_calibration_is_that_of_the_fit() -> None:
    recording = {'joints': ['b', 'a'], 'effort_scale': [2.0, 3.0], 'effort_offset': []}
    (found,) = effort_calibrations({'sources': [{}, {'recording': recording}]}, NAMES)
    np.testing.assert_array_equal(found.torque(np.array([1.0, 1.0])), [3.0, 2.0])
    (plain,) = effort_calibrations({}, NAMES)
    np.testing.assert_array_equal(plain.torque(np.ones(2)), [1.0, 1.0])
