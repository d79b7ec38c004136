"""
Soak of `computed_torque`: faults of joint states beside a simulated Panda on the wall clock.

Each trial lets the arm follow a plan, then the joint states stop, repeat, jump or come from two
publishers. The torque must be safe within 100 ms: zero, or for a single wrong stamp that of the
plan. The status must say why, and memory must be flat.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
import json
from pathlib import Path
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from benchmarks._cells import Row, running, show
from benchmarks._serve_client import LIMITS, spun
from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos
from lip_id_ros.simulation import TorqueControlledArm
from lip_id_ros.simulation.torque_controlled import panda_setup

RATE_HZ, STEPS = 250, 4
SAFE_S, LONGEST_S, PLAN_S = 0.1, 0.7, 4.0
LATE_S, WAITED_S = 0.03, 0.25
"""
A trial in which the robot was later by itself, or in which the threads of the node waited longer
for a processor, shows nothing of the node.
"""

ALLOWED_KB, ASK_AGAIN_S = 2048, 0.3
STEP_NM = 5.0
"""A torque of the plan changes by less between two ticks."""

SETUP = panda_setup()
NAMES = SETUP.arm.joint_names


@dataclass(frozen=True)
class Event:
    """
    A fault of the joint states.

    Attributes
    ----------
    stamp : callable
        The stamp [ns] of a joint state, given the right one and those of the fault so far; None
        for no joint state.
    reason : str
        What the status says.
    goes_on : bool
        Whether the plan is followed further.
    has_second : bool
        Whether a second publisher has other positions.
    offset : float
        What is added to all positions [rad].

    """

    stamp: Callable[[int, list[int]], int | None]
    reason: str
    goes_on: bool = False
    has_second: bool = False
    offset: float = 0.0


def shifted(seconds: float) -> Callable[[int, list[int]], int | None]:
    """Return stamps of another clock."""
    return lambda now, _: now + round(1e9 * seconds)


EVENTS = {
    'stop': Event(lambda now, _: None, 'no joint state has come'),
    'repeat': Event(lambda now, before: before[0] if before else now, '(stamp repeated)'),
    'one stamp 9 s ahead': Event(
        lambda now, before: now if before else now + 9_000_000_000, 'stamp far ahead', True
    ),
    'clock jumps ahead': Event(shifted(60.0), 'the stamps of the joint states jumped'),
    'clock jumps back': Event(shifted(-60.0), 'the stamps of the joint states jumped'),
    'positions jump': Event(lambda now, _: now, 'more than the tolerance', offset=1.0),
    'two publishers': Event(lambda now, _: now, 'more than the tolerance', has_second=True),
}


@dataclass
class Heard:
    """What the node said, with the time of its receipt."""

    torques: list[tuple[float, Array]] = field(default_factory=list)
    statuses: list[tuple[float, str]] = field(default_factory=list)
    unsafe: int = 0

    def torque(self, message: JointState) -> None:
        """Keep a torque; count one that no robot may get."""
        effort = np.array(message.effort)
        fits = effort.shape == (len(LIMITS),) and bool((np.abs(effort) <= LIMITS).all())
        self.unsafe += not fits
        self.torques.append((time.monotonic(), effort))

    def status(self, message: DiagnosticStatus) -> None:
        """Keep the summary of a status."""
        self.statuses.append((time.monotonic(), message.message))


class Robot:
    """A simulated Panda on the wall clock, which brakes where torques end."""

    def __init__(self, node: Node, other: Node, pid: int) -> None:
        self._pid = pid
        rest = np.zeros(len(NAMES))
        rng = np.random.default_rng(0)
        self._arm = TorqueControlledArm(SETUP.arm, SETUP.drives, SETUP.posture, rest, rng)
        self._states = node.create_publisher(JointState, '/joint_states', qos.OUTPUT)
        self._other = other
        self._plans = node.create_publisher(
            JointTrajectory, '/computed_torque/joint_trajectory', qos.REFERENCE
        )
        self.heard = Heard()
        node.create_subscription(
            JointState, '/computed_torque/command', self.heard.torque, qos.OUTPUT
        )
        node.create_subscription(
            DiagnosticStatus, '/computed_torque/status', self.heard.status, qos.LATCHED
        )
        self._next_tick = time.monotonic()
        self.late_s = 0.0

    def trial(self, event: Event, seconds: float) -> Row:
        """Follow a plan for some seconds, then suffer an event; return what came of it."""
        self.heard.torques.clear()
        self._follow(seconds)
        if event.has_second:
            self._second = self._other.create_publisher(JointState, '/joint_states', qos.OUTPUT)
        self.heard.statuses.clear()
        self.late_s, waited_s = 0.0, waiting_s(self._pid)
        began, stamps = time.monotonic(), list[int]()
        while time.monotonic() < began + LONGEST_S:
            stamp = event.stamp(time.time_ns(), stamps)
            if stamp is not None:
                stamps.append(stamp)
                self._publish(stamp, offset=event.offset)
            if event.has_second:
                self._publish(time.time_ns(), self._second, offset=1.0)
            self._step()
        if event.has_second:
            self._other.destroy_publisher(self._second)
        row = self._judge(event, began)
        row['late'] |= waiting_s(self._pid) - waited_s > WAITED_S
        self._rest()
        return row

    def _judge(self, event: Event, began: float) -> Row:
        torques = [(at - began, tau) for at, tau in list(self.heard.torques)]
        after = [(at, tau) for at, tau in torques if at > SAFE_S]
        told = [at - began for at, said in list(self.heard.statuses) if event.reason in said]
        said = [f'{at - began:.3f} {text}' for at, text in list(self.heard.statuses)]
        row: Row = {'late': self.late_s > LATE_S, 'told_s': told[0] if told else np.inf}
        row['said'] = said
        if event.goes_on:
            steps = np.diff([tau for at, tau in torques if at > -SAFE_S], axis=0)
            row['safe_s'] = 0.0 if np.abs(steps).max() < STEP_NM and len(after) > 1 else np.inf
        else:
            moving = [at for at, tau in torques if tau.any()]
            ends = [at for at, tau in torques if not tau.any() and at > max(moving)]
            row['safe_s'] = ends[0] if ends else np.inf
        return row

    def _follow(self, seconds: float) -> None:
        """Follow a plan from where the arm is; ask again where it was let go for a late robot."""
        began = asked = -np.inf
        while time.monotonic() < began + seconds or not self._is_driven:
            now = time.monotonic()
            if not self._is_driven and now > asked + ASK_AGAIN_S:
                self._plans.publish(plan(self._arm))
                began = asked = now
            self._publish(time.time_ns())
            self._step()

    def _rest(self) -> None:
        """Let the clock go on until its stamps are believed again, and the arm stands."""
        self.heard.torques.clear()
        self._arm.stop(self._arm.q)
        for _ in range(RATE_HZ // 5):
            self._publish(time.time_ns())
            self._step()

    @property
    def _is_driven(self) -> bool:
        return bool(self.heard.torques) and bool(self.heard.torques[-1][1].any())

    def _publish(self, stamp_ns: int, publisher: Any = None, offset: float = 0.0) -> None:
        measured = self._arm.measure()
        state = messages.joint_state_message(
            messages.stamp_at(stamp_ns), NAMES, measured.q + offset, measured.dq, measured.tau
        )
        (publisher or self._states).publish(state)

    def _step(self) -> None:
        """Move by a tick under the newest torque, or stand by the brakes; wait for the next."""
        if self._is_driven:
            torque = self.heard.torques[-1][1]
            for _ in range(STEPS):
                self._arm.step(torque)
        else:
            self._arm.stop(self._arm.q)
        self._next_tick += 1.0 / RATE_HZ
        ahead = self._next_tick - time.monotonic()
        self.late_s = max(self.late_s, -ahead)
        if ahead < 0.0:
            self._next_tick = time.monotonic()
        time.sleep(max(0.0, ahead))


def plan(arm: TorqueControlledArm) -> JointTrajectory:
    """Return a motion of 0.1 rad at all joints and back, from where an arm stands."""
    t = np.linspace(0.0, PLAN_S, round(100 * PLAN_S) + 1)
    rate, sway = 2.0 * np.pi / PLAN_S, 0.05 * np.ones(len(NAMES))
    q = arm.q + np.outer(1.0 - np.cos(rate * t), sway)
    dq, ddq = np.outer(rate * np.sin(rate * t), sway), np.outer(rate**2 * np.cos(rate * t), sway)
    tau = arm.bodies.inverse_dynamics(q, dq, ddq) + arm.drives.friction.torque(dq)
    return messages.with_effort(messages.plan_message(NAMES, t, q, dq, ddq), tau)


def main(arguments: list[str]) -> int:
    """Repeat all events for some time; exit status 1 where one was not safe or not told."""
    parser = argparse.ArgumentParser(prog='benchmarks soak_computed_torque', description=__doc__)
    parser.add_argument('--seconds', type=float, default=600.0)
    options = parser.parse_args(arguments)
    rclpy.init()
    node, other = rclpy.create_node('robot'), rclpy.create_node('second_driver')
    rows: dict[str, list[Row]] = {name: [] for name in EVENTS}
    memory: list[int] = []
    with ExitStack() as stack:
        process = stack.enter_context(running('computed_torque', parameters()))
        stack.enter_context(spun(node))
        robot = Robot(node, other, process.pid)
        while not robot.heard.statuses:
            time.sleep(0.1)
        end, rng = time.monotonic() + options.seconds, np.random.default_rng(1)
        while time.monotonic() < end:
            for name, event in EVENTS.items():
                rows[name].append(robot.trial(event, rng.uniform(0.5, 1.5)))
            memory.append(resident_kb(process.pid))
        other.destroy_node()
    return report(rows, memory, robot.heard.unsafe)


def parameters() -> dict[str, str]:
    """Return those of the node: gains and silence for 250 Hz, limits of the data sheet."""
    given = {
        'joints': list(NAMES),
        'stiffness': (0.25 * SETUP.gains.stiffness).tolist(),
        'damping': (0.5 * SETUP.gains.damping).tolist(),
        'torque_limits': LIMITS,
        'stale_timeout_s': 0.04,
    }
    return {name: json.dumps(value) for name, value in given.items()}


def report(rows: dict[str, list[Row]], memory: list[int], unsafe: int) -> int:
    """Print a table; return 1 where a trial failed, a torque was unsafe or memory grew."""
    table, failed = [], 0
    for name, trials in rows.items():
        judged = [trial for trial in trials if not trial['late']]
        bad = [t for t in judged if t['safe_s'] > SAFE_S or t['told_s'] > LONGEST_S]
        failed += len(bad) + (not judged)
        for trial in bad:
            print(f'{name}: safe after {trial["safe_s"]:.3f} s; status: {trial["said"]}')
        figures: Row = {'event': name, 'trials': len(trials), 'late': len(trials) - len(judged)}
        for key in ('safe_s', 'told_s'):
            values = [1e3 * trial[key] for trial in judged] or [np.inf]
            figures[f'{key}_median'], figures[f'{key}_max'] = np.median(values), max(values)
        table.append({**figures, 'failed': len(bad)})
    columns = {
        'event': 'event',
        'trials': 'trials',
        'late': 'late',
        'safe_s_median': 'safe after, median ms',
        'safe_s_max': 'longest ms',
        'told_s_median': 'told after, median ms',
        'told_s_max': 'longest told ms',
        'failed': 'failed',
    }
    show('joint states of a simulated Panda at 250 Hz', columns, table, 140)
    first, last = memory[len(memory) // 3], memory[-1]
    print(f'memory: {first} kB after a third, {last} kB at the end; unsafe torques: {unsafe}')
    return int(failed > 0 or unsafe > 0 or last - first > ALLOWED_KB)


def waiting_s(pid: int) -> float:
    """Return how long the threads of a process have been ready without a processor [s]."""
    total = 0
    for path in Path(f'/proc/{pid}/task').glob('*/schedstat'):
        total += int(path.read_text().split()[1])
    return 1e-9 * total


def resident_kb(pid: int) -> int:
    """Return the resident memory of a process [kB]."""
    lines = Path(f'/proc/{pid}/status').read_text().splitlines()
    return int(next(line for line in lines if line.startswith('VmRSS')).split()[1])
