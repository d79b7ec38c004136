"""Launch files: they start what they say, in any namespace, and end in good order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from ament_index_python.packages import get_package_share_path, PackageNotFoundError
from nodes.test_serve import GOOD
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.demo.processes import end

if TYPE_CHECKING:
    from nodes.ros_graph import Client, Graph

try:
    get_package_share_path('lip_id_ros')
except PackageNotFoundError:
    pytest.skip('the package is not built; run make setup', allow_module_level=True)

pytestmark = pytest.mark.ros


@contextmanager
def launched(graph: Graph, name: str, *arguments: str) -> Iterator[Path]:
    """Run a launch file of the package while the block runs; give the log."""
    log_path = graph.folder / f'{name}.log'
    with open(log_path, 'wb') as log:
        process = subprocess.Popen(
            [sys.executable, '-m', 'lip_id_ros.demo.launching', name, *arguments],
            env=graph.environment,
            cwd=graph.folder,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        yield log_path
    finally:
        end(process)
    assert process.returncode == 0, log_path.read_text()


def test_two_arms_are_served_side_by_side(ros: tuple[Graph, Client], model_path: str) -> None:
    graph, client = ros
    with (
        launched(graph, 'serve.launch.py', f'model_path:={model_path}', 'namespace:=left'),
        launched(graph, 'serve.launch.py', f'model_path:={model_path}', 'namespace:=right'),
    ):
        left = client.listen(JointState, '/left/serve/feedforward_torque')
        right = client.listen(JointState, '/right/serve/feedforward_torque')
        publisher = client.speak(JointTrajectory, '/left/serve/desired_trajectory')
        for name in ('left/serve', 'right/serve'):
            client.status(name, lambda status: status['state'] == 'active')
        publisher.publish(GOOD)
        client.wait_until(lambda: left, 'answer')
        assert not right


def test_train_takes_its_parameters_from_a_file(ros: tuple[Graph, Client]) -> None:
    graph, client = ros
    share = get_package_share_path('lip_id_ros')
    panda = share / 'config' / 'panda.yaml'
    with launched(graph, 'train.launch.py', f'params_file:={panda}', 'namespace:=arm'):
        status = client.status('arm/train', lambda status: True)
    assert status['joint_names'] == [f'panda_joint{number}' for number in range(1, 8)]


def test_the_node_ends_well_with_its_launch(ros: tuple[Graph, Client], model_path: str) -> None:
    graph, client = ros
    with launched(graph, 'serve.launch.py', f'model_path:={model_path}') as log:
        client.status('serve', lambda status: status['state'] == 'active')
    assert 'process has finished cleanly' in log.read_text()
