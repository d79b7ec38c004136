"""
Standard deviations beside a stream: of the newest reference, as often as asked for.

The triangular solve of a query takes milliseconds, in which LAPACK holds the interpreter: beside
the answers of `serve` it would delay them. So it is done in a process of its own, which runs this
module. Raw doubles go to its standard input, 3 n for each query, and n come back; before the
first, n zeros show that the model is ready.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import subprocess
import sys
import threading
from typing import Any, BinaryIO, cast, IO

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ModelError
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.progress import deadline, kill, LONGEST_START_S

LONGEST_VALID_S = 1.0


@dataclass(frozen=True, eq=False)
class Deviated:
    """Standard deviations (n,) of torques [N m or N], their tag, and when they were asked [s]."""

    std: Array
    tag: Any
    asked_at: float


class Deviations:
    """
    The parent's end of the process; construction waits until the model is ready.

    `inherited`: descriptors that the process needs: of the file that is open where `path` is
    /dev/fd/3. ModelError if the process ends before, or stands still.
    """

    def __init__(self, path: str, n_joints: int, inherited: Sequence[int] = ()) -> None:
        self._n_joints = n_joints
        self._asked: tuple[Any, float] | None = None
        self._asked_at = -np.inf
        self._done: Deviated | None = None
        self.latest: Deviated | None = None
        self._followed: Deviated | None = None
        self._process = subprocess.Popen(
            [sys.executable, '-P', '-m', 'lip_id_ros.feedforward.deviations', path],
            pass_fds=tuple(inherited),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
        )
        self._queries = cast('IO[bytes]', self._process.stdin)
        self._answers = cast('IO[bytes]', self._process.stdout)
        with deadline(self._process, LONGEST_START_S):
            ready = self._read()
        if ready is None:
            raise ModelError(
                'the model must have standard deviations, but the process that computes them '
                f'ended or was not ready within {LONGEST_START_S:g} s; see the lines above, or '
                'have std_policy ignore them, and publish_std false.'
            )
        threading.Thread(target=self._collect, name='deviations', daemon=True).start()

    @property
    def alive(self) -> bool:
        """Whether the process still runs."""
        return self._process.poll() is None

    def waited(self, now: float) -> float:
        """Return how long an answer has been waited for [s], 0 while none is."""
        asked = self._asked
        return now - asked[1] if asked else 0.0

    def offer(self, state: Array, tag: Any, now: float, period_s: float) -> None:
        """Ask for a state (3, n), unless one is in work or came less than `period_s` ago."""
        if self._asked is not None or now - self._asked_at < period_s or not self.alive:
            return
        self._asked, self._asked_at = (tag, now), now
        try:
            self._queries.write(state.tobytes())
            self._queries.flush()
        except OSError:  # it ended in between; see `alive`
            self._asked = None

    def take(self) -> Deviated | None:
        """Return a result that was not taken yet."""
        done, self._done = self._done, None
        return done

    def std(self, now: float, period_s: float) -> Array:
        """Return the newest standard deviations, infinite where none is recent."""
        longest = max(LONGEST_VALID_S, 3.0 * period_s)
        known = [each for each in (self.latest, self._followed) if each is not None]
        newest = max(known, key=lambda each: each.asked_at, default=None)
        if newest is None or now - newest.asked_at > longest:
            return np.full(self._n_joints, np.inf)
        return newest.std

    def follow(self, before: Deviations) -> None:
        """Return those of the model before until there are some of this one."""
        self._followed = before.latest

    def stop(self) -> None:
        """End the process."""
        kill(self._process)

    def _collect(self) -> None:
        while (std := self._read()) is not None:
            if self._asked is not None:
                self.latest = self._done = Deviated(std, *self._asked)
            self._asked = None

    def _read(self) -> Array | None:
        raw = self._answers.read(8 * self._n_joints)
        return np.frombuffer(raw) if len(raw) == 8 * self._n_joints else None


def main(path: str, queries: BinaryIO, answers: BinaryIO) -> int:
    """Answer queries (q, dq, ddq) with the model at `path` until they end; return the status."""
    model = InverseDynamicsModel.load(path)
    n = model.n_joints
    model.standard_deviation(*np.zeros((3, 1, n)))  # factorises
    answers.write(np.zeros(n).tobytes())
    answers.flush()
    while len(query := queries.read(3 * n * 8)) == 3 * n * 8:
        state = np.frombuffer(query).reshape(3, 1, n)
        answers.write(model.standard_deviation(*state).tau.tobytes())
        answers.flush()
    return 0


if __name__ == '__main__':
    sys.exit(main(sys.argv[1], sys.stdin.buffer, sys.stdout.buffer))
