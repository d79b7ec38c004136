"""References: any order of joints gives the same answer, anything malformed a counted reason."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
import math
import struct

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError
from lip_id_ros.signals.trajectory_header import MOST_NAMES, read_header

NAMES = ('base', 'shoulder', 'elbow')
FINITE = st.floats(allow_nan=False, allow_infinity=False)


@dataclass
class Point:
    positions: array[float] = field(default_factory=lambda: array('d'))
    velocities: array[float] = field(default_factory=lambda: array('d'))
    accelerations: array[float] = field(default_factory=lambda: array('d'))


def point(*rows: list[float]) -> Point:
    return Point(*(array('d', row) for row in rows))


def points_of(n_joints: int) -> st.SearchStrategy[list[Point]]:
    row = st.lists(FINITE, min_size=n_joints, max_size=n_joints)
    return st.lists(st.builds(point, row, row, row), min_size=1, max_size=4)


@given(st.permutations(NAMES), st.lists(st.sampled_from(['tool', 'gripper']), unique=True))
def test_columns_find_every_joint_in_any_order(order: list[str], foreign: list[str]) -> None:
    names = [*foreign, *order]
    columns = JointOrder(NAMES).columns(names)
    assert [names[column] for column in columns] == list(NAMES)


@given(st.lists(st.permutations(NAMES), max_size=6))
def test_what_came_before_does_not_matter(orders: list[list[str]]) -> None:
    order = JointOrder(NAMES)
    for names in orders:
        assert [names[column] for column in order.columns(names)] == list(NAMES)


@pytest.mark.parametrize(
    ('names', 'reason'),
    [
        ((), Refusal.MISSING_JOINT),
        (('base', 'elbow'), Refusal.MISSING_JOINT),
        (('base', 'shoulder', 'wrist'), Refusal.MISSING_JOINT),
        (('base', 'shoulder', 'elbow', 'elbow'), Refusal.REPEATED_NAME),
    ],
)
def test_names_that_do_not_fit_are_refused(names: tuple[str, ...], reason: Refusal) -> None:
    order = JointOrder(NAMES)
    for _ in range(2):
        with pytest.raises(RefusedError) as refused:
            order.columns(names)
        assert refused.value.reason is reason
    assert order.columns(NAMES).tolist() == [0, 1, 2]


@given(points_of(4), st.permutations([*NAMES, 'tool']))
def test_states_have_every_number_in_its_place(points: list[Point], names: list[str]) -> None:
    states = JointOrder(NAMES).states(names, points)
    assert states.shape == (3, len(points), 3)
    columns = [names.index(name) for name in NAMES]
    for index, each in enumerate(points):
        for row, values in enumerate((each.positions, each.velocities, each.accelerations)):
            np.testing.assert_array_equal(states[row, index], np.array(values)[columns])


@given(
    points_of(3),
    st.integers(0, 2),
    st.sampled_from(['positions', 'velocities', 'accelerations']),
    st.sampled_from([math.nan, math.inf, -math.inf]),
    st.data(),
)
def test_one_number_that_is_not_finite_refuses_all(
    points: list[Point], joint: int, kind: str, value: float, data: st.DataObject
) -> None:
    index = data.draw(st.integers(0, len(points) - 1))
    getattr(points[index], kind)[joint] = value
    with pytest.raises(RefusedError, match=r'must be finite\.$'):
        JointOrder(NAMES).states(NAMES, points)


@given(
    points_of(3),
    st.sampled_from(['positions', 'velocities', 'accelerations']),
    st.integers(0, 8).filter(lambda length: length != 3),
    st.data(),
)
def test_one_array_of_another_length_refuses_all(
    points: list[Point], kind: str, length: int, data: st.DataObject
) -> None:
    index = data.draw(st.integers(0, len(points) - 1))
    setattr(points[index], kind, array('d', [0.0] * length))
    with pytest.raises(RefusedError, match=r'every array must be as long as the joint names'):
        JointOrder(NAMES).states(NAMES, points)


def test_no_points_are_refused() -> None:
    with pytest.raises(RefusedError, match=r'needs at least one point, this one has none\.$'):
        JointOrder(NAMES).states(NAMES, [])


def test_names_beyond_those_of_any_robot_are_not_read() -> None:
    """There are none after their number: whoever read them would find that."""
    stamp_and_frame = struct.pack('<iIIB3x', 0, 0, 1, 0)
    header = b'\0\1\0\0' + stamp_and_frame
    with pytest.raises(RefusedError) as refused:
        read_header(header + struct.pack('<I', MOST_NAMES + 1))
    assert refused.value.reason == Refusal.TOO_MANY_NAMES
    with pytest.raises(RefusedError) as refused:
        read_header(header + struct.pack('<I', MOST_NAMES))
    assert refused.value.reason == Refusal.MALFORMED
