"""Cells of `serve_rate`: a stream of references to `serve`, and the answers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
import json
import math
import os
from pathlib import Path
import struct
import subprocess
import sys
import threading
import time
from typing import Any, NamedTuple

from control_msgs.msg import DynamicInterfaceGroupValues
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from benchmarks._cells import running
from lip_id_ros.adaptation.followed import FollowedArm, WalkSettings
from lip_id_ros.adaptation.updates import Update
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.nodes import messages, qos
from lip_id_ros.nodes.running import make_executor, spinning
from lip_id_ros.signals.joint_states import NANOSECONDS
from lip_id_ros.simulation import panda, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION

LIMITS = [87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]  # data sheet [N m]
START_SECONDS, LAST_SECONDS, TURN_S = 120.0, 2.0, 4.0
WARM_UP = -1
LATE_MS = 1, 2, 5
"""An answer that comes later is missed by a loop that asks so long ahead."""

STAMP, STAMP_OFFSET = struct.Struct('<iI'), 4
"""The first field of a message with a header, after the four bytes of the encoding."""


def main(request: dict[str, Any]) -> dict[str, Any]:
    """Stream references for some seconds, in turns with updates if asked; return rows."""
    rclpy.init()
    node = rclpy.create_node('rate_client')
    client, seconds = Client(node), request['seconds']
    rates = [0.0] if request['updates_hz'] is None else [0.0, request['updates_hz']]
    turns: dict[float, list[Turn]] = {rate: [] for rate in rates}
    updates = Updates(node, request['model'], seconds * rates[-1])
    parameters = {'follow_adaptation': json.dumps(rates[-1] > 0.0)}
    if request['deviations_hz'] is not None:
        parameters |= {'publish_std': 'true', 'std_rate_hz': str(request['deviations_hz'])}
    with serving(request['model'], request['executor'], **parameters) as process, spun(node):
        client.wait_for_answer()
        count = max(1, round(seconds / TURN_S))
        for rate in rates * count:
            with updates.coming(rate):
                turn = client.turn(process.pid, request['rate_hz'], seconds / count)
            turns[rate].append(turn)
        time.sleep(LAST_SECONDS)
    followed = {0.0: 0, rates[-1]: updates.followed}
    rows = [
        {**request, 'updates_hz': rate, 'followed': followed[rate], **client.figures(those)}
        for rate, those in turns.items()
    ]
    return {'rows': rows}


class Turn(NamedTuple):
    """References that were sent, the time that it took, and the processor time of `serve` [s]."""

    numbers: range
    elapsed: float
    cpu: float


class Updates:
    """
    Updates of the model as `adapt` publishes them: its friction up and down by a tenth.

    `most`: how many are to come.

    """

    def __init__(self, node: Node, path: str, most: float) -> None:
        kind = DynamicInterfaceGroupValues
        self._publisher = node.create_publisher(kind, '/adapt/update', qos.LATCHED)
        self._clock = node.get_clock()
        node.create_subscription(DiagnosticStatus, '/serve/status', self._hear, qos.LATCHED)
        self._waiting = iter(_updates(path, math.ceil(1.1 * most)))
        self.followed = 0

    @contextmanager
    def coming(self, rate_hz: float) -> Iterator[None]:
        """Publish at a rate while the block runs, at times of no fixed phase."""
        ended = threading.Event()
        thread = threading.Thread(target=self._publish, args=[rate_hz, ended])
        if rate_hz > 0.0:
            thread.start()
        yield
        ended.set()
        if rate_hz > 0.0:
            thread.join()

    def _publish(self, rate_hz: float, ended: threading.Event) -> None:
        rng = np.random.default_rng()
        while not ended.wait(rng.uniform(0.5, 1.5) / rate_hz):
            stamp = self._clock.now().to_msg()
            self._publisher.publish(messages.update_message(stamp, '/adapt', next(self._waiting)))

    def _hear(self, message: DiagnosticStatus) -> None:
        self.followed = messages.status_values(message)['adaptation'].get('followed', 0)


def _updates(path: str, count: int) -> list[Update]:
    """Return updates of a model."""
    model = InverseDynamicsModel.load(path)
    arm = FollowedArm(model, WalkSettings())
    found = []
    for number in range(count):
        numbers = arm.start.copy()
        numbers[arm.friction] *= 1.0 + 0.1 * np.sin(number)
        found.append(Update(model.fingerprint, numbers, True))
    return found


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
        self._deviations = 0
        node.create_subscription(
            JointState, '/serve/torque_std', self._count, qos.OUTPUT, raw=True
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

    def turn(self, pid: int, rate_hz: float, seconds: float) -> Turn:
        """Stream for some seconds, beside the clock of the process of `serve`."""
        first, used, began = len(self._sent), cpu_seconds(pid), time.perf_counter()
        self.stream(rate_hz, seconds)
        elapsed = time.perf_counter() - began
        return Turn(range(first, len(self._sent)), elapsed, cpu_seconds(pid) - used)

    def figures(self, turns: Sequence[Turn]) -> dict[str, Any]:
        """Return what was lost, how long answers took, and whether they were safe."""
        answers = [(at, deserialize_message(each, JointState)) for at, each in self._answers]
        found = {number_of(answer): at for at, answer in answers}
        # serve also publishes at other times: while warming up, and after the last reference
        numbers = [n for turn in turns for n in turn.numbers]
        ms = [1e3 * (found[n] - self._sent[n]) for n in numbers if n in found]
        elapsed = sum(turn.elapsed for turn in turns)
        return {
            'sent': len(numbers),
            'sent_per_second': len(numbers) / elapsed,
            'lost': len(numbers) - len(ms),
            'wrong': sum(not safe(answer) for _, answer in answers),
            **{f'late_percent_{late}': missed(ms, len(numbers), late) for late in LATE_MS},
            'answer_ms_median': float(np.median(ms)),
            'answer_ms_p99': float(np.percentile(ms, 99)),
            'answer_ms_max': max(ms),
            'deviations': self._deviations,
            'serve_cpu_percent': 100.0 * sum(turn.cpu for turn in turns) / elapsed,
        }

    def _count(self, message: bytes) -> None:
        self._deviations += 1

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
    STAMP.pack_into(message, STAMP_OFFSET, *divmod(number + 2, NANOSECONDS))
    return bytes(message)


def missed(ms: Sequence[float], count: int, most_ms: float) -> float:
    """Return the share of references that were answered later than this, or never [%]."""
    return 100.0 * (1.0 - sum(each <= most_ms for each in ms) / count)


def number_of(answer: JointState) -> int:
    """Return the number of the reference that is answered."""
    stamp = answer.header.stamp
    return int(stamp.sec * NANOSECONDS + stamp.nanosec - 2)


def safe(answer: JointState) -> bool:
    """Return whether torques are finite, complete and within the limits."""
    effort = np.asarray(answer.effort)
    return effort.shape == (len(LIMITS),) and bool((np.abs(effort) <= LIMITS).all())  # nan, too


def serving(
    model: str, executor: str, **parameters: str
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    """Run `serve` while the block runs."""
    return running(
        'serve',
        {
            'model_path': model,
            'autostart': 'true',
            'accept_unproven': 'true',  # its speed is measured, not its errors
            'executor': executor,
            'torque_limits': json.dumps(LIMITS),
            'ramp_s': '0.0',
            'joints': json.dumps(list(panda().joint_names)),
            **parameters,
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
    """Return the processor time of a process and of those it has started, so far [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rsplit(')', 1)[1].split()
    own = (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
    children = Path(f'/proc/{pid}/task/{pid}/children').read_text().split()
    return own + sum(cpu_seconds(int(child)) for child in children)


if __name__ == '__main__':
    print(json.dumps(main(json.loads(sys.argv[1]))))
