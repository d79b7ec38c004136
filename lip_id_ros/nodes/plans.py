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
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
import json
import queue
import signal
import struct
import subprocess
import sys
import threading
from types import FrameType
from typing import Any, BinaryIO, cast, Self, TYPE_CHECKING

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory

from lip_id_ros.adaptation.followed import FollowedArm, WalkSettings
from lip_id_ros.arrays import Array
from lip_id_ros.errors import LipIdError
from lip_id_ros.feedforward.loading import load_model, LoadedModel, ModelFile
from lip_id_ros.feedforward.server import ServedArm, Server
from lip_id_ros.feedforward.settings import Overload, ServeSettings
from lip_id_ros.nodes import messages
from lip_id_ros.progress import deadline, kill, LONGEST_START_S
from lip_id_ros.signals.joints import Refusal, RefusedError
from lip_id_ros.signals.torque_steps import Sent

if TYPE_CHECKING:
    from lip_id_ros.model import InverseDynamicsModel

MOST_WAITING = 8
LONGEST_ANSWER_S = 20.0
"""The longest plans take a second or two."""

LENGTHS = struct.Struct('<II')
ABANDON = signal.SIGUSR1
"""Asks the process to end a computation: to start another one would take longer than all of it."""


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
        self._is_computing = False
        self._computes = threading.Lock()  # held where that changes
        self._stopped = False
        threading.Thread(target=self._work, name='plans', daemon=True).start()

    @property
    def n_waiting(self) -> int:
        """How many plans wait for their answer."""
        return self._n_waiting

    def submit(self, raw: bytes, settings: ServeSettings, numbers: Array | None = None) -> None:
        """
        Ask for the efforts of a plan; RefusedError if too many wait, which are interrupted.

        `numbers`: of an update that is followed.
        """
        self.interrupt()
        if self._n_waiting >= MOST_WAITING:
            raise RefusedError(Refusal.BUSY)
        self._n_waiting += 1
        adapted = None if numbers is None else numbers.tolist()
        header = {'settings': asdict(settings), 'numbers': adapted}
        self._waiting.put((self._generation, json.dumps(header).encode(), raw))

    def interrupt(self) -> None:
        """Have no plan published that was submitted before, nor computed any further."""
        self._generation += 1
        with self._computes:
            if self._is_computing and self._process is not None:
                self._process.send_signal(ABANDON)

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
            with deadline(process, LONGEST_ANSWER_S), self._computing():
                _write(cast('BinaryIO', process.stdin), header, raw)
                answer, planned = _read(cast('BinaryIO', process.stdout))
        except FAILURES:
            self._process = None
            return UNANSWERED
        return Planned(planned, **json.loads(answer))

    @contextmanager
    def _computing(self) -> Iterator[None]:
        with self._computes:
            self._is_computing = True
        try:
            yield
        finally:
            with self._computes:
                self._is_computing = False

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


class Plans:
    """
    Plans and goals that are answered beside the stream, by the model that is served.

    The newest counts: whatever is answered here or elsewhere later interrupts those before.
    """

    def __init__(self, server: Server) -> None:
        self._server, self._settings = server, ServeSettings()
        self._worker: PlanWorker | None = None
        self._waiting: deque[Callable[[Planned], None]] = deque()

    @property
    def n_waiting(self) -> int:
        """How many are being answered."""
        return len(self._waiting)

    def use(self, loaded: LoadedModel) -> None:
        """Answer by this model from now on."""
        self.stop()
        self._worker = PlanWorker(loaded.file) if loaded.file is not None else None

    def adjust(self, settings: ServeSettings) -> None:
        """Answer by these settings from now on."""
        self._settings = settings
        self.interrupt()

    def are_slow(self, are_long: bool) -> bool:
        """Whether to answer takes so long that it is to be done beside the stream."""
        return are_long or self._settings.overload_policy != Overload.CUT

    def submit(self, raw: bytes, n_points: int, answered: Callable[[Planned], None]) -> None:
        """Have a plan answered, for `accept`; RefusedError, counted, if it cannot be."""
        with self._server.counts.references.refusing():
            adapted = self._server.ready_arm().loaded.adapted
            if n_points > self._settings.max_plan_points:
                raise RefusedError(Refusal.TOO_LONG)
            if self._worker is None:
                raise RefusedError(Refusal.INACTIVE)
            numbers = None if adapted is None else adapted.numbers
            self._worker.submit(raw, self._settings, numbers)
        self._waiting.append(answered)

    def accept(self, planned: Planned) -> bytes:
        """Count an answer; return the plan with efforts. RefusedError, counted, if it is none."""
        with self._server.counts.references.refusing():
            if planned.refusal:
                raise RefusedError(Refusal(planned.refusal))
            self._server.ready_arm()
        self._server.planned_beside(planned.counts)
        return planned.raw

    def interrupt(self) -> None:
        """Answer none of those that wait."""
        if self._worker is not None:
            self._worker.interrupt()

    def abandon(self, answered: Callable[[Planned], None]) -> None:
        """Compute no further what nobody wants any more."""
        if self._waiting and self._waiting[-1] == answered:
            self.interrupt()

    def watch(self) -> None:
        """Hand back an answer that has come."""
        planned = self._worker.take() if self._worker else None
        if planned is not None:
            self._waiting.popleft()(planned)

    def stop(self) -> None:
        """End the process; those that wait are interrupted."""
        if self._worker is not None:
            self._worker.stop()
            self._worker = None
        while self._waiting:
            self._waiting.popleft()(INTERRUPTED)


def main(path: str, requests: BinaryIO, answers: BinaryIO) -> int:
    """
    Answer plans with the model at `path` until their stream ends; return the exit status.

    `requests` has settings and a plan; `answers` first an empty frame, then refusal, counts and
    the plan with efforts.
    """
    signal.signal(ABANDON, signal.SIG_IGN)
    loaded = load_model(ServeSettings(model_path=path, accept_unproven=True), ())
    _write(answers, b'', b'')
    while True:
        try:
            header, raw = _read(requests)
        except EOFError:
            return 0
        counts: Counter[str] = Counter()
        asked = json.loads(header)
        values = {key: _tuples(value) for key, value in asked['settings'].items()}
        rest = Sent(np.zeros(len(loaded.joint_names)))
        try:
            with _Abandonment() as abandonment:
                with abandonment.held():
                    plan = _deserialised(raw)
                served = _adapted(loaded, asked['numbers'])
                arm = ServedArm(served, ServeSettings(**values), counts, rest)
                with np.errstate(all='ignore'):
                    filled = messages.filled(plan, arm)
            planned, refusal = bytes(serialize_message(filled)), ''
        except RefusedError as refused:
            planned, refusal = b'', refused.reason.value
        except (LipIdError, AbandonedError):
            planned, refusal = b'', Refusal.INTERRUPTED.value
        _write(answers, json.dumps({'refusal': refusal, 'counts': counts}).encode(), planned)


class AbandonedError(BaseException):
    """Nobody wants the answer any more: of no class that the computation itself handles."""


class _Abandonment:
    """Ends the block with AbandonedError where the parent asks for that; else it is not heard."""

    def __init__(self) -> None:
        self._is_held = self._is_asked = False

    def __enter__(self) -> Self:
        signal.signal(ABANDON, self._abandon)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(ABANDON, signal.SIG_IGN)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Ask for it after a block whose compiled code would hide the error."""
        self._is_held = True
        yield
        self._is_held = False
        if self._is_asked:
            raise AbandonedError

    def _abandon(self, number: int, frame: FrameType | None) -> None:
        signal.signal(ABANDON, signal.SIG_IGN)
        self._is_asked = True
        if not self._is_held:
            raise AbandonedError


def _adapted(loaded: LoadedModel, numbers: list[float] | None) -> LoadedModel:
    """Return a model as an update has it."""
    if numbers is None:
        return loaded
    arm = FollowedArm(cast('InverseDynamicsModel', loaded.model), WalkSettings())
    return replace(loaded, model=arm.with_numbers(np.array(numbers)))


def _deserialised(raw: bytes) -> JointTrajectory:
    try:
        return deserialize_message(raw, JointTrajectory)
    except Exception:  # the class depends on the middleware
        raise RefusedError(Refusal.MALFORMED) from None


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
