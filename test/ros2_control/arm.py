"""A real controller manager with mock hardware, for arms of a few joints, and its services."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
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

from benchmarks._mock_controller import description, GAINS
from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos

RATE_HZ = 100
LIMIT_S = 120.0
"""
Of one wait once all have started. The manager computes for ever, so that it never looks idle;
what is asked of it is done in seconds, or never.
"""
MISSING = 'no controller offers the action'
BROADCASTER = 'joint_state_broadcaster'


@dataclass
class Control:
    graph: Graph
    client: Client
    process: Process
    served: str = ''  # the controller that `serve` sends plans to

    def call(self, kind: Any, service: str, **fields: Any) -> Any:
        return self.client.call(kind, f'/controller_manager/{service}', kind.Request(**fields))

    def load(self, name: str) -> bool:
        """Load and configure a controller; `serve` knows it then, where it is for that."""
        loaded = bool(
            self.call(LoadController, 'load_controller', name=name).ok
            and self.call(ConfigureController, 'configure_controller', name=name).ok
        )
        if loaded and name == self.served:
            self._await_serve(True)
        return loaded

    def _await_serve(self, knows: bool) -> None:
        """
        Wait until `serve` knows the controller, or that it has ended.

        Else it publishes the next plan to nobody. It has the controller's action once that warning
        ends, and the topic of its plans, which the controller makes before the action.

        """
        self.client.status('serve', lambda status: knows != (MISSING in status['summary']))

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
        unloaded = bool(
            self.call(CleanupController, 'cleanup_controller', name=name).ok
            and self.call(UnloadController, 'unload_controller', name=name).ok
        )
        if unloaded and name == self.served:
            self._await_serve(False)
        return unloaded

    def states(self) -> dict[str, str]:
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

    def use_anew(self, name: str) -> None:
        """Have one trajectory controller active that knows nothing of tests before."""
        self.use(name)
        assert self.switch(deactivate=[name])
        assert self.unload(name)
        self.use(name)


@contextmanager
def controlled(
    folder: Path, parameters: Path, joints: Sequence[str], speed: float | None = None
) -> Iterator[Control]:
    with graph(folder) as (made, client):
        process = made.start_installed(
            'controller_manager',
            'ros2_control_node',
            ['--ros-args', '--params-file', str(parameters)],
        )
        latched = client.node.create_publisher(String, '/robot_description', qos.LATCHED)
        latched.publish(String(data=description(joints, speed)))
        yield Control(made, client, process)


@contextmanager
def served(
    folder: Path, parameters: Path, model_path: str, speed: float | None = None
) -> Iterator[Control]:
    """Run a controller manager of the toy arm, and a `serve` that fills plans for `arm`."""
    with controlled(folder, parameters, toy.JOINTS, speed) as made:
        made.graph.start_with(
            'serve',
            [
                *('-p', f'model_path:={model_path}', '-p', f'torque_limits:=[{toy.LIMIT}]'),
                *('-p', 'ramp_s:=0.0', '-p', 'stale_timeout_s:=0.0', '-p', 'autostart:=true'),
                *('-p', 'controller_action:=/arm/follow_joint_trajectory'),
                *('-p', 'follow_controller:=true'),
                *('-r', '~/controller_state:=/arm/controller_state'),
                *('-r', '~/trajectory_with_effort:=/arm/joint_trajectory'),
            ],
        )
        assert made.load(BROADCASTER)
        assert made.switch([BROADCASTER])
        made.client.status('serve', lambda status: status['state'] == 'active')
        made.client.limit_s, made.served = LIMIT_S, 'arm'
        yield made


def hear_until_now(control: Control, states: list[Any]) -> None:
    """Wait until states have come that are younger than this call: they may be seconds late."""
    now = control.client.node.get_clock().now().nanoseconds
    control.client.wait_until(
        lambda: states and messages.nanoseconds(states[-1].header.stamp) > now, 'states'
    )


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
