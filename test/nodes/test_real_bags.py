"""Real bags, published into real nodes."""

from __future__ import annotations

from pathlib import Path
import time
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

import numpy as np
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lip_id_ros.identification import fit
from lip_id_ros.loading import load_dataset
from lip_id_ros.nodes import messages, qos
from lip_id_ros.recording import Bag, read_bag
from lip_id_ros.settings import Config, FitSettings, PreprocessingSettings, RecordingSettings

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

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


def test_a_ur10_is_served_its_own_plan(ros: Ros, shared_data: Path, ur10_model: str) -> None:
    graph, client = ros
    graph.start('serve', model_path=ur10_model, torque_limits=[330.0] * 2 + [150.0] + [56.0] * 3)
    plans = client.listen(JointTrajectory, '/serve/trajectory_with_effort')
    client.status('serve', lambda status: status['state'] == 'active')
    with Bag(shared_data / BAGS / 'ur10_validation') as bag:
        _, planned = next(bag.messages('/joint_space_trajectory'))
    kinds = ('positions', 'velocities', 'accelerations')
    states = [np.array([getattr(each, kind) for each in planned.points]) for kind in kinds]
    after = [each.time_from_start for each in planned.points]
    t = np.array([each.sec + 1e-9 * each.nanosec for each in after])
    plan = messages.plan_message(planned.joint_names, t, *states)
    client.speak(JointTrajectory, '/serve/desired_trajectory').publish(plan)
    client.wait_until(lambda: plans, 'the plan')
    expected = np.array([point.effort for point in planned.points])
    assert list(plans[0].joint_names) == list(planned.joint_names)
    served = np.array([point.effort for point in plans[0].points])
    assert served.shape == expected.shape
    assert np.isfinite(served).all()
    # the bag's efforts are those of its authors' own model
    for joint, theirs in enumerate(expected.T):
        assert np.corrcoef(served[:, joint], theirs)[0, 1] > 0.9, planned.joint_names[joint]


PANDA_JOINTS = tuple(f'fer_joint{number}' for number in range(1, 8))
PANDA_LIMITS = [87.0] * 4 + [12.0] * 3


def test_a_panda_is_recorded_and_served(ros: Ros, shared_data: Path, tmp_path: Path) -> None:
    """docs/tutorials/record-fit-serve.md, at ten times the speed and with a smaller fit."""
    graph, client = ros
    path = tmp_path / 'panda.yaml'
    path.write_text(
        f"""
/**/train:
  ros__parameters:
    holdout: 0.3
    recording: {{joints: [{', '.join(PANDA_JOINTS)}]}}
    fit: {{subset: 60, max_samples: 200, iterations: 15}}
/**/serve:
  ros__parameters:
    joints: [{', '.join(PANDA_JOINTS)}]
    torque_limits: {PANDA_LIMITS}
    ramp_s: 0.0
"""
    )
    train = graph.start_with('train', ['--params-file', str(path)])
    assert client.switch('/train/record', True).success
    recorded = read_bag(shared_data / BAGS / 'panda')
    publisher = client.speak(JointState, '/joint_states', qos.OUTPUT)
    names = recorded.joint_names
    for t, *values in zip(
        recorded.t, recorded.position, recorded.velocity, recorded.effort, strict=True
    ):
        stamp = messages.stamp_at(round(1e9 * t))
        publisher.publish(messages.joint_state_message(stamp, names, *values))
        time.sleep(0.003)
    # joint states are best effort: a loaded machine may lose some of the 727
    status = client.status('train', lambda status: status['rows'] >= 700)
    assert status['rejected'] == {}
    assert client.trigger('/train/fit').success
    status = client.status('train', lambda status: status['job']['state'] in ('done', 'failed'))
    assert status['job']['state'] == 'done', train.log
    held_out = status['job']['result']['holdout']
    assert held_out['n_samples'] > 150
    # joints 1 and 5 carry little torque in this recording; 2, 3 and 4 carry the arm
    assert max(held_out['nmse_percent'][1:4]) < 10
    graph.start_with('serve', ['--params-file', str(path), '-p', 'autostart:=true'])
    answers = client.listen(JointState, '/serve/feedforward_torque')
    client.status('serve', lambda status: status['state'] == 'active')
    references = client.speak(JointTrajectory, '/serve/desired_trajectory')
    point = JointTrajectoryPoint(positions=recorded.position[400].tolist())
    point.velocities = recorded.velocity[400].tolist()
    point.accelerations = [0.0] * 7
    references.publish(JointTrajectory(joint_names=list(PANDA_JOINTS), points=[point]))
    client.wait_until(lambda: answers, 'answer')
    assert tuple(answers[0].name) == PANDA_JOINTS
    served, measured = np.array(answers[0].effort), recorded.effort[400]
    assert (np.abs(served) <= PANDA_LIMITS).all()
    # within what acceleration and noise make; the arm's own weight is tens of N m
    np.testing.assert_allclose(served, measured, atol=4.0)
