"""One seed of `track_controller`: an arm behind a real controller moves, and is learned."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
import json
from pathlib import Path
import sys
import tempfile
import time
from typing import Any

from control_msgs.msg import JointTrajectoryControllerState
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from benchmarks._cells import running
from benchmarks._mock_controller import controlled, NAME
from benchmarks._serve_client import LIMITS, spun
from benchmarks.track_controller import (
    EASE_S,
    Feedforward,
    feedforwards,
    GAINS,
    JOINTS,
    learned,
    LEARNED_FROM,
    NOMINAL,
    reference,
    THROUGH_SERVE,
    true_arm,
)
from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos
from lip_id_ros.recording import JointSamples

RATE_HZ = 500
REST_S, BEHIND_S, LONGEST_S = 1.5, 0.5, 300.0
PLANS = f'/{NAME}/joint_trajectory'
BROADCASTER = {'joint_states_of_arm': 'joint_state_broadcaster/JointStateBroadcaster'}


def main(request: dict[str, Any]) -> dict[str, Any]:
    """Follow with the nominal model, learn, and follow with every feedforward; return rows."""
    rclpy.init()
    node = rclpy.create_node('tracking_client')
    by_joint = zip(JOINTS, GAINS['p'].tolist(), GAINS['d'].tolist(), strict=True)
    gains = {
        joint: {'p': p, 'd': d, 'i': 0.0, 'antiwindup_strategy': 'none'}
        for joint, p, d in by_joint
    }
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        stack.enter_context(spun(node))
        program = [request['program']]
        stack.enter_context(
            controlled(node, JOINTS, folder, RATE_HZ, program, BROADCASTER, gains=gains)
        )
        client, known = Client(node, request['horizon']), feedforwards(request['seed'])
        samples, _ = client.follow(LEARNED_FROM, known[NOMINAL])
        model = str(folder / 'model.npz')
        learned(samples).save(model)
        parameters = {
            'model_path': model,
            'accept_unproven': 'true',  # its errors are measured here
            'torque_limits': json.dumps(LIMITS),
            'joints': json.dumps(list(JOINTS)),
            'autostart': 'true',
        }
        remap = ['-r', f'~/trajectory_with_effort:={PLANS}']
        stack.enter_context(running('serve', parameters, remap))
        client.await_serve()
        rows = [
            {
                'seed': request['seed'],
                'amplitude': amplitude,
                'feedforward': name,
                **client.follow(amplitude, feedforward, *THROUGH_SERVE.get(name, ()))[1],
            }
            for amplitude in request['amplitudes']
            for name, feedforward in {**known, **dict.fromkeys(THROUGH_SERVE)}.items()
        ]
    return {'rows': rows}


class Client:
    """Sends plans to the controller, or through `serve`, and hears its states and the arm's."""

    def __init__(self, node: Node, horizon: float) -> None:
        self._horizon = horizon
        self._states, self._measured = list[Any](), list[JointState]()
        self._serve: dict[str, Any] = {}
        kind = JointTrajectoryControllerState
        node.create_subscription(
            kind, f'/{NAME}/controller_state', self._states.append, qos.OUTPUT
        )
        node.create_subscription(JointState, '/joint_states', self._measured.append, qos.OUTPUT)
        node.create_subscription(DiagnosticStatus, '/serve/status', self._on_serve, qos.LATCHED)
        self._direct = node.create_publisher(JointTrajectory, PLANS, qos.OUTPUT)
        topic = '/serve/desired_trajectory'
        self._filled = node.create_publisher(JointTrajectory, topic, qos.OUTPUT)
        self._parameters = node.create_client(SetParameters, '/serve/set_parameters')
        wait(lambda: self._direct.get_subscription_count() > 0)
        wait(lambda: self._measured)

    def await_serve(self) -> None:
        """Wait until `serve` fills plans, and knows the controller that it hands them to."""
        wait(lambda: self._filled.get_subscription_count() > 0)
        wait(lambda: self._serve.get('state') == 'active')
        time.sleep(REST_S)  # the controller has to be found too

    def follow(
        self,
        amplitude: float,
        feedforward: Feedforward | None,
        every: int = 1,
        refine: bool = True,
    ) -> tuple[JointSamples, dict[str, list[float]]]:
        """Follow a reference from rest, with the torques of `serve` by default; return figures."""
        t, states = reference(amplitude, self._horizon)
        self._rest(states[0][0])
        self._states.clear()
        self._measured.clear()
        if feedforward is None:
            self._refine(refine)
            rows = np.unique(np.append(np.arange(0, len(t), every), len(t) - 1))
            self._filled.publish(
                messages.plan_message(JOINTS, t[rows], *(each[rows] for each in states))
            )
        else:
            tau = feedforward(*states)
            self._direct.publish(messages.plan_message(JOINTS, t, *states, tau))
        # where the machine is busy, serve fills a plan later
        wait(lambda: self._is_at(states[0][-1]))
        time.sleep(BEHIND_S)
        return samples_of(list(self._measured)), self._figures()

    def _refine(self, refine: bool) -> None:
        """Have `serve` add points to plans, or not."""
        value = Parameter('refine_plans', value=refine).to_parameter_msg()
        asked = self._parameters.call_async(SetParameters.Request(parameters=[value]))
        wait(asked.done)

    def _figures(self) -> dict[str, list[float]]:
        """Return the paper's figures of the states within the horizon, for each joint."""
        heard = list(self._states)
        t = np.array([messages.nanoseconds(each.header.stamp) for each in heard]) / 1e9
        moving = np.array([np.any(each.reference.velocities) for each in heard])
        since = t - t[np.argmax(moving)] - EASE_S
        within = (since >= 0.0) & (since <= self._horizon)
        wanted, error, slower = (
            np.array(values)[within]
            for values in (
                [each.reference.positions for each in heard],
                [each.error.positions for each in heard],
                [each.error.velocities for each in heard],
            )
        )
        feedback = GAINS['p'] * error + GAINS['d'] * slower
        return {
            'position_nmse_percent': (100 * np.mean(error**2, 0) / np.var(wanted, 0)).tolist(),
            'feedback_mean_square': np.mean(feedback**2, 0).tolist(),
            'rms_mrad': (1e3 * np.sqrt(np.mean(error**2, 0))).tolist(),
        }

    def _is_at(self, q: Array) -> bool:
        states = self._states[-1:]
        return bool(states) and np.abs(np.array(states[0].reference.positions) - q).max() < 1e-6

    def _rest(self, q: Array) -> None:
        still = np.zeros((1, len(JOINTS)))
        gravity = true_arm().torque(q[None], still, still)
        plan = messages.plan_message(JOINTS, np.array([REST_S]), q[None], still, still, gravity)
        self._direct.publish(plan)
        time.sleep(2.0 * REST_S)

    def _on_serve(self, message: DiagnosticStatus) -> None:
        self._serve = messages.status_values(message)


def samples_of(measured: list[JointState]) -> JointSamples:
    """Return joint states as samples."""
    columns = [list(measured[0].name).index(joint) for joint in JOINTS]
    position, velocity, effort = (
        np.array([getattr(each, name) for each in measured])[:, columns]
        for name in ('position', 'velocity', 'effort')
    )
    t = np.array([messages.nanoseconds(each.header.stamp) for each in measured]) / 1e9
    return JointSamples(t, position, velocity, effort, JOINTS, source='the run')


def wait(condition: Callable[[], Any]) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + LONGEST_S
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f'not in {LONGEST_S:g} s')
        time.sleep(0.002)


if __name__ == '__main__':
    print(json.dumps(main(json.loads(sys.argv[1]))))
