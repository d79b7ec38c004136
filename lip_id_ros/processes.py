"""End a process that was started beside a node."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import subprocess

STOP_SECONDS = 2.0


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
