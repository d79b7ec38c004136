"""Launch files: they start what they say, in any namespace, and end in good order."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import subprocess
import sys
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')

from ament_index_python.packages import get_package_share_path, PackageNotFoundError
from nodes.test_serve import GOOD
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.demo.processes import end
from lip_id_ros.recording import read_bag

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


def test_two_arms_are_recorded_side_by_side(ros: tuple[Graph, Client], tmp_path: Path) -> None:
    graph, client = ros
    for arm in ('left', 'right'):
        (tmp_path / arm).mkdir()
    (tmp_path / 'arm.yaml').write_text(
        '/**/train:\n  ros__parameters: {record_on_start: true, recording: {joints: [b, a]}}\n'
    )
    left = ('namespace:=left', 'folder:=left', 'params_file:=arm.yaml')
    right = ('namespace:=right', 'folder:=right', 'joint_states:=/cell/right/states')
    with (
        launched(graph, 'train.launch.py', *left),
        launched(graph, 'train.launch.py', *right, f'params_file:={tmp_path / "arm.yaml"}'),
    ):
        for arm, topic, value in (
            ('left', '/left/joint_states', 1.0),
            ('right', '/cell/right/states', 2.0),
        ):
            publisher = client.speak(JointState, topic)
            assert client.status(f'{arm}/train', lambda status: True)['rows'] == 0
            message = JointState(name=['a', 'b'], position=[value, -value])

            def keeps_moving(message: JointState = message, publisher: Any = publisher) -> None:
                message.header.stamp.sec += 1
                publisher.publish(message)

            timer = client.node.create_timer(0.01, keeps_moving)
            client.status(f'{arm}/train', lambda status: status['rows'] >= 10)
            timer.cancel()
    for arm, value in (('left', 1.0), ('right', 2.0)):
        kept = read_bag(tmp_path / arm / 'unsaved.mcap')
        assert kept.joint_names == ('b', 'a')
        assert kept.n_samples >= 10
        assert (kept.position == [-value, value]).all()
    assert not (tmp_path / 'unsaved.mcap').exists()


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
