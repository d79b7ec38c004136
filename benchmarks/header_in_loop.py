"""The exported C header in the 1 kHz loop of a real controller manager: its cost, and jitter."""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
import sys
import tempfile
import time
from typing import Any

import numpy as np

from benchmarks import _loop_program
from benchmarks._cells import measured, show
from benchmarks.serve_rate import fitted, MIDDLEWARES
from lip_id_ros.cli import main as lip_id

SOURCE = Path(__file__).with_suffix('.cpp')
PRIORITIES = (0, 50)
PARTS = ('late without', 'late with', 'controllers', 'header')
SHARES = (50.0, 99.0, 99.9, 100.0)
COLUMNS = {
    'part': '',
    'priority': 'SCHED_FIFO',
    'load': 'load',
    **{f'{share:g}': f'{share:g} % [us]' for share in SHARES},
    'over_period': 'over 1 ms',
}


def main(arguments: list[str]) -> int:
    """Measure with and without real-time priority, and print a table."""
    parser = argparse.ArgumentParser(prog='benchmarks header_in_loop', description=__doc__)
    parser.add_argument('--cycles', type=int, default=20_000, help='of 1 ms')
    parser.add_argument('--priorities', type=int, nargs='+', default=PRIORITIES)
    parser.add_argument('--core', type=int, default=os.cpu_count() or 1, help='counted from 1')
    parser.add_argument('--model', help='of the Panda; left out: one is fitted')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as name:
        program = compiled(Path(name), options.model or fitted(name))
        for priority in options.priorities:
            request = {'cycles': options.cycles, 'core': options.core - 1, 'priority': priority}
            found = measured(
                'benchmarks.header_in_loop',
                {**request, 'program': program, 'middleware': MIDDLEWARES[0]},
            )
            rows += found['rows']
    show(f'{options.cycles} cycles of 1 ms', COLUMNS, rows, 130)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return 0


def compiled(folder: Path, model: str) -> str:
    """Export a model and compile the loop with it; return the program."""
    lip_id(['export', model, '--name', 'arm', '--c', str(folder / 'arm_dynamics.h')])
    return _loop_program.compiled(SOURCE, folder)


def run(request: dict[str, Any]) -> dict[str, Any]:
    """Have the controller execute a plan, and measure its loop meanwhile."""
    import rclpy
    from trajectory_msgs.msg import JointTrajectory

    from benchmarks._goal_client import JOINTS, plan, wait
    from benchmarks._mock_controller import controlled, NAME
    from benchmarks._serve_client import spun
    from lip_id_ros.nodes import messages, qos

    rclpy.init()
    node = rclpy.create_node('loop_client')
    with tempfile.TemporaryDirectory() as name, spun(node):
        folder, cycles = Path(name), request['cycles']
        numbers = [str(request[key]) for key in ('cycles', 'core', 'priority')]
        with controlled(node, JOINTS, folder, 1000, [request['program'], name, *numbers]):
            topic = f'/{NAME}/joint_trajectory'
            publisher = node.create_publisher(JointTrajectory, topic, qos.OUTPUT)
            wait(lambda: publisher.get_subscription_count() > 0)
            message = plan(np.full(7, 0.3), 60.0 + 2e-3 * cycles, 200).trajectory
            publisher.publish(messages.with_effort(message, np.ones((200, 7))))
            time.sleep(1.0)
            (folder / 'begin').touch()
            wait((folder / 'cycles').is_file)
            load = os.getloadavg()[0]
        late, controllers, header = np.fromfile(folder / 'cycles', np.int64).reshape(-1, 3).T
    called = header >= 0
    parts = (late[~called], late[called], controllers, header[called])
    return {'rows': [_row(*pair, request, load) for pair in zip(PARTS, parts, strict=True)]}


def _row(part: str, values: Any, request: dict[str, Any], load: float) -> dict[str, Any]:
    shares = {f'{share:g}': float(np.percentile(values, share)) / 1e3 for share in SHARES}
    over = int((values > 1_000_000).sum())
    return {
        'part': part,
        'priority': request['priority'] or 'none',
        'load': load,
        **shares,
        'over_period': f'{over} of {len(values)}',
    }


if __name__ == '__main__':
    print(json.dumps(run(json.loads(sys.argv[1]))))
