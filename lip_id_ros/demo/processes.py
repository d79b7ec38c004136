"""The demo's nodes, in processes that end with it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import subprocess
import sys

LAUNCH_FILE = 'demo.launch.py'
STOP_SECONDS = 15.0


@contextmanager
def launched(output: Path) -> Iterator[subprocess.Popen[bytes]]:
    """
    Run the demo's launch file while the block runs.

    Parameters
    ----------
    output : Path
        Folder of the model and the data; the nodes' log goes there too.

    """
    with open(output / 'nodes.log', 'wb') as log:
        process = subprocess.Popen(
            [sys.executable, '-m', 'lip_id_ros.demo.launching', LAUNCH_FILE, f'output:={output}'],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            yield process
        finally:
            end(process)


def end(process: subprocess.Popen[bytes]) -> None:
    """Interrupt a process and its children, as Ctrl-C does; kill what is left."""
    for number in (signal.SIGINT, signal.SIGKILL):
        if process.poll() is None:
            os.killpg(process.pid, number)
            try:
                process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                continue
