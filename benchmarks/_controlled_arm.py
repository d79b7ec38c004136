"""The simulated arm behind a real controller: motions, and errors with several feedforwards."""

from __future__ import annotations

import json
from pathlib import Path
import sys
import tempfile
import time
from typing import Any

from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from benchmarks._cells import running
from benchmarks._goal_client import done, wait
from benchmarks._mock_controller import controlled, NAME
from benchmarks._serve_client import LIMITS, spun
from benchmarks.track_controller import JOINTS, MOTIONS, POSTURE, States, true_arm, WAYS
from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.regressor import torque_regressor

RATE_HZ = 500
GAINS = {'p': 100.0, 'd': 10.0, 'i': 0.0, 'antiwindup_strategy': 'none'}
REST_S, BEHIND_S = 1.5, 0.5
PLANS = f'/{NAME}/joint_trajectory'
ACTION = f'/{NAME}/follow_joint_trajectory'


def main(request: dict[str, Any]) -> dict[str, Any]:
    """Track every motion in every way; return rows."""
    rclpy.init()
    node = rclpy.create_node('tracking_client')
    parameters = {
        'model_path': request['model'],
        'accept_unproven': 'true',  # its errors are measured here
        'torque_limits': json.dumps(LIMITS),
        'controller_action': ACTION,
        'joints': json.dumps(list(JOINTS)),
    }
    with (
        tempfile.TemporaryDirectory() as folder,
        spun(node),
        controlled(
            node,
            JOINTS,
            Path(folder),
            RATE_HZ,
            [request['program']],
            gains=dict.fromkeys(JOINTS, GAINS),
        ),
        running('serve', parameters, ['-r', f'~/trajectory_with_effort:={PLANS}']),
    ):
        client = Client(node)
        rows = [client.row(name, way) for name in request['motions'] for way in WAYS]
    return {'rows': rows}


class Client:
    """Sends motions to the controller, and hears its states."""

    def __init__(self, node: Node) -> None:
        self._states: list[Any] = []
        topic = f'/{NAME}/controller_state'
        kind = JointTrajectoryControllerState
        node.create_subscription(kind, topic, self._states.append, qos.OUTPUT)
        self._direct = node.create_publisher(JointTrajectory, PLANS, qos.OUTPUT)
        filled = '/serve/desired_trajectory'
        self._filled = node.create_publisher(JointTrajectory, filled, qos.OUTPUT)
        self._action = ActionClient(node, FollowJointTrajectory, '/serve/follow_joint_trajectory')
        self._arm = true_arm()
        self._serve: dict[str, Any] = {}
        node.create_subscription(DiagnosticStatus, '/serve/status', self._on_serve, qos.LATCHED)
        wait(lambda: self._direct.get_subscription_count() > 0)
        wait(lambda: self._filled.get_subscription_count() > 0)
        wait(self._action.server_is_ready)
        wait(lambda: self._serve.get('state') == 'active')
        wait(lambda: 'no controller' not in self._serve['summary'])

    def row(self, name: str, way: str) -> dict[str, Any]:
        """Track a motion from rest; return root mean squares of error and feedback."""
        self._rest()
        states = MOTIONS[name]()
        t, q, dq, ddq = states
        plan = messages.plan_message(JOINTS, t, q, dq, ddq)
        self._states.clear()
        if way == 'ours, action':
            handle = done(
                self._action.send_goal_async(FollowJointTrajectory.Goal(trajectory=plan))
            )
            assert handle.accepted
            handle.get_result_async()
        elif way == 'ours, plan':
            self._filled.publish(plan)
        else:
            self._direct.publish(self._with_efforts(plan, way, states))
        # where the machine is busy, serve fills a plan later
        wait(lambda: self._is_at(q[-1]) and len(self._states) > RATE_HZ * t[-1])
        time.sleep(BEHIND_S)
        heard = list(self._states)
        errors = np.array([each.error.positions for each in heard])
        rates = np.array([each.error.velocities for each in heard])
        feedback = GAINS['p'] * errors + GAINS['d'] * rates
        return {
            'motion': name,
            'feedforward': way,
            'states': len(heard),
            'rms_mrad': 1e3 * _rms(errors),
            'largest_mrad': 1e3 * float(np.abs(errors).max()),
            'feedback_nm': _rms(feedback),
        }

    def _is_at(self, q: Array) -> bool:
        states = self._states[-1:]
        return bool(states) and np.abs(np.array(states[0].reference.positions) - q).max() < 1e-6

    def _on_serve(self, message: DiagnosticStatus) -> None:
        self._serve = messages.status_values(message)

    def _rest(self) -> None:
        still = np.zeros((1, 7))
        plan = messages.plan_message(JOINTS, np.array([REST_S]), POSTURE[None], still, still)
        gravity = self._arm.torque(POSTURE[None], still, still)
        self._direct.publish(messages.with_effort(plan, gravity))
        time.sleep(2.0 * REST_S)

    def _with_efforts(self, plan: JointTrajectory, way: str, states: States) -> JointTrajectory:
        if way == 'none':
            return plan
        links = self._arm.links.copy()
        links[:, ROTOR] = 0.0  # KDL has no rotors, and no friction
        tau = torque_regressor(self._arm.chain, *states[1:]) @ links.ravel()
        return messages.with_effort(plan, tau)


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


if __name__ == '__main__':
    print(json.dumps(main(json.loads(sys.argv[1]))))
