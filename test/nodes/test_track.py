"""A learned model in a closed loop of real processes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('pinocchio', reason='needs pinocchio (the extra sim)')

from ament_index_python.packages import get_package_share_path, PackageNotFoundError
from lifecycle_msgs.msg import Transition
import numpy as np
from rclpy.qos import HistoryPolicy, QoSProfile
from sensor_msgs.msg import JointState
import yaml

from benchmarks.tracking import Experiment, run_experiment
from lip_id_ros.control.settings import Gains
from lip_id_ros.settings import FitSettings, PreprocessingSettings
from lip_id_ros.simulation import GrowingCosine
from lip_id_ros.simulation.torque_controlled import panda_setup, POSTURE

if TYPE_CHECKING:
    from nodes.ros_graph import Ros

try:
    get_package_share_path('lip_id_ros')
except PackageNotFoundError:
    pytest.skip('the package is not built; run make setup', allow_module_level=True)

from nodes.test_launch import launched

pytestmark = [pytest.mark.ros, pytest.mark.slow]

ALL = QoSProfile(history=HistoryPolicy.KEEP_ALL)
HORIZON = 2.0


@pytest.fixture(scope='module')
def panda_model(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Model of two joints of the simulated Panda, learned in closed loop."""
    experiment = Experiment(
        horizon=6.0,  # less motion proves nothing
        amplitudes=(),
        preprocessing=PreprocessingSettings(cutoff_hz=12.5, max_samples=120),
        fit=FitSettings(subset=60, iterations=15),
    )
    path = tmp_path_factory.mktemp('panda') / 'panda.npz'
    run_experiment(panda_setup(2), experiment, 1).model.save(path)
    return str(path)


def test_the_arm_follows_the_reference_through_serve_and_controller(
    ros: Ros, panda_model: str, tmp_path: Path
) -> None:
    graph, client = ros
    config = yaml.safe_load(
        (get_package_share_path('lip_id_ros') / 'config' / 'track.yaml').read_text()
    )
    for node in config.values():
        node['ros__parameters'] = {
            name: value[:2] if isinstance(value, list) else value
            for name, value in node['ros__parameters'].items()
        }
    (tmp_path / 'two.yaml').write_text(yaml.safe_dump(config))

    with launched(
        graph, 'track.launch.py', f'model_path:={panda_model}', 'n_joints:=2', 'autostart:=false',
        f'horizon:={HORIZON}', f'params_file:={tmp_path / "two.yaml"}', 'namespace:=cell',
    ):  # fmt: skip
        states = client.listen(JointState, '/cell/joint_states', ALL)
        commands = client.listen(JointState, '/cell/computed_torque/command', ALL)
        # the arm stands until `serve` is active, and the motion begins with the stamp it stands at
        client.wait_until(lambda: states, 'the first joint state')
        assert client.transition(Transition.TRANSITION_CONFIGURE, '/cell/serve')
        assert client.transition(Transition.TRANSITION_ACTIVATE, '/cell/serve')
        client.wait_until(lambda: seconds(list(states))[-1] > HORIZON, 'the end of the motion')

    heard = list(states)  # `states` may still grow
    t = seconds(heard)
    q = np.array([state.position for state in heard])
    reference = GrowingCosine(np.array(POSTURE[:2]), 0.6, HORIZON)
    moving = t <= HORIZON
    error = np.array(q[moving]) - reference.sample(t[moving])[0]
    np.testing.assert_allclose(q[0], POSTURE[:2], atol=1e-3)  # at rest
    assert np.ptp(q, axis=0).min() > 0.5
    # the reference starts with a velocity, the arm at rest
    assert np.sqrt(np.mean(error[t[moving] > 0.5] ** 2)) < 2e-3
    efforts = np.array([command.effort for command in list(commands)])
    assert np.isfinite(efforts).all()
    assert np.all(np.abs(efforts) <= 87.0)


def seconds(states: list[JointState]) -> np.ndarray:
    """Times since the first stamp."""
    stamps = [state.header.stamp.sec + 1e-9 * state.header.stamp.nanosec for state in states]
    return np.asarray(np.array(stamps or [0.0]) - (stamps or [0.0])[0])


def test_gains_of_the_launch_file_are_those_of_the_experiment() -> None:
    config = yaml.safe_load(
        (get_package_share_path('lip_id_ros') / 'config' / 'track.yaml').read_text()
    )
    found = config['/**/computed_torque']['ros__parameters']
    expected: Gains = panda_setup().gains
    np.testing.assert_array_equal(found['stiffness'], expected.stiffness)
    np.testing.assert_array_equal(found['damping'], expected.damping)
    assert tuple(found['joints']) == panda_setup().arm.joint_names
