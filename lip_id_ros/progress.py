"""Long work: reports of its progress, and the end of its processes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
import subprocess
import threading

Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``; `total` is 0 while it is not known."""

STOP_SECONDS = 2.0

LONGEST_START_S = 120.0
"""Without a cache of compiled code, a process compiles first."""


def silent(stage: str, done: int, total: int) -> None:
    """Report nothing."""


def end(
    process: subprocess.Popen[bytes] | subprocess.Popen[str],
    is_spared: Callable[[], bool] = lambda: False,
) -> None:
    """Ask a process to end; kill it where it has not after `STOP_SECONDS` and is not spared."""
    process.terminate()
    try:
        process.wait(STOP_SECONDS)
    except subprocess.TimeoutExpired:
        if not is_spared():
            kill(process)


def kill(process: subprocess.Popen[bytes] | subprocess.Popen[str]) -> None:
    """End a process that has nothing to save, be it stopped or busy; none is left as a zombie."""
    process.kill()
    with suppress(subprocess.TimeoutExpired):
        process.wait(STOP_SECONDS)


@contextmanager
def deadline(process: subprocess.Popen[bytes], seconds: float) -> Iterator[None]:
    """Kill the process, so that reading from it ends, if the block takes longer."""
    timer = threading.Timer(seconds, kill, [process])
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
