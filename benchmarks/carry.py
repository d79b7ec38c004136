"""
A simulated arm behind a real controller takes a payload up: errors with adaptation and without.

The arm repeats a motion. Efforts of its plans come from `serve`, feedback from a
joint_trajectory_controller. Against the payload `serve` follows the updates of `adapt`, or the
feedback has integral action, or there is neither.

"""

from __future__ import annotations

import argparse
from contextlib import ExitStack
import json
import os
from pathlib import Path
import signal
import tempfile
import time
from typing import Any, NamedTuple

from control_msgs.msg import JointTrajectoryControllerState
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import rclpy
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from benchmarks._cells import running, show
from benchmarks._goal_client import wait
from benchmarks._mock_controller import controlled, NAME
from benchmarks._serve_client import LIMITS, spun
from benchmarks.serve_rate import MIDDLEWARES
from benchmarks.track_controller import (
    compiled_arm,
    DURATION_S,
    JOINTS,
    PAYLOAD,
    recording,
    swings,
)
from lip_id_ros.arrays import Array
from lip_id_ros.evaluation.report import style
from lip_id_ros.identification import fit
from lip_id_ros.nodes import messages, qos

RATE_HZ = 500
STIFFNESS, DAMPING, INTEGRALS = 100.0, 10.0, (50.0, 200.0)
"""N m/rad, N m s/rad, N m/(rad s) of each joint."""

MOTION = 0.7, 0.6
"""Periods and size of the swings: accelerations are within those that were learned from."""

PAUSE_S = 0.5
"""Between two motions, in which a payload is taken up or put down."""

BARE, LOADED, AFTER, SETTLES = 5, 8, 4, 2
"""Motions before a payload, with it, and after it; in the first the arm comes to its place."""

BROADCASTER = {'joint_states_of_arm': 'joint_state_broadcaster/JointStateBroadcaster'}
COLUMNS = {
    'way': 'against the payload',
    'before': 'before, rms [mrad]',
    'first': 'first motion with it',
    'second': 'second',
    'last': 'last',
    'largest': 'largest in the last',
    'after_first': 'first without it',
    'after_last': 'last without it',
    'payload': 'payload found',
}


class Way(NamedTuple):
    """What there is against a payload: integral action [N m/(rad s)], and updates or none."""

    name: str
    integral: float
    follows: bool


WAYS = (
    Way('nothing', 0.0, False),
    *(Way(f'integral action, {gain:g} N m/(rad s)', gain, False) for gain in INTEGRALS),
    Way('adaptation', 0.0, True),
)


class Run(NamedTuple):
    """Times (N,) and those of motions [s], errors (N, 7) [rad], and the payload that was found."""

    t: Array
    error: Array
    motions: list[float]
    payload: str


def main(arguments: list[str]) -> int:
    """Run the arm in each way, print a table, and draw the errors if asked."""
    options = _options(arguments)
    os.environ['RMW_IMPLEMENTATION'] = options.middleware
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = options.model or str(folder / 'model.npz')
        if not options.model:
            fit(recording()).save(model)
        program = compiled_arm(folder)
        runs = {way.name: run(way, model, program) for way in WAYS}
    rows = [row(name, each) for name, each in runs.items()]
    show(f'A payload of {PAYLOAD:g} kg, taken up and put down', COLUMNS, rows, 150)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    if options.picture:
        draw(rows, options.picture)
    return 0


def run(way: Way, model: str, program: str) -> Run:
    """Let the arm take the payload up and put it down again."""
    rclpy.init()
    node = rclpy.create_node('carrier')
    gains = {'p': STIFFNESS, 'd': DAMPING, 'i': way.integral, 'antiwindup_strategy': 'none'}
    filled = ['-r', f'~/trajectory_with_effort:=/{NAME}/joint_trajectory']
    parameters = {
        'model_path': model,
        'accept_unproven': 'true',  # its errors are measured here
        'torque_limits': json.dumps(LIMITS),
        'joints': json.dumps(list(JOINTS)),
        'follow_adaptation': json.dumps(way.follows),
    }
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        stack.enter_context(spun(node))
        manager = stack.enter_context(
            controlled(
                node,
                JOINTS,
                Path(folder),
                RATE_HZ,
                [program],
                BROADCASTER,
                gains=dict.fromkeys(JOINTS, gains),
            )
        )
        stack.enter_context(running('serve', parameters, filled))
        if way.follows:
            adapt = {'model_path': model, 'state_path': f'{folder}/state.npz'}
            stack.enter_context(running('adapt', adapt))
        return Carrier(node, manager.pid, way.follows).carried()


class Carrier:
    """Sends motions to `serve`, and hears the errors of the controller."""

    def __init__(self, node: Node, arm: int, follows: bool) -> None:
        self._arm, self._states = arm, list[Any]()
        topic = f'/{NAME}/controller_state'
        kind = JointTrajectoryControllerState
        node.create_subscription(kind, topic, self._states.append, qos.OUTPUT)
        plans = '/serve/desired_trajectory'
        self._plans = node.create_publisher(JointTrajectory, plans, qos.OUTPUT)
        self._status: dict[str, dict[str, Any]] = {'serve': {}, 'adapt': {}}
        for name in self._status:
            node.create_subscription(
                DiagnosticStatus, f'/{name}/status', self._hearing(name), qos.LATCHED
            )
        wait(lambda: self._plans.get_subscription_count() > 0)
        wait(lambda: self._status['serve'].get('state') == 'active')
        wait(lambda: not follows or self._status['adapt'])

    def carried(self) -> Run:
        """Move without a payload, with it, and without it again."""
        t, *motion = swings(*MOTION)
        plan = messages.plan_message(JOINTS, t, *motion)
        started = list[float]()
        payload = ''
        for number in range(BARE + LOADED + AFTER):
            if number in (BARE, BARE + LOADED):
                payload = str(self._status['adapt'].get('payload', ''))
                up = number == BARE
                os.kill(self._arm, signal.SIGUSR1 if up else signal.SIGUSR2)
                time.sleep(PAUSE_S)
            started.append(_time(self._states[-1]))
            self._plans.publish(plan)
            time.sleep(DURATION_S + PAUSE_S)
        heard = list(self._states)
        times = np.array([_time(each) for each in heard])
        errors = np.array([each.error.positions for each in heard])
        return Run(times, errors, started, payload)

    def _hearing(self, name: str) -> Any:
        def hear(message: DiagnosticStatus) -> None:
            self._status[name] = messages.status_values(message)

        return hear


def _time(state: JointTrajectoryControllerState) -> float:
    """Return the stamp of a state [s]."""
    return 1e-9 * messages.nanoseconds(state.header.stamp)


def row(name: str, own: Run) -> dict[str, Any]:
    """Return root mean squares of the errors of single motions [mrad]."""
    parts = [
        1e3 * own.error[(own.t >= begin) & (own.t < begin + DURATION_S)] for begin in own.motions
    ]
    rms = [float(np.sqrt(np.mean(part**2))) for part in parts]
    last = BARE + LOADED - 1
    return {
        'way': name,
        'before': rms[BARE - 1],
        'first': rms[BARE],
        'second': rms[BARE + 1],
        'last': rms[last],
        'largest': float(np.abs(parts[last]).max()),
        'after_first': rms[last + 1],
        'after_last': rms[-1],
        'payload': own.payload,
        'motions': rms,
    }


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the errors of all motions but those in which the arm comes to its place."""
    number = np.arange(1 - BARE, LOADED + AFTER + 1)[SETTLES:]
    with style.styled():
        figure = style.new_figure(3.2 + style.LEGEND_HEIGHT)
        panel = figure.subplots()
        for each in rows:
            panel.plot(number, each['motions'][SETTLES:], 'o-', markersize=4, label=each['way'])
        panel.axvspan(0.5, LOADED + 0.5, color='0.92', zorder=-1)
        panel.set_yscale('log')
        panel.set_ylabel('rms error [mrad]')
        below = f'motion; from 1 to {LOADED} there is a payload of {PAYLOAD:g} kg'
        style.finish(figure, [panel], below)
        figure.savefig(path, dpi=120)


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks carry', description=__doc__)
    parser.add_argument('--model', help='of the simulated arm; left out: one is fitted')
    parser.add_argument('--middleware', choices=MIDDLEWARES, default=MIDDLEWARES[0])
    parser.add_argument('--picture', type=Path, help='draw the errors into this file')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    return parser.parse_args(arguments)
