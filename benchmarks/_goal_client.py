"""One row of `goals`: goals to a real controller, directly and through `serve`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
import json
import os
from pathlib import Path
import sys
import tempfile
import threading
import time
from typing import Any

from action_msgs.msg import GoalStatus, GoalStatusArray
from control_msgs.action import FollowJointTrajectory
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node

from benchmarks._cells import running
from benchmarks._mock_controller import controlled, NAME
from benchmarks._serve_client import cpu_seconds, LIMITS, spun
from lip_id_ros.arrays import Array
from lip_id_ros.nodes import messages, qos
from lip_id_ros.simulation import panda

DIRECT = f'/{NAME}/follow_joint_trajectory'
THROUGH = '/serve/follow_joint_trajectory'
WAYS = {'direct': DIRECT, 'through serve': THROUGH}
ENDINGS = {
    GoalStatus.STATUS_SUCCEEDED: 'succeeded',
    GoalStatus.STATUS_CANCELED: 'canceled',
    GoalStatus.STATUS_ABORTED: 'aborted',
}
LONGEST_S = 300.0
IDLE_S = 3.0
RATE_HZ = 500
JOINTS = tuple(panda().joint_names)


def main(request: dict[str, Any]) -> dict[str, Any]:
    """Measure latencies, then send many goals; return figures."""
    rclpy.init()
    node = rclpy.create_node('goal_client')
    with (
        tempfile.TemporaryDirectory() as folder,
        spun(node),
        controlled(node, JOINTS, Path(folder), RATE_HZ),
        running('serve', _parameters(request['model'])) as serve,
    ):
        client = Client(node)
        client.latencies(request['points'], 1)  # compiles and discovers
        idle_share = _cpu_share(serve.pid)
        used, begun = cpu_seconds(serve.pid), time.monotonic()
        latencies = client.latencies(request['points'], request['repeats'])
        used = cpu_seconds(serve.pid) - used - idle_share * (time.monotonic() - begun)
        return {
            **request,
            'load': os.getloadavg()[0],
            'serve CPU ms per goal': 1e3 * used / (2 * request['repeats']),
            **latencies,
            **client.many(request['goals']),
        }


def _cpu_share(pid: int) -> float:
    """Return the share of a core that a process takes without goals."""
    used = cpu_seconds(pid)
    time.sleep(IDLE_S)
    return (cpu_seconds(pid) - used) / IDLE_S


def _parameters(model: str) -> dict[str, str]:
    return {
        'model_path': model,
        'accept_unproven': 'true',  # its speed is measured, not its errors
        'torque_limits': json.dumps(LIMITS),
        'controller_action': DIRECT,
        'joints': json.dumps(list(JOINTS)),
    }


class Client:
    """A client of both actions, which hears when the controller begins a goal."""

    def __init__(self, node: Node) -> None:
        calls = {f'{name}_service_qos_profile': qos.CALLS for name in ('goal', 'result', 'cancel')}
        self._clients = {
            way: ActionClient(node, FollowJointTrajectory, action, **calls)
            for way, action in WAYS.items()
        }
        self._n_sent = Counter[str]()
        self._begun: dict[bytes, float] = {}
        self._status: dict[str, Any] = {}
        heard = f'{DIRECT}/_action/status'
        node.create_subscription(GoalStatusArray, heard, self._on_status, qos.OUTPUT)
        node.create_subscription(DiagnosticStatus, '/serve/status', self._on_serve, qos.LATCHED)
        for client in self._clients.values():
            wait(client.server_is_ready)
        wait(lambda: self._status.get('state') == 'active')
        wait(lambda: 'no controller' not in self._status['summary'])

    def latencies(self, n_points: int, repeats: int) -> dict[str, float]:
        """Return medians and 90 % of the time until the controller begins or rejects a goal."""
        measured: dict[str, list[float]] = {
            f'{what} {way}': [] for what in ('begun', 'rejected') for way in WAYS
        }
        for _ in range(repeats):
            for way in WAYS:
                begun = self._begin(way, plan(np.full(7, 0.3), 2.0, n_points))
                measured[f'begun {way}'].append(1e3 * begun)
                measured[f'rejected {way}'].append(1e3 * self._reject(way, n_points))
        figures = {}
        for key, values in measured.items():
            figures[f'{key} ms'] = float(np.median(values))
            figures[f'{key} 90 % ms'] = float(np.percentile(values, 90))
        return figures

    def many(self, n_goals: int) -> dict[str, Any]:
        """Send goals that overtake each other, are cancelled, or cannot be filled; count ends."""
        before = self._settled_counts()
        rng, results, endings = np.random.default_rng(0), [], Counter[str]()
        begun = time.monotonic()
        for _ in range(n_goals):
            seconds = float(rng.choice([0.05, 0.1, 0.4]))
            goal = plan(rng.uniform(-0.5, 0.5, 7), seconds, 11)
            if rng.uniform() < 0.1:
                goal.trajectory.joint_names = [*JOINTS[:-1], 'gripper']
            handle = self._send('through serve', goal)
            results.append(handle.get_result_async())
            if rng.uniform() < 0.3:
                done(handle.cancel_goal_async())
            if rng.uniform() < 0.3:
                done(results[-1])
        endings.update(ENDINGS[done(each).status] for each in results)
        seconds = time.monotonic() - begun
        counted = {key: n - before[key] for key, n in self._settled_counts().items()}
        return {
            **{f'client {key}': endings[key] for key in ENDINGS.values()},
            **{f'serve {key}': n for key, n in counted.items()},
            'goals per second': n_goals / seconds,
            'adds up': counted['succeeded'] == endings['succeeded']
            and counted['canceled'] == endings['canceled']
            and counted['aborted'] + counted['refused'] == endings['aborted']
            and endings.total() == n_goals,
        }

    def _begin(self, way: str, goal: Any) -> float:
        """Return how long the controller took to begin a goal [s], and cancel it."""
        at = time.perf_counter()
        handle = self._send(way, goal)
        result, key = handle.get_result_async(), bytes(handle.goal_id.uuid)
        wait(lambda: key in self._begun)
        done(handle.cancel_goal_async())
        done(result)
        return self._begun[key] - at

    def _reject(self, way: str, n_points: int) -> float:
        """Return how long the controller took to reject a goal that has passed [s]."""
        goal = plan(np.full(7, 0.3), 2.0, n_points)
        goal.trajectory.header.stamp.sec = 1
        at = time.perf_counter()
        handle = self._sent(way, goal)
        if handle.accepted:
            done(handle.get_result_async())
        return time.perf_counter() - at

    def _send(self, way: str, goal: Any) -> Any:
        handle = self._sent(way, goal)
        assert handle.accepted
        return handle

    def _sent(self, way: str, goal: Any) -> Any:
        self._n_sent[way] += 1
        return done(self._clients[way].send_goal_async(goal))

    def _settled_counts(self) -> dict[str, int]:
        """Return the counts of `serve` once they have all goals, and all have ended."""

        def are_settled() -> bool:
            counts = self._counts()
            everything = counts['received'] == self._n_sent['through serve']
            return everything and counts['running'] == 0

        wait(are_settled)
        return self._counts()

    def _counts(self) -> dict[str, int]:
        counted = dict(self._status['goals'])
        refused = counted.pop('refused')
        return {**counted, 'refused': sum(refused.values()) if refused else 0}

    def _on_status(self, message: GoalStatusArray) -> None:
        for each in message.status_list:
            if each.status >= GoalStatus.STATUS_EXECUTING:
                key = bytes(each.goal_info.goal_id.uuid)
                self._begun.setdefault(key, time.perf_counter())

    def _on_serve(self, message: DiagnosticStatus) -> None:
        self._status = messages.status_values(message)


def plan(end: Array, seconds: float, n_points: int) -> Any:
    """Return a goal from zero to an end, from rest to rest."""
    t = np.linspace(0.0, seconds, n_points + 1)[1:]  # the controller is at the first point
    s = (t / seconds)[:, np.newaxis]
    q = end * s**3 * (10 - 15 * s + 6 * s**2)
    dq = end * 30 * s**2 * (1 - s) ** 2 / seconds
    ddq = end * 60 * s * (1 - s) * (1 - 2 * s) / seconds**2
    trajectory = messages.plan_message(JOINTS, t, q, dq, ddq)
    return FollowJointTrajectory.Goal(trajectory=trajectory)


def done(future: Any) -> Any:
    """Return the result of a future that another thread sets."""
    event = threading.Event()
    future.add_done_callback(lambda _: event.set())
    if not event.wait(LONGEST_S):
        raise TimeoutError(f'no answer in {LONGEST_S:g} s')
    return future.result()


def wait(condition: Callable[[], Any]) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + LONGEST_S
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f'not in {LONGEST_S:g} s')
        time.sleep(0.002)


if __name__ == '__main__':
    print(json.dumps(main(json.loads(sys.argv[1]))))
