"""A real controller manager with mock hardware, for arms of a few joints, and its services."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any

from controller_manager_msgs.srv import (
    CleanupController,
    ConfigureController,
    ListControllers,
    ListControllerTypes,
    LoadController,
    SwitchController,
    UnloadController,
)
from nodes import toy
from nodes.ros_graph import Client, Graph, graph, Process
import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos

GAINS = {'p': 20.0, 'd': 2.0, 'i': 0.0, 'antiwindup_strategy': 'none'}
RATE_HZ = 100
JTC = 'joint_trajectory_controller/JointTrajectoryController'
BROADCASTER = 'joint_state_broadcaster'
STATES = ('position', 'velocity', 'effort')


def description(joints: Sequence[str]) -> str:
    """Return a URDF of mock hardware: efforts are mirrored, positions too where commanded."""
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


def write_parameters(path: Path, controllers: dict[str, tuple[str, dict[str, Any]]]) -> Path:
    """Write a file for the manager and its controllers: name, type and parameters."""
    manager: dict[str, Any] = {'update_rate': RATE_HZ}
    content: dict[str, Any] = {'controller_manager': {'ros__parameters': manager}}
    for name, (kind, parameters) in controllers.items():
        manager[name] = {'type': kind, 'params_file': [str(path)]}
        content[name] = {'ros__parameters': parameters}
    path.write_text(json.dumps(content))  # which is YAML too
    return path


@dataclass
class Control:
    """A controller manager in a graph."""

    graph: Graph
    client: Client
    process: Process

    def call(self, kind: Any, service: str, **fields: Any) -> Any:
        return self.client.call(kind, f'/controller_manager/{service}', kind.Request(**fields))

    def load(self, name: str) -> bool:
        """Load and configure a controller."""
        return bool(
            self.call(LoadController, 'load_controller', name=name).ok
            and self.call(ConfigureController, 'configure_controller', name=name).ok
        )

    def switch(self, activate: Sequence[str] = (), deactivate: Sequence[str] = ()) -> bool:
        answer = self.call(
            SwitchController,
            'switch_controller',
            activate_controllers=list(activate),
            deactivate_controllers=list(deactivate),
            strictness=SwitchController.Request.STRICT,
        )
        return bool(answer.ok)

    def unload(self, name: str) -> bool:
        """Unload a controller, whose states are heard no more."""
        self.client.forget(f'/{name}/controller_state')
        return bool(
            self.call(CleanupController, 'cleanup_controller', name=name).ok
            and self.call(UnloadController, 'unload_controller', name=name).ok
        )

    def states(self) -> dict[str, str]:
        """State of each controller that is loaded."""
        answer = self.call(ListControllers, 'list_controllers')
        return {each.name: each.state for each in answer.controller}

    def has_type(self, kind: str) -> bool:
        return kind in self.call(ListControllerTypes, 'list_controller_types').types

    def use(self, name: str) -> None:
        """Have one trajectory controller active, and no other."""
        states = self.states()
        if name not in states:
            assert self.load(name), self.process.log
        active = [
            other
            for other, state in states.items()
            if state == 'active' and other not in (name, BROADCASTER)
        ]
        if states.get(name) != 'active' or active:
            starting = [] if states.get(name) == 'active' else [name]
            assert self.switch(starting, active), self.process.log


@contextmanager
def controlled(folder: Path, parameters: Path, joints: Sequence[str]) -> Iterator[Control]:
    """Run a controller manager while the block runs."""
    with graph(folder) as (made, client):
        process = made.start_installed(
            'controller_manager',
            'ros2_control_node',
            ['--ros-args', '--params-file', str(parameters)],
        )
        latched = client.node.create_publisher(String, '/robot_description', qos.LATCHED)
        latched.publish(String(data=description(joints)))
        yield Control(made, client, process)


def way(
    start: Sequence[float], end: Sequence[float], seconds: float, n_points: int = 11
) -> tuple[Array, Array, Array, Array]:
    """Times (N,), positions, velocities and accelerations (N, n) from rest to rest."""
    t = np.linspace(0.0, seconds, n_points)
    s = (t / seconds)[:, np.newaxis]
    distance = np.subtract(end, start)
    q = start + distance * s**3 * (10 - 15 * s + 6 * s**2)
    dq = distance * 30 * s**2 * (1 - s) ** 2 / seconds
    ddq = distance * 60 * s * (1 - s) * (1 - 2 * s) / seconds**2
    return t, q, dq, ddq


def plan(
    end: Sequence[float] = (0.4, -0.3), seconds: float = 0.5, n_points: int = 11
) -> JointTrajectory:
    """Return a plan of the toy arm from where mock hardware stands; it begins at once."""
    t, q, dq, ddq = way([0.0] * len(end), end, seconds, n_points)
    # the controller refuses a plan whose first point has passed, so leave it out
    return messages.plan_message(toy.JOINTS, t[1:], q[1:], dq[1:], ddq[1:])


def efforts(trajectory: JointTrajectory) -> Array:
    """Efforts of a plan of shape (N, n) [N m]."""
    return np.array([point.effort for point in trajectory.points])


def times(points: Sequence[Any]) -> Array:
    """When points of a plan are reached [s]."""
    after = [point.time_from_start for point in points]
    return np.array([each.sec + 1e-9 * each.nanosec for each in after])


def commanded(state: Any) -> Array:
    """Effort that a controller adds to its feedback, shape (n,) [N m], from its state message."""
    feedback = GAINS['p'] * np.array(state.error.positions)
    feedback += GAINS['d'] * np.array(state.error.velocities)
    return np.asarray(state.output.effort - feedback)


def published_effort(message: JointState) -> Array:
    """Efforts of a joint state in the order of the toy arm [N m]."""
    by_name = dict(zip(message.name, message.effort, strict=True))
    return np.array([by_name[joint] for joint in toy.JOINTS])
