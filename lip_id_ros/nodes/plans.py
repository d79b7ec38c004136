"""
A process that answers plans beside the stream.

To deserialise, compute and serialise a plan of ten thousand points takes hundreds of milliseconds
with the interpreter held, and to look between the points of one of long duration takes as long:
the stream and the watch over it would stand still. So such a plan is passed on as it came, as
bytes, to a process of its own, which runs this module, and its answer is published as bytes. Each
frame is two lengths, a JSON header and the bytes of a message. An empty frame comes first, when
the process has the model.
"""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import asdict, dataclass, field
import json
import queue
import struct
import subprocess
import sys
import threading
from typing import Any, BinaryIO, cast

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.errors import LipIdError
from lip_id_ros.feedforward.loading import load_model, ModelFile
from lip_id_ros.feedforward.server import ServedArm, Server
from lip_id_ros.feedforward.settings import Overload, ServeSettings
from lip_id_ros.nodes import messages
from lip_id_ros.processes import deadline, kill, LONGEST_START_S
from lip_id_ros.signals.joints import Refusal, RefusedError
from lip_id_ros.signals.torque_steps import Sent

MOST_WAITING = 8
LONGEST_ANSWER_S = 20.0
"""The longest plans take a second or two."""

LENGTHS = struct.Struct('<II')


@dataclass(frozen=True)
class Planned:
    """
    The answer to a long plan.

    `raw`: the plan with efforts, serialised; empty where it is refused. `refusal`: a value of
    `Refusal`, empty where it is answered. `counts`: what was limited and what was doubtful.
    """

    raw: bytes = b''
    refusal: str = ''
    counts: dict[str, int] = field(default_factory=dict)


INTERRUPTED = Planned(refusal=Refusal.INTERRUPTED.value)
UNANSWERED = Planned(refusal=Refusal.UNANSWERED.value)

FAILURES = (OSError, ValueError, EOFError)
"""What reading and writing raise where the process ended."""


class PlanWorker:
    """The parent's end of the process, which starts at once, and again when it has ended."""

    def __init__(self, file: ModelFile) -> None:
        self._file = file
        self._waiting: queue.SimpleQueue[tuple[int, bytes, bytes] | None] = queue.SimpleQueue()
        self._done: deque[tuple[int, Planned]] = deque()
        self._generation = 0
        self._n_waiting = 0
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False
        threading.Thread(target=self._work, name='plans', daemon=True).start()

    @property
    def n_waiting(self) -> int:
        """How many plans wait for their answer."""
        return self._n_waiting

    def submit(self, raw: bytes, settings: ServeSettings) -> None:
        """Ask for the efforts of a plan; RefusedError if too many wait, which are interrupted."""
        self.interrupt()
        if self._n_waiting >= MOST_WAITING:
            raise RefusedError(Refusal.BUSY)
        self._n_waiting += 1
        self._waiting.put((self._generation, json.dumps(asdict(settings)).encode(), raw))

    def interrupt(self) -> None:
        """Have no plan published that was submitted before."""
        self._generation += 1

    def take(self) -> Planned | None:
        """Return an answer that was not taken yet."""
        if not self._done:
            return None
        self._n_waiting -= 1
        generation, planned = self._done.popleft()
        return planned if generation == self._generation else INTERRUPTED

    def stop(self) -> int:
        """End the process; return how many plans get no answer."""
        self._stopped = True
        self._waiting.put(None)
        if self._process is not None:
            kill(self._process)
        return self._n_waiting

    def _work(self) -> None:
        try:
            self._start()
        except FAILURES:  # the first plan tries again
            self._process = None
        while (asked := self._waiting.get()) is not None and not self._stopped:
            generation, header, raw = asked
            planned = INTERRUPTED
            if generation == self._generation:
                planned = self._answer(header, raw)
            self._done.append((generation, planned))

    def _answer(self, header: bytes, raw: bytes) -> Planned:
        try:
            process = self._process or self._start()
            with deadline(process, LONGEST_ANSWER_S):
                _write(cast('BinaryIO', process.stdin), header, raw)
                answer, planned = _read(cast('BinaryIO', process.stdout))
        except FAILURES:
            self._process = None
            return UNANSWERED
        return Planned(planned, **json.loads(answer))

    def _start(self) -> subprocess.Popen[bytes]:
        if self._stopped:  # its file may be closed
            raise EOFError
        process = subprocess.Popen(
            [sys.executable, '-P', '-m', 'lip_id_ros.nodes.plans', self._file.place],
            pass_fds=(self._file.descriptor,),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        self._process = process
        if self._stopped:  # meanwhile
            kill(process)
        with deadline(process, LONGEST_START_S):
            _read(cast('BinaryIO', process.stdout))
        return process


def is_slow(is_long: bool, settings: ServeSettings) -> bool:
    """Return whether to answer a plan takes so long that it is to be done beside the stream."""
    return is_long or settings.overload_policy != Overload.CUT


def submit(
    worker: PlanWorker | None, server: Server, raw: bytes, n_points: int, settings: ServeSettings
) -> None:
    """Have a plan answered beside the stream; RefusedError, counted, if it cannot be."""
    with server.counts.references.refusing():
        server.ready_arm()
        if n_points > settings.max_plan_points:
            raise RefusedError(Refusal.TOO_LONG)
        if worker is None:
            raise RefusedError(Refusal.INACTIVE)
        worker.submit(raw, settings)


def accept(planned: Planned, server: Server) -> bytes:
    """Count an answer; return the plan with efforts. RefusedError, counted, if there is none."""
    with server.counts.references.refusing():
        server.ready_arm()
        if planned.refusal:
            raise RefusedError(Refusal(planned.refusal))
    server.planned_beside(planned.counts)
    return planned.raw


def main(path: str, requests: BinaryIO, answers: BinaryIO) -> int:
    """
    Answer plans with the model at `path` until their stream ends; return the exit status.

    `requests` has settings and a plan; `answers` first an empty frame, then refusal, counts and
    the plan with efforts.
    """
    loaded = load_model(ServeSettings(model_path=path, accept_unproven=True), ())
    _write(answers, b'', b'')
    while True:
        try:
            header, raw = _read(requests)
        except EOFError:
            return 0
        counts: Counter[str] = Counter()
        values = {key: _tuples(value) for key, value in json.loads(header).items()}
        rest = Sent(np.zeros(len(loaded.joint_names)))
        try:
            arm = ServedArm(loaded, ServeSettings(**values), counts, rest)
            planned, refusal = _with_effort(arm, raw), ''
        except RefusedError as refused:
            planned, refusal = b'', refused.reason.value
        except LipIdError:
            planned, refusal = b'', Refusal.INTERRUPTED.value
        _write(answers, json.dumps({'refusal': refusal, 'counts': counts}).encode(), planned)


def _with_effort(arm: ServedArm, raw: bytes) -> bytes:
    try:
        plan = deserialize_message(raw, JointTrajectory)
    except Exception:  # the class depends on the middleware
        raise RefusedError(Refusal.MALFORMED) from None
    with np.errstate(all='ignore'):
        filled = messages.filled(plan, arm)
    return bytes(serialize_message(filled))


def _tuples(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _write(stream: BinaryIO, header: bytes, raw: bytes) -> None:
    stream.write(LENGTHS.pack(len(header), len(raw)) + header)
    stream.write(raw)
    stream.flush()


def _read(stream: BinaryIO) -> tuple[bytes, bytes]:
    lengths = stream.read(LENGTHS.size)
    if len(lengths) < LENGTHS.size:
        raise EOFError
    n_header, n_raw = LENGTHS.unpack(lengths)
    header, raw = stream.read(n_header), stream.read(n_raw)
    if len(header) < n_header or len(raw) < n_raw:
        raise EOFError
    return header, raw


if __name__ == '__main__':
    sys.exit(main(sys.argv[1], sys.stdin.buffer, sys.stdout.buffer))
