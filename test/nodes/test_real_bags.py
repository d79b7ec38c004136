"""Real bags, replayed into real nodes."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import numpy as np
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.config import Config, FitSettings, PreprocessingSettings, RecordingSettings
from lip_id_ros.gp import fit
from lip_id_ros.preprocessing import load_dataset
from lip_id_ros.recording import read_trajectory

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Graph

pytestmark = [pytest.mark.ros, pytest.mark.slow]

BAGS = 'unisa_ros2_bags'
UR10_JOINTS = (
    'shoulder_pan_joint',
    'shoulder_lift_joint',
    'elbow_joint',
    'wrist_1_joint',
    'wrist_2_joint',
    'wrist_3_joint',
)


def replay(graph: Graph, bag: Path, *arguments: str) -> None:
    command = [sys.executable, '-m', 'lip_id_ros.nodes.replay', str(bag), *arguments]
    subprocess.run(
        command, env=graph.environment, check=True, timeout=120, capture_output=True, text=True
    )


def test_a_folder_without_a_bag_gives_one_line(ros: tuple[Graph, Client], tmp_path: Path) -> None:
    with pytest.raises(subprocess.CalledProcessError) as failed:
        replay(ros[0], tmp_path / 'absent')
    assert failed.value.returncode == 1
    assert 'No such file or directory' in failed.value.stderr
    assert 'Traceback' not in failed.value.stderr


@pytest.fixture(scope='module')
def ur10_model(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    config = Config(
        recording=RecordingSettings(joints=UR10_JOINTS),
        preprocessing=PreprocessingSettings(decimate=20),
        fit=FitSettings(subset=60, max_samples=150, iterations=20),
    )
    path = tmp_path_factory.mktemp('model') / 'ur10.npz'
    fit(load_dataset([shared_data / BAGS / 'ur10'], config), config.fit).save(path)
    return str(path)


def test_a_ur10_is_served_its_own_validation_trajectory(
    ros: tuple[Graph, Client], shared_data: Path, ur10_model: str
) -> None:
    graph, client = ros
    graph.start('serve', model_path=ur10_model, torque_limits=[330.0] * 2 + [150.0] + [56.0] * 3)
    plans = client.listen(JointTrajectory, '/serve/trajectory_with_effort')
    client.status('serve', lambda status: status['state'] == 'active')
    bag = shared_data / BAGS / 'ur10_validation'
    remap = '/joint_space_trajectory:=/serve/desired_trajectory'
    replay(graph, bag, '--ros-args', '-r', remap)
    client.wait_until(lambda: plans, 'the plan')
    planned = read_trajectory(bag)
    assert tuple(plans[0].joint_names) == planned.joint_names
    served = np.array([point.effort for point in plans[0].points])
    assert served.shape == planned.tau.shape
    assert np.isfinite(served).all()
    # the bag's efforts are those of its authors' own model
    for joint, theirs in enumerate(planned.tau.T):
        assert np.corrcoef(served[:, joint], theirs)[0, 1] > 0.9, planned.joint_names[joint]


def test_a_panda_is_recorded_with_nothing_lost(
    ros: tuple[Graph, Client], shared_data: Path
) -> None:
    graph, client = ros
    graph.start('train', record_on_start=True)
    client.status('train', lambda status: True)
    replay(graph, shared_data / BAGS / 'panda', '--speed', '10')
    status = client.status('train', lambda status: status['rows'] == 727)
    assert status['rejected'] == {}
    assert client.trigger('/train/save_dataset').success
