"""One cell of `serve_rate`: a stream of references to `serve`, and the answers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
import json
import os
from pathlib import Path
import struct
import subprocess
import sys
import threading
import time
from typing import Any

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from benchmarks._cells import running
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.running import make_executor, spinning
from lip_id_ros.simulation import panda, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION

LIMITS = [87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]  # data sheet [N m]
START_SECONDS, LAST_SECONDS = 120.0, 2.0
WARM_UP = -1
STAMP, STAMP_OFFSET = struct.Struct('<iI'), 4
"""The first field of a message with a header, after the four bytes of the encoding."""


def main(request: dict[str, Any]) -> dict[str, Any]:
    """Stream references for some seconds; return figures."""
    rclpy.init()
    node = rclpy.create_node('rate_client')
    client = Client(node)
    with serving(request['model'], request['executor']) as process, spun(node):
        client.wait_for_answer()
        used = cpu_seconds(process.pid)
        began = time.perf_counter()
        client.stream(request['rate_hz'], request['seconds'])
        elapsed = time.perf_counter() - began
        cpu = 100.0 * (cpu_seconds(process.pid) - used) / elapsed
        time.sleep(LAST_SECONDS)
    return {**request, 'serve_cpu_percent': cpu, **client.figures(elapsed)}


class Client:
    """
    Publishes references whose stamps are their numbers, and receives the torques.

    Both as serialized messages, read after the last: what is measured is `serve` and the
    middleware, with a client that costs as little as a controller in C++.

    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(
            JointTrajectory, '/serve/desired_trajectory', qos.REFERENCE
        )
        node.create_subscription(
            JointState, '/serve/feedforward_torque', self._receive, qos.OUTPUT, raw=True
        )
        self._references = [bytearray(serialize_message(each)) for each in references()]
        self._sent: list[float] = []
        self._answers: list[tuple[float, bytes]] = []
        self._warm = threading.Event()

    def wait_for_answer(self) -> None:
        """Send references until the first is answered."""
        deadline = time.monotonic() + START_SECONDS
        while not self._warm.wait(0.1):
            self._publisher.publish(numbered(self._references[0], WARM_UP))
            if time.monotonic() > deadline:
                raise TimeoutError(f'serve did not answer in {START_SECONDS:g} s')
        time.sleep(1.0)

    def stream(self, rate_hz: float, seconds: float) -> None:
        """Publish at a fixed rate; numbers go on from the stream before."""
        begin, first = time.perf_counter(), len(self._sent)
        for number in range(first, first + round(rate_hz * seconds)):
            message = numbered(self._references[number % len(self._references)], number)
            ahead = begin + (number - first) / rate_hz - time.perf_counter()
            if ahead > 0:
                time.sleep(ahead)
            self._sent.append(time.perf_counter())
            self._publisher.publish(message)

    def figures(self, elapsed: float) -> dict[str, Any]:
        """Return what was lost, how long answers took, and whether they were safe."""
        answers = [(at, deserialize_message(each, JointState)) for at, each in self._answers]
        found = {number_of(answer): at for at, answer in answers}
        # serve also publishes at other times: while warming up, and after the last reference
        ms = [1e3 * (found[n] - at) for n, at in enumerate(self._sent) if n in found]
        return {
            'sent': len(self._sent),
            'sent_per_second': len(self._sent) / elapsed,
            'lost': len(self._sent) - len(ms),
            'wrong': sum(not safe(answer) for _, answer in answers),
            'answer_ms_median': float(np.median(ms)),
            'answer_ms_p99': float(np.percentile(ms, 99)),
            'answer_ms_max': max(ms),
        }

    def _receive(self, message: bytes) -> None:
        self._answers.append((time.perf_counter(), message))
        self._warm.set()


def references() -> list[JointTrajectory]:
    """Return references along ten seconds of a motion of the Panda."""
    trajectory = SinusoidTrajectory.random(MOTION, np.random.default_rng(1))
    motion = trajectory.sample(np.linspace(0.0, 10.0, 1000))
    points = [
        JointTrajectoryPoint(positions=q, velocities=dq, accelerations=ddq)
        for q, dq, ddq in zip(*(part.tolist() for part in motion), strict=True)
    ]
    names = list(panda().joint_names)
    return [JointTrajectory(joint_names=names, points=[point]) for point in points]


def numbered(message: bytearray, number: int) -> bytes:
    """Stamp a serialized reference with its number; a stamp of zero would mean now."""
    STAMP.pack_into(message, STAMP_OFFSET, *divmod(number + 2, messages.NANOSECONDS))
    return bytes(message)


def number_of(answer: JointState) -> int:
    """Return the number of the reference that is answered."""
    stamp = answer.header.stamp
    return int(stamp.sec * messages.NANOSECONDS + stamp.nanosec - 2)


def safe(answer: JointState) -> bool:
    """Return whether torques are finite, complete and within the limits."""
    effort = np.asarray(answer.effort)
    return effort.shape == (len(LIMITS),) and bool((np.abs(effort) <= LIMITS).all())  # nan, too


def serving(model: str, executor: str) -> AbstractContextManager[subprocess.Popen[bytes]]:
    """Run `serve` while the block runs."""
    return running(
        'serve',
        {
            'model_path': model,
            'accept_unproven': 'true',  # its speed is measured, not its errors
            'executor': executor,
            'torque_limits': json.dumps(LIMITS),
            'ramp_s': '0.0',
            'joints': json.dumps(list(panda().joint_names)),
        },
    )


@contextmanager
def spun(node: Node) -> Iterator[None]:
    """Spin a node in another thread while the block runs."""
    try:
        with spinning(node, executor=make_executor('events')):
            yield
    finally:
        rclpy.shutdown()


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process so far [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rsplit(')', 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


if __name__ == '__main__':
    print(json.dumps(main(json.loads(sys.argv[1]))))
