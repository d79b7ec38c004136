"""Conversions between messages and arrays lose nothing."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages
from lip_id_ros.nodes.relay import goal_of_feedback, status_of
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.signals.joints import RefusedError
from lip_id_ros.signals.status import Level, Status

pytestmark = pytest.mark.ros

VECTORS = arrays(np.float64, st.integers(0, 9), elements=st.floats(allow_nan=True))
MATRICES = arrays(
    np.float64, array_shapes(min_dims=2, max_dims=2, max_side=6), elements=st.floats(-1e9, 1e9)
)
STAMPS = st.builds(Time, sec=st.integers(0, 2**31 - 1), nanosec=st.integers(0, 999_999_999))


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_stamps_keep_every_nanosecond(nanoseconds: int) -> None:
    stamp = messages.stamp_at(nanoseconds)
    assert stamp.sec * 10**9 + stamp.nanosec == nanoseconds


def test_a_plan_is_not_slowed_beyond_what_a_duration_holds() -> None:
    """Seconds of 32 bits would begin again at the least number, or at a time long passed."""
    plan = messages.plan_message(['a'], np.array([2.0**31 - 5]), *np.zeros((3, 1, 1)))
    with pytest.raises(RefusedError):
        messages.slow_down(plan, 1.1)
    plan.points[0].time_from_start.sec = 10**9
    slower = deserialize_message(serialize_message(messages.slow_down(plan, 2.0)), JointTrajectory)
    assert slower.points[0].time_from_start.sec == 2 * 10**9


def test_a_slower_plan_is_on_the_same_way() -> None:
    times, states = np.array([0.5, 1.25]), np.arange(1.0, 7.0).reshape(3, 2, 1)
    plan = messages.slow_down(messages.plan_message(['a'], times, *states), 4.0)
    ends = [each.time_from_start.sec + 1e-9 * each.time_from_start.nanosec for each in plan.points]
    found = [(*each.positions, *each.velocities, *each.accelerations) for each in plan.points]
    np.testing.assert_array_equal(ends, 4.0 * times)
    np.testing.assert_array_equal(np.transpose(found)[..., None], states / [[[1]], [[4]], [[16]]])


@given(STAMPS, VECTORS)
def test_torques_arrive_as_they_were_sent(stamp: Time, tau: Array) -> None:
    names = [f'joint_{number}' for number in range(len(tau))]
    sent = messages.torque_message(stamp, names, tau)
    message = deserialize_message(serialize_message(sent), JointState)
    arrived = from_joint_state(message)
    assert arrived.stamp_ns == stamp.sec * 10**9 + stamp.nanosec
    assert list(arrived.names) == names
    np.testing.assert_array_equal(arrived.effort, tau)
    assert len(arrived.position) == len(arrived.velocity) == 0


@given(MATRICES)
def test_a_plan_keeps_all_but_its_efforts(tau: Array) -> None:
    points = [JointTrajectoryPoint(positions=row.tolist()) for row in -tau]
    plan = JointTrajectory(joint_names=[str(column) for column in range(tau.shape[1])])
    plan.points = points
    filled = messages.with_effort(plan, tau)
    np.testing.assert_array_equal([point.effort for point in filled.points], tau)
    np.testing.assert_array_equal([point.positions for point in filled.points], -tau)


def test_a_status_comes_back_as_it_was() -> None:
    values = {
        'rows': 3,
        'recording': True,
        'joint_names': ['a', 'b.c'],
        'thresholds': None,
        'refused': {},
        'job': {'state': 'idle', 'result': {'panda.joint1': {'angle_deg': 90.0}}},
    }
    message = messages.status_message('robot/train', 'robot', Status(Level.WARN, 'so so', values))
    arrived = deserialize_message(serialize_message(message), DiagnosticStatus)
    assert (arrived.name, arrived.hardware_id) == ('robot/train', 'robot')
    assert (arrived.level, arrived.message) == (b'\x01', 'so so')
    pairs = {pair.key: pair.value for pair in arrived.values}
    assert pairs['job.state'] == 'idle'
    assert pairs['job.result.panda_joint1.angle_deg'] == '90.0'
    expected = {**values, 'summary': 'so so'}
    expected['job'] = {'state': 'idle', 'result': {'panda_joint1': {'angle_deg': 90.0}}}
    assert messages.status_values(arrived) == expected


def test_energies_have_a_stamp_and_those_that_are_not_known_are_left_out() -> None:
    stamp = Time(sec=3, nanosec=4)
    energies = {'kinetic_energy': 1.5, 'potential_energy': np.nan}
    message = messages.statistics_message(stamp, energies)
    assert message.header.stamp == stamp
    assert [(each.name, each.value) for each in message.statistics] == [('kinetic_energy', 1.5)]


def test_the_status_of_a_goal_is_read_from_bytes() -> None:
    control_msgs = pytest.importorskip('control_msgs.action')
    rng = np.random.default_rng(0)
    for n_goals in (0, 1, 2, 5):
        infos = [GoalInfo(stamp=messages.stamp_at(10**18)) for _ in range(n_goals)]
        for info in infos:
            info.goal_id.uuid = rng.integers(0, 256, 16, dtype=np.uint8)
        names = [info.goal_id for info in infos]
        statuses = rng.integers(1, 7, n_goals).tolist()
        message = GoalStatusArray()
        for info, status in zip(infos, statuses, strict=True):
            message.status_list.append(GoalStatus(goal_info=info, status=status))
        raw = serialize_message(message)
        assert [status_of(raw, bytes(name.uuid)) for name in names] == statuses
        assert status_of(raw, bytes(16)) == GoalStatus.STATUS_UNKNOWN
        feedback = control_msgs.FollowJointTrajectory.Impl.FeedbackMessage
        for name in names:
            assert goal_of_feedback(serialize_message(feedback(goal_id=name))) == bytes(name.uuid)
