"""
Hostile messages and requests to all nodes: none ends, and their counters add up.

Every message that a node receives is used or refused by a reason. Torques are finite and within
their limits, whatever was asked and whenever it was sent. Lifecycle transitions, parameters of
absurd types and reloads come in between.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
import json
from pathlib import Path
import tempfile
import time
from typing import Any

from control_msgs.msg import JointTrajectoryControllerState
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Inertia, InertiaStamped, Vector3
from lifecycle_msgs.srv import ChangeState
import numpy as np
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from benchmarks._cells import running
from benchmarks._hostile import (
    counts,
    hostile_controller_state,
    hostile_states,
    hostile_trajectory,
    ODD,
    USES,
)
from benchmarks._serve_client import spun
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification import fit
from lip_id_ros.nodes import messages, qos
from lip_id_ros.settings import FitSettings

NAMES = ('a', 'b')
LIMITS = (5.0, 3.0)
BATCH, PACE_S, LOST_SECONDS, START_SECONDS = 200, 0.004, 60.0, 600.0
Status = Mapping[str, Any]


@dataclass
class Answers:
    """Messages of the nodes, counted."""

    statuses: dict[str, Status] = field(default_factory=dict)
    torques: int = 0
    unsafe: int = 0

    def status(self, name: str, message: DiagnosticStatus) -> None:
        """Keep the newest status of a node."""
        self.statuses[name] = messages.status_values(message)

    def torque(self, message: JointState) -> None:
        """Count a torque, and whether it is unsafe."""
        effort = np.asarray(message.effort)
        self.torques += 1
        self.unsafe += not (effort.shape == (2,) and bool((np.abs(effort) <= LIMITS).all()))


def main(arguments: list[str]) -> int:
    """Send hostile messages to every node; print the counters."""
    parser = argparse.ArgumentParser(prog='benchmarks fuzz_nodes', description=__doc__)
    parser.add_argument('--messages', type=int, default=20_000, help='how many are published')
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args(arguments)
    rclpy.init()
    node = rclpy.create_node('fuzzer')
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        model, arm = (str(Path(folder) / f'{name}.npz') for name in ('model', 'arm'))
        small_model('recursive').save(model)
        small_model('articulated').save(arm)
        processes = {
            name: stack.enter_context(running(name, parameters))
            for name, parameters in parameters_of(model, arm, folder).items()
        }
        stack.enter_context(spun(node))
        fuzzer = Fuzzer(node, np.random.default_rng(options.seed))
        fuzzer.run(options.messages)
        ended = [name for name, process in processes.items() if process.poll() is not None]
    return report(fuzzer, ended)


def report(fuzzer: Fuzzer, ended: list[str]) -> int:
    """Print the counters of every node; return 1 where they do not add up, or a node ended."""
    wrong = len(ended) + fuzzer.answers.unsafe
    for name, sent in fuzzer.sent.items():
        status = fuzzer.answers.statuses[name]
        received, accounted = counts(name, status)
        print(f'{name}: sent {sent}, lost on the way {sent - received}, received {received},')
        print(f'  of which used or refused for a reason: {accounted}')
        print(f'  exceptions caught by the guard: {status["faults"]} {status["last_fault"]}')
        wrong += received != accounted or received > sent
    answers = fuzzer.answers
    print(f'torques {answers.torques}, unsafe {answers.unsafe}; requests {fuzzer.n_requests}')
    print(f'nodes that ended: {ended or "none"}')
    return int(wrong > 0)


def small_model(kernel: str) -> Any:
    """Fit two decoupled pendulums, in seconds."""
    t = 0.01 * np.arange(400)[:, np.newaxis]
    angle = t * [1.0, 2.3] + [0.3, 1.0]
    q, dq, ddq = np.sin(angle), np.cos(angle) * [1.0, 2.3], -np.sin(angle) * [1.0, 2.3**2]
    tau = ddq * [1.5, 0.6] + np.sin(q) * [8.0, 3.0]
    data = Dataset.from_arrays(q, dq, ddq, tau, joint_names=NAMES, t=t[:, 0])
    cheap = FitSettings(kernel=kernel, subset=30, max_samples=60, iterations=5, friction=False)
    return fit(data, cheap)


def parameters_of(model: str, arm: str, folder: str) -> dict[str, dict[str, str]]:
    """Return the parameters of each node."""
    joints, limits = json.dumps(NAMES), json.dumps(LIMITS)
    return {
        'serve': {
            'model_path': model,
            'autostart': 'true',
            'accept_unproven': 'true',
            'joints': joints,
            'torque_limits': limits,
            'follow_controller': 'true',
            'stale_policy': 'gravity',
        },
        'train': {
            'record_on_start': 'true',
            'unsaved_path': f'{folder}/unsaved.mcap',
            'max_rows': '3000',
        },
        'monitor': {'model_path': model, 'joints': joints},
        'adapt': {'model_path': arm, 'joints': joints, 'state_path': f'{folder}/adapted.npz'},
    }


class Fuzzer:
    """
    Send messages, with requests in between.

    Parameters
    ----------
    node : Node
        Spun by another thread.
    rng : Generator

    Attributes
    ----------
    answers : Answers
    sent : dict
        Messages by node.
    n_requests : int

    """

    def __init__(self, node: Node, rng: np.random.Generator) -> None:
        self._node, self._rng = node, rng
        self.answers = Answers()
        self.sent = dict.fromkeys(USES, 0)
        self.n_requests = 0
        for name in USES:
            node.create_subscription(
                DiagnosticStatus,
                f'/{name}/status',
                lambda message, name=name: self.answers.status(name, message),
                qos.LATCHED,
            )
        topic = '/serve/feedforward_torque'
        node.create_subscription(JointState, topic, self.answers.torque, qos.OUTPUT)
        self._reference = node.create_publisher(
            JointTrajectory, '/serve/desired_trajectory', qos.REFERENCE
        )
        self._controller = node.create_publisher(
            JointTrajectoryControllerState, '/serve/controller_state', qos.OUTPUT
        )
        self._states = node.create_publisher(JointState, '/joint_states', qos.OUTPUT)
        self._payloads = node.create_publisher(
            InertiaStamped, '/adapt/announced_payload', qos.DIAGNOSTICS
        )
        self._clients = {
            '/serve/change_state': node.create_client(ChangeState, '/serve/change_state'),
            '/serve/enable': node.create_client(SetBool, '/serve/enable'),
            '/serve/reload_model': node.create_client(Trigger, '/serve/reload_model'),
            '/monitor/calibrate': node.create_client(Trigger, '/monitor/calibrate'),
            '/adapt/reset': node.create_client(Trigger, '/adapt/reset'),
            '/train/cancel': node.create_client(Trigger, '/train/cancel'),
            **{
                f'/{name}/set_parameters': node.create_client(
                    SetParameters, f'/{name}/set_parameters'
                )
                for name in USES
            },
        }

    def run(self, n_messages: int) -> None:
        """Send that many messages in all, and requests in between."""
        self._until(lambda: len(self.answers.statuses) == len(USES), START_SECONDS)
        self._until(lambda: self._states.get_subscription_count() == len(USES), START_SECONDS)
        self._until(lambda: self._active(), START_SECONDS)
        states = hostile_states(self._rng, NAMES)
        for number in range(n_messages):
            self._send(next(states), number)
            time.sleep(PACE_S)  # joint states are best effort, ten deep
            if number % BATCH == 0:
                self._request()
        self._until(self._all_counted, LOST_SECONDS)

    def _send(self, state: JointState, number: int) -> None:
        if number % 4 == 1:
            self._reference.publish(hostile_trajectory(self._rng, NAMES))
            self.sent['serve'] += 1
        elif number % 4 == 3:
            self._controller.publish(hostile_controller_state(self._rng, NAMES))
            self.sent['serve'] += 1
        else:
            self._states.publish(state)
            for name in USES:
                self.sent[name] += 1

    def _all_counted(self) -> bool:
        return all(
            counts(name, self.answers.statuses[name])[1] >= sent
            for name, sent in self.sent.items()
        )

    def _active(self) -> bool:
        return bool(self.answers.statuses.get('serve', {}).get('state') == 'active')

    def _request(self) -> None:
        """Call a service with something absurd; leave `serve` active and enabled."""
        name = str(self._rng.choice(list(self._clients)))
        answer = self._clients[name].call_async(absurd_request(self._rng, name))
        if name != '/monitor/calibrate':  # which answers after a minute of motion
            self._until(answer.done, LOST_SECONDS)
        self._payloads.publish(absurd_payload(self._rng))
        self.n_requests += 1
        if name == '/serve/enable':
            self._until(
                self._clients[name].call_async(SetBool.Request(data=True)).done, LOST_SECONDS
            )

    def _until(self, condition: Callable[[], bool], seconds: float) -> None:
        deadline = time.monotonic() + seconds
        while not condition() and time.monotonic() < deadline:
            time.sleep(0.01)


def absurd_payload(rng: np.random.Generator) -> InertiaStamped:
    """Return a payload that is rarely one."""
    m, x, y, ixx = (float(value) for value in rng.choice([*ODD, 0.5], 4))
    inertia = Inertia(m=m, com=Vector3(x=x, y=y), ixx=ixx)
    frame = str(rng.choice(['', 'b_link', 'tool0']))
    return InertiaStamped(header=Header(frame_id=frame), inertia=inertia)


def absurd_request(rng: np.random.Generator, name: str) -> Any:
    """Return a request that is wrong, or comes at a wrong time."""
    if name.endswith('change_state'):
        request = ChangeState.Request()
        request.transition.id = int(rng.choice([0, 1, 2, 3, 8, 10, 99, 255]))
        request.transition.label = str(rng.choice(['', '', 'activate', 'absurd']))
        return request
    if name.endswith('set_parameters'):
        value = ParameterValue(type=int(rng.choice([0, 9, 10, 99, 255])))
        key = str(rng.choice(['executor', 'model_path', 'ramp_s', '', 'absent', 'a.b']))
        return SetParameters.Request(parameters=[Parameter(name=key, value=value)])
    if name.endswith('enable'):
        return SetBool.Request(data=bool(rng.integers(2)))
    return Trigger.Request()
