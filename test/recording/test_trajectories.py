"""Plans read from bags."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from recording.bag_files import moving, trajectory_bytes, write_folder, write_raw

from lip_id_ros.errors import SourceError
from lip_id_ros.recording import read_trajectory

TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'


def write(path: Path, *messages: bytes) -> Path:
    return write_raw(path, '/plan', TRAJECTORY, messages, '.mcap')


def test_first_plan_with_points_is_read(tmp_path: Path) -> None:
    points = [{'positions': [1, 2], 'velocities': [3, 4]}, {'positions': [5, 6], 'effort': [7, 8]}]
    empty = trajectory_bytes(['a', 'b'], [])
    plan = read_trajectory(write(tmp_path / 'bag', empty, trajectory_bytes(['a', 'b'], points)))
    assert plan.joint_names == ('a', 'b')
    np.testing.assert_array_equal(plan.t, [0.5, 1.5])
    np.testing.assert_array_equal(plan.q, [[1, 2], [5, 6]])
    np.testing.assert_array_equal(plan.dq, [[3, 4], [np.nan, np.nan]])
    np.testing.assert_array_equal(plan.tau, [[np.nan, np.nan], [7, 8]])
    assert np.isnan(plan.ddq).all()


def test_wrong_length_is_told(tmp_path: Path) -> None:
    path = write(tmp_path / 'bag', trajectory_bytes(['a', 'b'], [{'positions': [1.0]}]))
    sentence = r'^positions of a point on /plan in .*bag must have 2 values, not 1; record the'
    with pytest.raises(SourceError, match=sentence):
        read_trajectory(path)


def test_no_points_is_told(tmp_path: Path) -> None:
    path = write(tmp_path / 'bag', trajectory_bytes(['a'], []))
    sentence = r'^/plan in .*bag must hold a trajectory with points, but holds none; record the pl'
    with pytest.raises(SourceError, match=sentence):
        read_trajectory(path)


@pytest.mark.parametrize(('topic', 'subject'), [('', 'one topic'), ('/plan', '/plan')])
def test_no_such_topic_is_told(tmp_path: Path, topic: str, subject: str) -> None:
    path = write_folder(tmp_path / 'bag', moving(3))
    sentence = rf'^{subject} of {TRAJECTORY} must be in .*bag, which has none; name one'
    with pytest.raises(SourceError, match=sentence):
        read_trajectory(path, topic)


def test_real_plan_is_read_though_its_metadata_names_another_file(shared_data: Path) -> None:
    plan = read_trajectory(shared_data / 'unisa_ros2_bags' / 'ur10_validation')
    assert plan.q.shape == plan.dq.shape == plan.ddq.shape == plan.tau.shape == (3441, 6)
    assert np.isfinite(plan.tau).all()
    assert plan.joint_names[0] == 'shoulder_pan_joint'
