"""A real controller manager with mock hardware: its URDF, its parameters and its processes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
import json
import os
from pathlib import Path
import subprocess
from typing import Any

from rclpy.node import Node
from std_msgs.msg import String

from lip_id_ros.nodes import qos

GAINS = {'p': 20.0, 'd': 2.0, 'i': 0.0, 'antiwindup_strategy': 'none'}
JTC = 'joint_trajectory_controller/JointTrajectoryController'
STATES = ('position', 'velocity', 'effort')
NAME = 'arm_controller'


def description(joints: Sequence[str], speed: float | None = None) -> str:
    """
    Return a URDF of mock hardware: efforts are mirrored, positions too where commanded.

    `speed`: a factor on the time of plans, in the state interface speed/factor.
    """
    links = ['base', *(f'{joint}_link' for joint in joints)]
    tree = [f'<link name="{link}"/>' for link in links]
    tags = []
    for joint, parent, child in zip(joints, links, links[1:], strict=False):
        tree.append(
            f'<joint name="{joint}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{child}"/><axis xyz="0 0 1"/>'
            '<limit lower="-3" upper="3" velocity="9" effort="1000"/></joint>'
        )
        commands = [f'<command_interface name="{each}"/>' for each in ('position', 'effort')]
        states = [
            f'<state_interface name="{each}"><param name="initial_value">0.0</param>'
            '</state_interface>'
            for each in STATES
        ]
        tags.append(f'<joint name="{joint}">{"".join([*commands, *states])}</joint>')
    if speed is not None:
        tags.append(
            '<gpio name="speed"><state_interface name="factor">'
            f'<param name="initial_value">{speed}</param></state_interface></gpio>'
        )
    hardware = '<hardware><plugin>mock_components/GenericSystem</plugin></hardware>'
    return (
        f'<robot name="arm">{"".join(tree)}<ros2_control name="arm" type="system">{hardware}'
        f'{"".join(tags)}</ros2_control></robot>'
    )


def trajectory_controller(
    joints: Sequence[str], command_interfaces: Sequence[str] = ('effort',), **more: Any
) -> dict[str, Any]:
    """Return parameters of a joint_trajectory_controller."""
    return {
        'joints': list(joints),
        'command_interfaces': list(command_interfaces),
        'state_interfaces': ['position', 'velocity'],
        'gains': dict.fromkeys(joints, GAINS),
        **more,
    }


def write_parameters(
    path: Path, rate_hz: int, controllers: dict[str, tuple[str, dict[str, Any]]]
) -> Path:
    """Write a file for the manager and its controllers: name, type and parameters."""
    manager: dict[str, Any] = {'update_rate': rate_hz}
    content: dict[str, Any] = {'controller_manager': {'ros__parameters': manager}}
    for name, (kind, parameters) in controllers.items():
        manager[name] = {'type': kind, 'params_file': [str(path)]}
        content[name] = {'ros__parameters': parameters}
    path.write_text(json.dumps(content))  # which is YAML too
    return path


@contextmanager
def controlled(
    node: Node,
    joints: Sequence[str],
    folder: Path,
    rate_hz: int,
    program: Sequence[str] | None = None,
    beside: Mapping[str, str] | None = None,
    **more: Any,
) -> Iterator[subprocess.Popen[bytes]]:
    """
    Run a manager with an active joint_trajectory_controller; `node` has its URDF.

    `program`: takes the place of ros2_control_node. `beside`: names and types of other controllers
    without parameters. `more`: parameters of the controller.

    """
    controllers = {NAME: (JTC, trajectory_controller(joints, **more))}
    controllers |= {name: (kind, {}) for name, kind in (beside or {}).items()}
    parameters = write_parameters(folder / 'controllers.yaml', rate_hz, controllers)
    latched = node.create_publisher(String, '/robot_description', qos.LATCHED)
    latched.publish(String(data=description(joints)))
    with open(folder / 'controller_manager.log', 'wb') as log:
        program = program or [_program('ros2_control_node')]
        command = [*program, '--ros-args', '--params-file', str(parameters)]
        manager = subprocess.Popen(command, stdout=log, stderr=log)
        try:
            subprocess.run([_program('spawner'), *controllers], stdout=log, stderr=log, check=True)
            yield manager
        finally:
            manager.terminate()
            manager.wait()


def _program(name: str) -> str:
    """Return a program of the package controller_manager."""
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    places = (Path(prefix) / 'lib' / 'controller_manager' / name for prefix in prefixes)
    for place in places:
        if place.is_file():
            return str(place)
    raise FileNotFoundError(f'no {name} of controller_manager; with g++ make setup compiles it')
