"""
From nothing to a model in a ROS graph, with MuJoCo as the arm, a floor and a wall (excitation.md).

Node `excite` moves an arm that it knows from a URDF, `train` fits without the URDF. The model is
judged by the torques of five unseen random motions that the same controller follows. With
`--block`, a joint is blocked in the first motion instead, and the way to the stop is timed.

"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
import json
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import rclpy
from std_srvs.srv import Trigger

from benchmarks._mujoco_arm import ACTION, Arm, as_parameter, Cell, description, STEP_S
from examples.demo.graph import end
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.excitation.joint_limits import limits_from
from lip_id_ros.excitation.series import LimitedMotions
from lip_id_ros.excitation.settings import MotionSettings
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.nodes import messages, qos
from lip_id_ros.simulation.arm import panda_urdf

SECONDS, REACH, SHARE = 10.0, 1.0, 0.8
TESTS, EVERY = 5, 10
SEARCH: dict[str, Any] = {'draws': 10, 'starts': 1, 'steps': 40}
LONGEST_S = 3000.0
UR_JOINTS = (
    *('shoulder_pan_joint', 'shoulder_lift_joint', 'elbow_joint'),
    *('wrist_1_joint', 'wrist_2_joint', 'wrist_3_joint'),
)
ROBOTS = panda_urdf().parents[2]
CELLS = {
    'UR10': Cell(
        str(ROBOTS / 'ur_description/urdf/ur10_robot.urdf'), UR_JOINTS,
        (0.0, -1.8, 1.6, -1.4, -1.57, 0.0), -0.1, 0.9,
    ),
    'xArm7': Cell(
        str(ROBOTS / 'xarm_description/urdf/xarm7.urdf'),
        tuple(f'joint{i}' for i in range(1, 8)),
        (0.0, -0.3, 0.0, 1.2, 0.0, 1.0, 0.0), 0.0, 0.6,
    ),
    'Z1': Cell(
        str(ROBOTS / 'z1_description/urdf/z1.urdf'), tuple(f'joint{i}' for i in range(1, 7)),
        (0.0, 1.2, -1.5, -0.3, 0.0, 0.0), 0.0, 0.4,
    ),
}  # fmt: skip


def main(arguments: list[str]) -> int:
    """Print a row for each arm."""
    parser = argparse.ArgumentParser(prog='benchmarks from_nothing', description=__doc__)
    parser.add_argument('--robots', nargs='+', choices=CELLS, default=list(CELLS))
    parser.add_argument('--rounds', type=int, default=2)
    parser.add_argument('--block', type=int, help='number of the joint that is blocked')
    parser.add_argument('--block-at', type=float, default=2.0, help='seconds of motion before')
    parser.add_argument('--tolerance', type=float, default=0.1, help='tracking_tolerance [rad]')
    options = parser.parse_args(arguments)
    for robot in options.robots:
        print(robot, json.dumps(_run(CELLS[robot], options)), flush=True)
    return 0


def _run(cell: Cell, options: argparse.Namespace) -> dict[str, Any]:
    """Have the nodes run until `excite` has ended; return what came of it."""
    text = description(Path(cell.urdf), cell.joints)
    arm = Arm(cell, text)
    motion = motion_of(cell, arm)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        ended = _executed(cell, motion, arm, folder, options)
        outcome, path = {'blocked': None}, folder / 'outcome.json'
        if path.exists():  # else no motion has ended
            outcome = json.loads(path.read_text())
        found = {'ended': ended['summary'], 'size': ended['size'], **outcome}
        if outcome['blocked'] is not None:
            return {**found, 'to_cancel_ms': 1e3 * (outcome['cancelled'] - outcome['blocked'])}
        if ended['stage'] != 'done':
            return found
        model = InverseDynamicsModel.load(ended['model_path'])
        return {**found, 'nmse_percent': _error(cell, text, motion, model)}


def motion_of(cell: Cell, arm: Arm) -> MotionSettings:
    """Return the settings of motions around the posture, within 0.8 of the arm's limits."""
    at = np.array(cell.posture)
    velocity = np.minimum(SHARE * arm.velocity, 2.0)
    return MotionSettings(
        joints=cell.joints, posture=cell.posture, duration_s=SECONDS,
        lower=tuple(at - REACH), upper=tuple(at + REACH), velocity=tuple(velocity),
        torque_limits=tuple(SHARE * arm.effort),
    )  # fmt: skip


def space_of(cell: Cell) -> dict[str, Any]:
    """Return the settings of a space with the floor and the wall of a cell."""
    wall = cell.wall, -9.0, -9.0, cell.wall + 0.1, 9.0, 9.0
    return {'floor_m': cell.floor, 'margin_m': 0.05, 'boxes': wall}


def _executed(
    cell: Cell, motion: MotionSettings, arm: Arm, folder: Path, options: argparse.Namespace
) -> dict[str, Any]:
    (folder / 'excite.yaml').write_text(_yaml(cell, motion))
    block = {}
    if options.block is not None:
        block = {'block_joint': options.block, 'block_at_s': options.block_at}
    nodes = {
        'benchmarks._mujoco_arm': {
            'cell': as_parameter(cell), 'outcome_path': str(folder / 'outcome.json'), **block,
        },
        'lip_id_ros.nodes.train': {
            'recording.joints': list(cell.joints), 'model_path': str(folder / 'model.npz'),
            'unsaved_path': str(folder / 'kept'),
        },
        'lip_id_ros.nodes.excite': {
            'controller_action': ACTION, 'config_path': str(folder / 'excite.yaml'),
            'motion_path': str(folder / 'motion.yaml'), 'use_robot_description': True,
            'rounds': options.rounds, 'first_size': 0.5, 'confirm': False,
            'effort_limits': arm.effort.tolist(), 'tracking_tolerance': [options.tolerance],
            'stale_timeout_s': 5.0, 'use_sim_time': True,
        },
    }  # fmt: skip
    with _processes(nodes, folder):
        return _outcome()


def _yaml(cell: Cell, motion: MotionSettings) -> str:
    names = ('joints', 'posture', 'lower', 'upper', 'velocity', 'torque_limits')
    own = {
        name: [x if isinstance(x, str) else float(x) for x in getattr(motion, name)]
        for name in names
    }
    return json.dumps({
        'motion': {**own, 'duration_s': motion.duration_s},
        'space': space_of(cell),
        'search': SEARCH,
    })  # fmt: skip


@contextmanager
def _processes(nodes: dict[str, dict[str, Any]], folder: Path) -> Iterator[None]:
    started = []
    try:
        for module, parameters in nodes.items():
            command = [sys.executable, '-m', module, '--ros-args']
            for name, value in parameters.items():
                command += ['-p', f'{name}:={json.dumps(value)}']
            with open(folder / f'{module}.log', 'wb') as log:
                started.append(
                    subprocess.Popen(command, stdout=log, stderr=log, start_new_session=True)
                )
        yield
    finally:
        for each in started:
            end(each)


def _outcome() -> dict[str, Any]:
    """Start the motions; return the status of `excite` at their end."""
    rclpy.init()
    node, heard = rclpy.create_node('from_nothing'), [{'stage': ''}]
    node.create_subscription(
        DiagnosticStatus, '/excite/status',
        lambda message: heard.append(messages.status_values(message)), qos.LATCHED,
    )  # fmt: skip
    start, until = node.create_client(Trigger, '/excite/start'), time.monotonic() + LONGEST_S
    start.wait_for_service()
    try:
        while heard[-1]['stage'] in ('', 'idle'):
            answer = start.call_async(Trigger.Request())
            rclpy.spin_until_future_complete(node, answer, timeout_sec=5.0)
        while heard[-1]['stage'] not in ('done', 'stopped') and time.monotonic() < until:
            rclpy.spin_once(node, timeout_sec=1.0)
    finally:
        node.destroy_node()
        rclpy.shutdown()
    return heard[-1]


def _error(
    cell: Cell, text: str, motion: MotionSettings, model: InverseDynamicsModel
) -> list[float]:
    """Return errors [%] per joint on what the drives do along random motions in the limits."""
    limits = limits_from(motion, cell.joints)
    motions = LimitedMotions(limits, np.array(cell.posture), SECONDS, motion.harmonics)
    errors = []
    for seed in range(TESTS):
        arm = Arm(cell, text, has_surroundings=False)
        unseen = motions.motion(motions.random(np.random.default_rng([seed, 1])))
        t = unseen.times(100.0)
        arm.begin(t, np.stack(unseen.sample(t), axis=1))
        states = []
        for _ in range(round(SECONDS / STEP_S) // EVERY):
            for _ in range(EVERY):
                arm.step()
            states.append(arm.state)
        q, dq, ddq, tau = (np.array(each) for each in zip(*states, strict=True))
        errors.append(nmse_percent(model.predict(q, dq, ddq).tau, tau))
    return [float(each) for each in np.mean(errors, axis=0)]
