"""End a process that was started beside a node."""

from __future__ import annotations

import subprocess

STOP_SECONDS = 2.0


def end(process: subprocess.Popen[bytes] | subprocess.Popen[str]) -> None:
    """Ask a process to end; kill it where it has not after `STOP_SECONDS`."""
    process.terminate()
    try:
        process.wait(STOP_SECONDS)
    except subprocess.TimeoutExpired:
        process.kill()
