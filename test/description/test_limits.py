"""The limits on efforts that a URDF has, and what is refused."""

from __future__ import annotations

from pathlib import Path

from description.test_urdf import ARMS
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.description.limits import effort_limits, joint_ranges
from lip_id_ros.errors import DataError

EFFORTS = st.floats(1e-3, 1e6)


@pytest.mark.parametrize(
    ('name', 'expected'),
    [
        ('panda.urdf', (87.0,) * 4 + (12.0,) * 3),
        ('ur10_robot.urdf', (330.0, 330.0, 150.0, 54.0, 54.0, 54.0)),
    ],
)
def test_limits_of_real_files(name: str, expected: tuple[float, ...], shared_data: Path) -> None:
    text = (shared_data / 'urdf' / name).read_text()
    assert effort_limits(text, name, ARMS[name]) == expected
    assert effort_limits(text, name, ARMS[name][::-1]) == expected[::-1]


def robot(*joints: str) -> str:
    return f'<robot name="arm">{"".join(joints)}</robot>'


def joint(name: str, limit: str) -> str:
    return f'<joint name="{name}" type="revolute">{limit}</joint>'


@given(st.dictionaries(st.sampled_from('abcdef'), EFFORTS, min_size=1), st.data())
def test_each_joint_has_its_own_by_name(efforts: dict[str, float], data: st.DataObject) -> None:
    joints = [joint(name, f'<limit effort="{effort!r}"/>') for name, effort in efforts.items()]
    others = (f'<{tag}>{joint("a", "<limit/>")}</{tag}>' for tag in ('transmission', 'x'))
    asked = data.draw(st.permutations(list(efforts)))
    found = effort_limits(robot(*joints, *others), 'topic', asked)
    assert found == tuple(efforts[name] for name in asked)


@pytest.mark.parametrize(
    ('limit', 'has'),
    [
        ('', 'none'),
        ('<limit velocity="1"/>', 'none'),
        *(
            (f'<limit effort="{word}"/>', repr(word))
            for word in ('0', '-1', '', 'nan', 'inf', 'x')
        ),
        ('<limit effort="1e9"/>', "'1e9'"),
    ],
)
def test_a_joint_without_a_limit_of_its_own_is_refused(limit: str, has: str) -> None:
    text = robot(joint('a', '<limit effort="5"/>'), joint('b', limit))
    with pytest.raises(DataError) as raised:
        effort_limits(text, '/robot_description', ('a', 'b'))
    assert str(raised.value) == (
        '<limit effort="..."> of joint \'b\' in /robot_description was expected to be above 0 and '
        f'at most 1e+06, but is {has}; correct the URDF, or give torque_limits in numbers.'
    )


@pytest.mark.parametrize('times', [0, 2])
def test_a_joint_that_is_not_there_once_is_refused(times: int) -> None:
    text = robot(*[joint('a', '<limit effort="5"/>')] * times)
    with pytest.raises(DataError, match=f"the joint 'a' once, but has it {times} times; give the"):
        effort_limits(text, '/robot_description', ('a',))


def test_ranges_of_joints_have_nan_where_there_is_no_limit() -> None:
    text = robot(
        joint('a', '<limit lower="-1" upper="2.5" velocity="0" effort="5"/>'),
        '<joint name="b" type="continuous"><limit velocity="3"/></joint>',
        joint('c', ''),
    )
    found = joint_ranges(text, 'arm.urdf', ('b', 'a', 'c'))
    np.testing.assert_array_equal(found.lower, [-np.pi, -1.0, np.nan])
    np.testing.assert_array_equal(found.upper, [np.pi, 2.5, np.nan])
    np.testing.assert_array_equal(found.velocity, [3.0, np.nan, np.nan])
    np.testing.assert_array_equal(found.effort, [np.nan, 5.0, np.nan])


def test_limits_that_are_no_numbers_and_joints_that_are_not_there_are_refused() -> None:
    text = robot(joint('a', '<limit lower="-1" upper="wide" velocity="1" effort="5"/>'))
    with pytest.raises(DataError, match=r"""<limit upper="..."> of joint 'a' in u was expected"""):
        joint_ranges(text, 'u', ('a',))
    with pytest.raises(DataError, match="the joint 'b' once, but has it 0 times"):
        joint_ranges(text, 'u', ('b',))
