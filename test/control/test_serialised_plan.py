"""A serialised plan is read as its points are, and refused where it is not one."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from rclpy.serialization import serialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.control.plan import read_points, read_serialised
from lip_id_ros.signals.joints import JointOrder, RefusedError

pytestmark = pytest.mark.ros

NAMES = ('a', 'elbow_2', 'π')
FRAMES = st.sampled_from(['', 'b', 'base', 'base_link'])


def plan(n_points: int, names: tuple[str, ...], has_effort: bool, frame: str) -> JointTrajectory:
    rng = np.random.default_rng(n_points)
    message = JointTrajectory(joint_names=names)
    message.header.frame_id = frame
    for number in range(n_points):
        values = rng.normal(size=(4, len(names))).tolist()
        point = JointTrajectoryPoint(
            positions=values[0],
            velocities=values[1],
            accelerations=values[2],
            effort=values[3] if has_effort else [],
        )
        point.time_from_start.sec, point.time_from_start.nanosec = number, 7 * number
        message.points.append(point)
    return message


@given(st.integers(1, 5), st.permutations([*NAMES, 'x']), st.booleans(), FRAMES)
def test_bytes_are_points(n_points: int, names: list[str], has_effort: bool, frame: str) -> None:
    message, order = plan(n_points, tuple(names), has_effort, frame), JointOrder(NAMES)
    read = read_serialised(serialize_message(message), order, 10)
    expected = read_points(order, names, message.points)
    for found, right in zip(read, expected, strict=True):
        np.testing.assert_array_equal(found, right)


@given(
    st.integers(1, 4),
    st.booleans(),
    st.sampled_from(['positions', 'velocities', 'accelerations', 'effort']),
    st.sampled_from([0, 1, 2, 4]),
    st.data(),
)
def test_arrays_of_another_length_are_refused(
    n_points: int, has_effort: bool, kind: str, length: int, data: st.DataObject
) -> None:
    message = plan(n_points, NAMES, has_effort, 'base')
    row = data.draw(st.integers(0, n_points - 1))
    if kind == 'effort' and length == 0 and (n_points == 1 or not has_effort):
        return
    setattr(message.points[row], kind, [0.0] * length)
    with pytest.raises(RefusedError, match='as long as the joint names'):
        read_serialised(serialize_message(message), JointOrder(NAMES), 10)


@given(st.integers(0, 375), st.booleans())
def test_bytes_that_end_before_are_refused(length: int, has_effort: bool) -> None:
    """Without efforts the message has 376 bytes, with them 468."""
    raw = serialize_message(plan(3, NAMES, has_effort, 'base'))
    with pytest.raises(RefusedError):
        read_serialised(raw[:length], JointOrder(NAMES), 10)


def test_no_points_and_too_many_are_refused() -> None:
    order = JointOrder(NAMES)
    with pytest.raises(RefusedError, match='at least one point'):
        read_serialised(serialize_message(plan(0, NAMES, True, '')), order, 10)
    with pytest.raises(RefusedError, match='max_plan_points'):
        read_serialised(serialize_message(plan(11, NAMES, True, '')), order, 10)
    broken = plan(2, NAMES, True, '')
    broken.points[1].velocities[0] = np.nan
    with pytest.raises(RefusedError, match='must be finite'):
        read_serialised(serialize_message(broken), order, 10)
