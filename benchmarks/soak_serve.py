"""
Soak of `serve` beside a busy process: every reference is answered, or counted by its reason.

The exit status is 1 where a reference is unaccounted for, a torque is beyond the limits, or memory
grows by more than 2 MB after the first tenth of the time.

"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
import subprocess
import sys
import tempfile
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
import rclpy

from benchmarks._cells import show
from benchmarks._serve_client import Client, LAST_SECONDS, serving, spun, Turn
from benchmarks.serve_rate import fitted
from benchmarks.soak_computed_torque import ALLOWED_KB, resident_kb
from lip_id_ros.nodes import messages, qos

PARTS = 20
COLUMNS = {
    'sent': 'sent',
    'answered': 'answered',
    'refused': 'refused',
    'lost': 'lost by the middleware',
    'missing': 'unaccounted for',
    'wrong': 'unsafe',
    'answer_ms_median': 'median ms',
    'answer_ms_p99': '99 % ms',
    'answer_ms_max': 'max ms',
    'first_kb': 'memory after a tenth, kB',
    'last_kb': 'at the end, kB',
}


def main(arguments: list[str]) -> int:
    """Stream references for some time, print a table."""
    parser = argparse.ArgumentParser(prog='benchmarks soak_serve', description=__doc__)
    parser.add_argument('--seconds', type=float, default=600.0)
    parser.add_argument('--rate', type=float, default=300.0)
    parser.add_argument('--model', help='of the Panda; left out: one is fitted')
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        row = soak(options.model or fitted(folder), options.rate, options.seconds)
    show(f'{options.seconds:g} s of references at {options.rate:g} Hz', COLUMNS, [row], 150)
    grown = row['last_kb'] - row['first_kb']
    return int(row['missing'] != 0 or row['wrong'] > 0 or grown > ALLOWED_KB)


def soak(model: str, rate_hz: float, seconds: float) -> dict[str, Any]:
    """Stream references beside a busy process; return figures."""
    rclpy.init()
    node = rclpy.create_node('soak_client')
    statuses: list[dict[str, Any]] = []

    def hear(message: DiagnosticStatus) -> None:
        statuses.append(messages.status_values(message))

    node.create_subscription(DiagnosticStatus, '/serve/status', hear, qos.LATCHED)
    client, memory = Client(node), list[int]()
    with ExitStack() as stack:
        process = stack.enter_context(serving(model, 'events'))
        stack.enter_context(spun(node))
        stack.enter_context(busy())
        client.wait_for_answer()
        time.sleep(LAST_SECONDS)
        before, turns = statuses[-1], list[Turn]()
        for _ in range(PARTS):
            turns.append(client.turn(process.pid, rate_hz, seconds / PARTS))
            memory.append(resident_kb(process.pid))
        time.sleep(LAST_SECONDS)
    row = {**client.figures(turns), **accounted(before, statuses[-1])}
    row['missing'] = row['sent'] - row['answered'] - row['refused'] - row['lost']
    return {**row, 'first_kb': memory[PARTS // 10], 'last_kb': memory[-1]}


def accounted(before: dict[str, Any], after: dict[str, Any]) -> dict[str, int]:
    """Return what the status of `serve` has counted between two of them."""

    def counted(status: dict[str, Any]) -> dict[str, int]:
        return {
            'answered': status['answered']['samples'],
            'refused': sum(status['refused'].values()) if status['refused'] else 0,
            'lost': status['lost'].get('desired_trajectory', 0) if status['lost'] else 0,
        }

    return {key: n - counted(before)[key] for key, n in counted(after).items()}


@contextmanager
def busy() -> Iterator[None]:
    """Keep a processor busy while the block runs."""
    process = subprocess.Popen([sys.executable, '-c', 'while True: pass'])
    try:
        yield
    finally:
        process.kill()
        process.wait()
