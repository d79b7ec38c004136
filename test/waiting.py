"""Waiting for events: a wait fails when nothing progresses any more, not at a fixed hour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
import subprocess
import time
from typing import Any

import psutil

POLL_S = 0.02
WINDOW_S = 5.0
BUSY = 0.1  # share of a core above which the processes are taken to be at work
IDLE_S = 120.0
LIMIT_S = 900.0  # for processes that are busy for ever


class Patience:
    """
    Decide whether a wait may go on: while the processes that this one started compute, it may.

    A loaded machine makes everything slow, so that no fixed time is right; but a process that
    will never do what is waited for stops computing, on any machine. Where one computes for ever,
    as a controller manager, `limit_s` ends the wait.

    """

    def __init__(self, limit_s: float = LIMIT_S) -> None:
        self._limit_s = limit_s
        self._begun = self._looked = self._busy = time.monotonic()
        self._used: dict[int, float] = {}  # looking takes longer than most waits

    @property
    def waited_s(self) -> float:
        """How long the wait has lasted [s]."""
        return time.monotonic() - self._begun

    @property
    def exhausted(self) -> bool:
        now = time.monotonic()
        if now - self._looked > WINDOW_S:
            used = _cpu_seconds()
            new = sum(max(0.0, each - self._used.get(pid, 0.0)) for pid, each in used.items())
            if new > BUSY * (now - self._looked):
                self._busy = now
            self._looked, self._used = now, used
        return now - self._busy > IDLE_S or now - self._begun > self._limit_s


def wait_until(condition: Callable[[], Any], what: str, limit_s: float = LIMIT_S) -> None:
    """Wait for a condition; fail once nothing has progressed for long, or the limit has passed."""
    patience = Patience(limit_s)
    while not condition():
        assert not patience.exhausted, f'{what} did not happen in {patience.waited_s:.0f} s'
        time.sleep(POLL_S)


def suspend(process: psutil.Process) -> None:
    process.suspend()
    wait_until(lambda: process.status() == psutil.STATUS_STOPPED, 'the stop of a process')


def run_to_end(
    command: Sequence[str], folder: Path, **options: Any
) -> subprocess.CompletedProcess[str]:
    """Run a program while it progresses; return its exit status and what it wrote."""
    out, err = folder / 'stdout.txt', folder / 'stderr.txt'
    with open(out, 'wb') as stdout, open(err, 'wb') as stderr:
        process = subprocess.Popen(command, stdout=stdout, stderr=stderr, **options)
        try:
            wait_until(lambda: process.poll() is not None, f'the end of {command}')
        finally:
            process.kill()
            process.wait()
    return subprocess.CompletedProcess(
        command, process.returncode, out.read_text(), err.read_text()
    )


def _cpu_seconds() -> dict[int, float]:
    """CPU time used so far by each process that this one started."""
    used = {}
    for process in psutil.Process().children(recursive=True):
        try:
            times = process.cpu_times()
        except psutil.Error:  # it has ended
            continue
        used[process.pid] = times.user + times.system
    return used
