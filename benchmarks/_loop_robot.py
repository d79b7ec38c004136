"""One cell of `loop_rate`: a simulated robot on a wall clock, and what reached it in time."""

from __future__ import annotations

from collections.abc import Callable
import json
import sys
import time
from typing import Any, Protocol

import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from benchmarks._driven_panda import DrivenPanda, feedback
from benchmarks._serve_client import cpu_seconds, LIMITS, serving, spun
from benchmarks.loop_rate import Timeline
from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos
from lip_id_ros.simulation import panda, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION

RATE_HZ, PLAN_HZ = 1000, 100
START_SECONDS, LAST_SECONDS = 600.0, 15.0
NAMES = list(panda().joint_names)
BOUNDS = np.array(LIMITS)


class Route(Protocol):
    """How a feedforward comes to the robot, which adds its feedback."""

    def begin(self) -> None:
        """Wait until torques come."""

    def feedforward(self, number: int) -> Array:
        """Ask for the feedforward of a tick; return the newest there is [N m]."""


def main(request: dict[str, Any]) -> dict[str, Any]:
    """Run one route for some seconds; return figures."""
    rclpy.init()
    node = rclpy.create_node('robot')
    trajectory = SinusoidTrajectory.random(MOTION, np.random.default_rng(1))
    timeline = Timeline(round(RATE_HZ * request['seconds']), 1.0 / RATE_HZ)
    with serving(request['model'], 'events') as serve, spun(node):
        route = ROUTES[request['route']](node, timeline, trajectory)
        route.begin()
        used, began = cpu_seconds(serve.pid), time.perf_counter()
        error = run(route, timeline, trajectory)
        share = (cpu_seconds(serve.pid) - used) / (time.perf_counter() - began)
        wait_for_last(timeline)
    figures = {'serve_cpu_percent': 100 * share, 'rms_error_mrad': 1e3 * error}
    return {**request, **timeline.figures(), **figures}


def run(route: Route, timeline: Timeline, trajectory: SinusoidTrajectory) -> float:
    """Step the arm at each tick of the wall clock; return the position error [rad]."""
    arm = DrivenPanda(trajectory, len(NAMES), np.random.default_rng(0))
    wanted = np.array(trajectory.sample(np.arange(timeline.n_ticks) / RATE_HZ)).swapaxes(0, 1)
    squares = 0.0
    for number in timeline.ticks():
        measured = arm.measure()
        timeline.asked(number)
        torque = route.feedforward(number) + feedback(wanted[number], measured)
        arm.step(np.clip(torque, -BOUNDS, BOUNDS))
        squares += float(np.mean((wanted[number, 0] - measured[0]) ** 2))
    return float(np.sqrt(squares / timeline.n_ticks))


class Stream:
    """`serve` answers a reference every millisecond; the robot takes the newest torque."""

    def __init__(self, node: Node, timeline: Timeline, trajectory: SinusoidTrajectory) -> None:
        self._timeline = timeline
        self._motion = trajectory.sample(np.arange(timeline.n_ticks) / RATE_HZ)
        self._newest = np.zeros(len(NAMES))
        self._publisher = node.create_publisher(
            JointTrajectory, '/serve/desired_trajectory', qos.REFERENCE
        )
        node.create_subscription(
            JointState, '/serve/feedforward_torque', self._receive, qos.OUTPUT
        )

    def begin(self) -> None:
        """Send the first reference until it is answered."""
        wait_for(lambda: bool(self._newest.any()), lambda: self._send(-1))

    def feedforward(self, number: int) -> Array:
        """Ask for that of this tick; return the newest."""
        self._send(number)
        return self._newest

    def _send(self, number: int) -> None:
        row = slice(max(number, 0), max(number, 0) + 1)
        states = (part[row] for part in self._motion)
        message = messages.plan_message(NAMES, np.zeros(1), *states)
        # a stamp of zero would mean now
        message.header.stamp = messages.stamp_at((number + 2) * messages.NANOSECONDS // RATE_HZ)
        self._publisher.publish(message)

    def _receive(self, message: JointState) -> None:
        effort = np.array(message.effort)
        # a comparison with nan is false
        safe = effort.shape == BOUNDS.shape and bool((np.abs(effort) <= BOUNDS).all())
        ns = messages.nanoseconds(message.header.stamp)
        self._timeline.answered(ns * RATE_HZ // messages.NANOSECONDS - 2, safe)
        if safe:
            self._newest = effort


class Plan:
    """`serve` fills in the efforts of one plan; the robot's own loop interpolates them."""

    def __init__(self, node: Node, timeline: Timeline, trajectory: SinusoidTrajectory) -> None:
        self._timeline, self._answers = timeline, list[JointTrajectory]()
        self._t = np.arange(timeline.n_ticks * PLAN_HZ // RATE_HZ + 1) / PLAN_HZ
        self._message = messages.plan_message(NAMES, self._t, *trajectory.sample(self._t))
        self._publisher = node.create_publisher(
            JointTrajectory, '/serve/desired_trajectory', qos.REFERENCE
        )
        node.create_subscription(
            JointTrajectory, '/serve/trajectory_with_effort', self._answers.append, qos.OUTPUT
        )

    def begin(self) -> None:
        """Send the plan once somebody listens, and wait for its efforts."""
        wait_for(lambda: self._publisher.get_subscription_count() > 0, lambda: None)
        time.sleep(1.0)  # the way back has to be found too
        self._publisher.publish(self._message)
        wait_for(lambda: bool(self._answers), lambda: None)
        self._efforts = np.array([point.effort for point in self._answers[0].points])

    def feedforward(self, number: int) -> Array:
        """Interpolate that of this tick."""
        row, part = divmod(number * PLAN_HZ, RATE_HZ)
        share = part / RATE_HZ
        torque = (1.0 - share) * self._efforts[row] + share * self._efforts[row + 1]
        self._timeline.answered(number, bool((np.abs(torque) <= BOUNDS).all()))
        return np.asarray(torque)


ROUTES: dict[str, Callable[[Node, Timeline, SinusoidTrajectory], Route]] = {
    'stream': Stream,
    'plan': Plan,
}


def wait_for(condition: Callable[[], bool], attempt: Callable[[], None]) -> None:
    """Try until a condition holds."""
    deadline = time.monotonic() + START_SECONDS
    while not condition():
        attempt()
        time.sleep(0.1)
        if time.monotonic() > deadline:
            raise TimeoutError(f'no answer in {START_SECONDS:g} s')


def wait_for_last(timeline: Timeline) -> None:
    """Wait until each tick is answered, or no answer has come for some seconds."""
    n_lost, since = timeline.n_lost, time.monotonic()
    while n_lost and time.monotonic() < since + LAST_SECONDS:
        time.sleep(0.1)
        if timeline.n_lost < n_lost:
            n_lost, since = timeline.n_lost, time.monotonic()


if __name__ == '__main__':
    print(json.dumps(main(json.loads(sys.argv[1]))))
