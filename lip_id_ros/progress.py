"""Long work: reports of its progress, and the end of its processes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
import subprocess

Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``; `total` is 0 while it is not known."""

STOP_SECONDS = 2.0


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
            process.kill()
            with suppress(subprocess.TimeoutExpired):  # else it is left as a zombie
                process.wait(STOP_SECONDS)
