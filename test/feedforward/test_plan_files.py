"""Plans in YAML and in bags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lip_id_ros.errors import ConfigError, DataError, SourceError
from lip_id_ros.excitation.trajectory_file import Trajectory, write_bag, write_yaml
from lip_id_ros.feedforward.plan_files import read_plans
from lip_id_ros.recording.bag_writer import JointTrajectoryTrack, write_mcap

ECHOED = """\
header:
  stamp:
    sec: 0
    nanosec: 0
  frame_id: ''
joint_names:
- a
- b
points:
- positions:
  - 0.1
  - 2.0e-1
  velocities: []
  accelerations: []
  effort: []
  time_from_start:
    sec: 1
    nanosec: 500000000
- positions: [1, 1e-1]
  velocities: [0, 0]
  accelerations: []
  time_from_start: {sec: 2}
---
"""


def write(folder: Path, text: str, name: str = 'plan.yaml') -> Path:
    path = folder / name
    path.write_text(text)
    return path


def indented(text: str) -> str:
    return ''.join(f'  {line}\n' for line in text.splitlines() if line != '---')


def test_a_message_as_ros2_topic_echo_prints_it(tmp_path: Path) -> None:
    (plan,) = read_plans(write(tmp_path, ECHOED))
    assert plan.joint_names == ('a', 'b')
    np.testing.assert_array_equal(plan.t, [1.5, 2.0])
    np.testing.assert_array_equal(plan.states[0], [[0.1, 0.2], [1.0, 0.1]])
    np.testing.assert_array_equal(np.isnan(plan.states[1]), [[True, True], [False, False]])
    assert np.isnan(plan.states[2]).all()


@pytest.mark.parametrize('fields', [['trajectory'], ['joint_trajectory'], ['goal', 'trajectory']])
def test_goals_and_messages_of_moveit(tmp_path: Path, fields: list[str]) -> None:
    text = ECHOED
    for field in reversed(fields):
        text = f'{field}:\n{indented(text)}'
    (plan,) = read_plans(write(tmp_path, text))
    np.testing.assert_array_equal(plan.t, [1.5, 2.0])


def test_several_messages_and_times_of_ros_1(tmp_path: Path) -> None:
    first, second = ECHOED, ECHOED.replace('nanosec', 'nsecs').replace('sec:', 'secs:')
    plans = read_plans(write(tmp_path, first + second, 'plans.yml'))
    assert len(plans) == 2
    np.testing.assert_array_equal(plans[0].t, plans[1].t)


def trajectory(n_points: int = 4) -> Trajectory:
    t = np.arange(float(n_points))
    states = np.random.default_rng(0).normal(size=(3, n_points, 2))
    return Trajectory(('a', 'b'), t, *states)


def test_designed_motions(tmp_path: Path) -> None:
    made = trajectory()
    write_yaml(str(tmp_path / 'motion.yaml'), made)
    write_bag(str(tmp_path / 'motion.mcap'), made)
    for name in ('motion.yaml', 'motion.mcap'):
        (plan,) = read_plans(tmp_path / name)
        np.testing.assert_array_equal(plan.t, made.t)
        np.testing.assert_array_equal(plan.states, made[2:])


def test_topics_of_a_bag(tmp_path: Path) -> None:
    bag, made = str(tmp_path / 'bag.mcap'), trajectory()
    write_mcap(bag, [JointTrajectoryTrack(topic, *made) for topic in ('/one', '/two')])
    assert len(read_plans(bag, '/two')) == 1
    with pytest.raises(ConfigError, match='has plans on /one, /two; name one topic'):
        read_plans(bag)
    with pytest.raises(ConfigError, match=r'has no .*JointTrajectory on /three, but on /one, /tw'):
        read_plans(bag, '/three')
    write_mcap(bag, [])
    with pytest.raises(SourceError, match=r'must hold a .*JointTrajectory, but has none'):
        read_plans(bag)


@pytest.mark.parametrize(
    ('old', 'new', 'sentence'),
    [
        ('joint_names:', 'names:', 'was expected, with joint_names'),
        ('- b\n', '- a\n', 'one comes twice'),
        ('  - 0.1\n', '', 'positions of point 0 must be 2 numbers like joint_names, or none'),
        ('  - 0.1\n', '  - x\n', 'positions of point 0 must be numbers'),
        ('  - 0.1\n', f'  - {10**400}\n', 'positions of point 0 must be numbers'),
        ('sec: 1\n', f'sec: {10**400}\n', 'time_from_start must have sec and nanosec'),
        ('  - 0.1\n', '  - .nan\n', 'positions of point 0 must be finite'),
        ('[1, 1e-1]', '[]', 'needs a finite position of each joint'),
        ('sec: 2', 'sec: two', 'time_from_start must have sec and nanosec'),
        ('sec: 2', 'sec: 1', 'increase from point to point'),
        ('{sec: 2}', '2', 'time_from_start must have sec and nanosec'),
    ],
)
def test_what_is_no_plan(tmp_path: Path, old: str, new: str, sentence: str) -> None:
    assert old in ECHOED
    with pytest.raises(DataError, match=sentence):
        read_plans(write(tmp_path, ECHOED.replace(old, new)))


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [('', 'must hold a'), ('a: [', 'is not readable YAML'), ('--- 3', 'was expected, with')],
)
def test_what_is_no_message(tmp_path: Path, text: str, sentence: str) -> None:
    with pytest.raises((SourceError, DataError), match=sentence):
        read_plans(write(tmp_path, text))


@pytest.mark.parametrize('name', ['motion.csv', 'motion'])
def test_a_file_of_another_kind_is_told_what_a_plan_is(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text('t,q_a\n0,0\n')
    with pytest.raises(SourceError, match=r'must be a plan in \.yaml or a bag, but ends in'):
        read_plans(tmp_path / name)
