"""Conversions between messages and arrays lose nothing."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.interpolation import plan_of_points
from lip_id_ros.nodes import messages
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.signals.status import Level, Status

pytestmark = pytest.mark.ros

VECTORS = arrays(np.float64, st.integers(0, 9), elements=st.floats(allow_nan=True))
STAMPS = st.builds(Time, sec=st.integers(0, 2**31 - 1), nanosec=st.integers(0, 999_999_999))


@given(st.integers(0, 2**31 * 10**9 - 1))
def test_stamps_keep_every_nanosecond(nanoseconds: int) -> None:
    stamp = messages.stamp_at(nanoseconds)
    assert stamp.sec * 10**9 + stamp.nanosec == nanoseconds


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


@given(st.integers(1, 4), st.integers(1, 3), st.integers(0, 2**32))
def test_a_plan_has_what_its_points_have(n_points: int, n_given: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    states, tau = rng.normal(size=(3, n_points, 2)), rng.normal(size=(n_points, 2))
    states[n_given:] = np.nan
    t = np.cumsum(rng.uniform(0.01, 1e6, n_points))
    q, dq, ddq = states
    plan = messages.plan_message(['a', 'b'], t, q, dq, ddq, tau)
    read = plan_of_points(plan.joint_names, plan.points)
    np.testing.assert_array_equal(read.states, states)
    np.testing.assert_allclose(read.t, t, atol=1e-9, rtol=0.0)
    np.testing.assert_array_equal([point.effort for point in plan.points], tau)


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
