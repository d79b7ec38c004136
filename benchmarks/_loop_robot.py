"""One cell of `loop_rate`: a simulated robot on a wall clock, and what reached it in time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from dataclasses import asdict
import json
import subprocess
import sys
import time
from typing import Any, Protocol

import numpy as np
import rclpy
from rclpy.node import Node
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from benchmarks._cells import running
from benchmarks._closed_loop import placed
from benchmarks._loop_figures import Timeline
from benchmarks._serve_client import cpu_seconds, LIMITS, serving, spun
from lip_id_ros.arrays import Array
from lip_id_ros.control.plan_controller import PlanController
from lip_id_ros.control.settings import ControlSettings
from lip_id_ros.nodes import messages, qos
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.simulation import Measurement, SinusoidTrajectory, StoppedTrajectory
from lip_id_ros.simulation.arm import MOTION
from lip_id_ros.simulation.torque_controlled import DAMPING, panda_setup, STIFFNESS

Motion = tuple[Array, Array, Array]

RATE_HZ = 1000
PLAN_HZ = 100
START_SECONDS, LAST_SECONDS = 600.0, 15.0
SETUP = panda_setup()
NAMES = list(SETUP.arm.joint_names)
BOUNDS = np.array(LIMITS)
CONTROL = ControlSettings(
    joints=SETUP.arm.joint_names,
    stiffness=STIFFNESS,
    damping=DAMPING,
    torque_limits=tuple(LIMITS),
    # lateness is measured here, and let be: the arm moves from the first torque on
    rate_limits=(1e9,),
    ramp_s=0.0,
    stale_timeout_s=5.0,
    start_tolerance=(1.0,),
    path_tolerance=(10.0,),
)


class Route(Protocol):
    """How a torque comes to the robot."""

    def begin(self) -> None:
        """Wait until torques come."""

    def torque(self, number: int, measured: Measurement) -> Array:
        """Ask for the torque of a tick; return the newest there is [N m]."""


def main(request: dict[str, Any]) -> dict[str, Any]:
    """Run one route for some seconds; return figures."""
    rclpy.init()
    node = rclpy.create_node('robot')
    trajectory = SinusoidTrajectory.random(MOTION, np.random.default_rng(1))
    seconds = request['seconds']
    timeline = Timeline(round(RATE_HZ * seconds), 1.0 / RATE_HZ)
    with ExitStack() as stack:
        others = {'serve': stack.enter_context(serving(request['model'], 'events'))}
        if request['route'] == 'plan, node':
            others['computed_torque'] = stack.enter_context(controlling())
        stack.enter_context(spun(node))
        route = ROUTES[request['route']](node, timeline, trajectory, seconds)
        route.begin()
        used = {name: cpu_seconds(process.pid) for name, process in others.items()}
        began = time.perf_counter()
        error = run(route, timeline, trajectory)
        elapsed = time.perf_counter() - began
        cpu = {
            f'{name}_cpu_percent': 100 * (cpu_seconds(process.pid) - used[name]) / elapsed
            for name, process in others.items()
        }
        wait_for_last(timeline)
    return {**request, **cpu, **timeline.figures(), 'rms_error_mrad': 1e3 * error}


def run(route: Route, timeline: Timeline, trajectory: SinusoidTrajectory) -> float:
    """Step the arm at each tick of the wall clock; return the position error [rad]."""
    arm = placed(SETUP.arm, SETUP.drives, trajectory, np.random.default_rng(0))
    wanted = trajectory.sample(np.arange(timeline.n_ticks) / RATE_HZ)[0]
    squares = 0.0
    for number in timeline.ticks():
        measured = arm.measure()
        arm.step(route.torque(number, measured))
        squares += float(np.mean((wanted[number] - measured.q) ** 2))
    return float(np.sqrt(squares / timeline.n_ticks))


class Stream:
    """`serve` answers a reference every millisecond; the robot adds feedback to the newest."""

    def __init__(
        self, node: Node, timeline: Timeline, trajectory: SinusoidTrajectory, seconds: float
    ) -> None:
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

    def torque(self, number: int, measured: Measurement) -> Array:
        """Ask for the feedforward of this tick; use the newest."""
        self._timeline.asked(number)
        self._send(number)
        q, dq, _ = (part[number] for part in self._motion)
        feedback = SETUP.gains.feedback(q - measured.q, dq - measured.dq)
        return np.asarray(np.clip(self._newest + feedback, -BOUNDS, BOUNDS))

    def _send(self, number: int) -> None:
        q, dq, ddq = (messages.doubles(part[max(number, 0)]) for part in self._motion)
        point = JointTrajectoryPoint(positions=q, velocities=dq, accelerations=ddq)
        message = JointTrajectory(joint_names=NAMES, points=[point])
        message.header.stamp = stamp(number)
        self._publisher.publish(message)

    def _receive(self, message: JointState) -> None:
        self._newest = accepted(self._timeline, message, self._newest)


class PlanThroughNode:
    """`serve` fills in the efforts of one plan; `computed_torque` answers joint states."""

    def __init__(
        self, node: Node, timeline: Timeline, trajectory: SinusoidTrajectory, seconds: float
    ) -> None:
        self._timeline = timeline
        self._motion = trajectory.sample(np.zeros(1))
        self._plan = Planned(node, trajectory, seconds)
        self._newest = np.zeros(len(NAMES))
        self._states = node.create_publisher(JointState, '/joint_states', qos.OUTPUT)
        self._forward = node.create_publisher(
            JointTrajectory, '/computed_torque/joint_trajectory', qos.REFERENCE
        )
        node.create_subscription(JointState, '/computed_torque/command', self._receive, qos.OUTPUT)

    def begin(self) -> None:
        """Publish the plan, and wait for the first torque; the plan's clock stands until then."""
        answered = self._plan.answered()
        wait_for(lambda: self._forward.get_subscription_count() > 0, lambda: None)
        self._forward.publish(answered)
        first = Measurement(0.0, self._motion[0][0], self._motion[1][0], np.zeros(len(NAMES)))
        wait_for(lambda: bool(self._newest.any()), lambda: self._send(-1, first))

    def torque(self, number: int, measured: Measurement) -> Array:
        """Ask for the torque of this tick; use the newest."""
        self._timeline.asked(number)
        self._send(number, measured)
        return self._newest

    def _send(self, number: int, measured: Measurement) -> None:
        message = messages.torque_message(stamp(max(number, 0)), NAMES, measured.tau)
        message.position = messages.doubles(measured.q)
        message.velocity = messages.doubles(measured.dq)
        self._states.publish(message)

    def _receive(self, message: JointState) -> None:
        self._newest = accepted(self._timeline, message, self._newest)


class PlanInLoop:
    """`serve` fills in the efforts of one plan; the robot's own loop interpolates them."""

    def __init__(
        self, node: Node, timeline: Timeline, trajectory: SinusoidTrajectory, seconds: float
    ) -> None:
        self._timeline = timeline
        self._plan = Planned(node, trajectory, seconds)
        self._controller = PlanController(CONTROL)

    def begin(self) -> None:
        """Take the plan."""
        answered = self._plan.answered()
        self._controller.take(answered.joint_names, answered.points, time.monotonic())

    def torque(self, number: int, measured: Measurement) -> Array:
        """Compute the torque of this tick."""
        self._timeline.asked(number)
        message = JointMessage(
            tick_ns(number), NAMES, measured.q.tolist(), measured.dq.tolist(), ()
        )
        torques = self._controller.torques(message, time.monotonic())
        assert torques is not None
        self._timeline.answered(number, bool((np.abs(torques) <= BOUNDS).all()))
        return torques


ROUTES: dict[str, Callable[[Node, Timeline, SinusoidTrajectory, float], Route]] = {
    'stream': Stream,
    'plan, node': PlanThroughNode,
    'plan, in the loop': PlanInLoop,
}


class Planned:
    """One plan for the whole run, answered by `serve`."""

    def __init__(self, node: Node, trajectory: SinusoidTrajectory, seconds: float) -> None:
        self._answers: list[JointTrajectory] = []
        self._message = plan(trajectory, seconds)
        self._publisher = node.create_publisher(
            JointTrajectory, '/serve/desired_trajectory', qos.REFERENCE
        )
        node.create_subscription(
            JointTrajectory, '/serve/trajectory_with_effort', self._answers.append, qos.OUTPUT
        )

    def answered(self) -> JointTrajectory:
        """Send the plan once somebody listens; return it with its efforts."""
        wait_for(lambda: self._publisher.get_subscription_count() > 0, lambda: None)
        time.sleep(1.0)  # the way back has to be found too
        self._publisher.publish(self._message)
        wait_for(lambda: bool(self._answers), lambda: None)
        return self._answers[0]


def plan(trajectory: SinusoidTrajectory, seconds: float) -> JointTrajectory:
    """Return the motion, brought to rest after some seconds, as one plan."""
    stopped = StoppedTrajectory(trajectory, seconds)
    t = np.arange(round(PLAN_HZ * (seconds + stopped.within)) + 1) / PLAN_HZ
    message = JointTrajectory(joint_names=NAMES)
    for time_, q, dq, ddq in zip(t, *stopped.sample(t), strict=True):
        point = JointTrajectoryPoint(
            positions=messages.doubles(q),
            velocities=messages.doubles(dq),
            accelerations=messages.doubles(ddq),
        )
        after = messages.stamp_at(round(1e9 * time_))
        point.time_from_start.sec, point.time_from_start.nanosec = after.sec, after.nanosec
        message.points.append(point)
    return message


def tick_ns(number: int) -> int:
    """Return the time of a tick [ns]; a stamp of zero would mean now."""
    return (number + 2) * (messages.NANOSECONDS // RATE_HZ)


def stamp(number: int) -> Any:
    """Return the stamp of a tick."""
    return messages.stamp_at(tick_ns(number))


def accepted(timeline: Timeline, message: JointState, before: Array) -> Array:
    """Note an answer; return its torque, or the one before where it must not reach a robot."""
    effort = np.array(message.effort)
    # a comparison with nan is false
    safe = effort.shape == (len(NAMES),) and bool((np.abs(effort) <= BOUNDS).all())
    ns = message.header.stamp.sec * messages.NANOSECONDS + message.header.stamp.nanosec
    timeline.answered(ns * RATE_HZ // messages.NANOSECONDS - 2, safe)
    return effort if safe else before


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


def controlling() -> AbstractContextManager[subprocess.Popen[bytes]]:
    """Run `computed_torque` while the block runs."""
    given = {name: value for name, value in asdict(CONTROL).items() if name != 'executor'}
    return running('computed_torque', {name: json.dumps(value) for name, value in given.items()})


if __name__ == '__main__':
    print(json.dumps(main(json.loads(sys.argv[1]))))
