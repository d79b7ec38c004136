"""config/controllers.yaml and commands of docs/how-to/controllers.md, with the real manager."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TYPE_CHECKING

import pytest

pytest.importorskip('rclpy', reason='needs ROS 2')
pytest.importorskip('controller_manager_msgs')

from ros2_control.arm import controlled
from ros2_control.test_goals import ACTION
from sensor_msgs.msg import JointState
import yaml

from benchmarks._mock_controller import JTC

if TYPE_CHECKING:
    from ros2_control.arm import Control

pytestmark = [pytest.mark.ros, pytest.mark.ros2_control]

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / 'config' / 'controllers.yaml'
FILES = [FILE, FILE.with_name('controllers_ur.yaml')]
FORWARD = 'forward_command_controller/ForwardCommandController'
LINES = (ROOT / 'docs/how-to/controllers.md').read_text(encoding='utf-8').splitlines()
COMMANDS = [line for line in LINES if line.startswith('ros2 run controller_manager spawner')]


def joints(file: Path = FILE) -> list[str]:
    return list(yaml.safe_load(file.read_text())['arm_controller']['ros__parameters']['joints'])


def run(control: Control, command: str, file: Path = FILE) -> None:
    """Run a command `ros2 run` of the page beside a copy of a file."""
    package, program, *arguments = command.split()[2:]
    arguments = [each.replace('controllers.yaml', str(file)) for each in arguments]
    assert control.graph.start_installed(package, program, arguments).wait() == 0


@pytest.mark.parametrize('file', FILES, ids=lambda file: file.stem)
def test_a_file_loads_as_the_page_has_it(tmp_path: Path, file: Path) -> None:
    with controlled(tmp_path, file, joints(file)) as control:
        assert len(COMMANDS) == 2
        run(control, COMMANDS[0], file)
        assert control.states() == {
            'joint_state_broadcaster': 'active',
            'arm_controller': 'active',
        }
        heard: list[Any] = control.client.listen(JointState, '/joint_states')
        control.client.wait_until(lambda: heard, 'joint states')
        assert list(heard[0].name) == joints(file)
        assert list(heard[0].effort) == [0.0] * len(joints(file))
        if control.has_type(FORWARD):  # which the PyPI wheel has not
            run(control, COMMANDS[1], file)
            assert control.states()['torque_controller'] == 'inactive'


def test_the_spawner_needs_no_file_where_the_manager_has_params_file(tmp_path: Path) -> None:
    content = yaml.safe_load(FILE.read_text())
    manager = content['controller_manager']['ros__parameters']
    path = tmp_path / 'controllers.yaml'
    assert manager['arm_controller'] == {'type': JTC}
    manager['arm_controller']['params_file'] = str(path)
    path.write_text(yaml.safe_dump(content))
    with controlled(tmp_path, path, joints()) as control:
        run(control, 'ros2 run controller_manager spawner arm_controller')
        assert control.states() == {'arm_controller': 'active'}


def test_moveit_finds_the_action_of_serve_and_the_joints_of_the_controller() -> None:
    moveit = yaml.safe_load((FILE.parent / 'moveit_controllers.yaml').read_text())
    manager = moveit['moveit_simple_controller_manager']
    (name,) = manager['controller_names']
    assert f'/{name}/{manager[name]["action_ns"]}' == ACTION
    assert manager[name]['type'] == 'FollowJointTrajectory'
    assert manager[name]['joints'] == joints()
