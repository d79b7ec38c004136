"""A robot on a 1 kHz wall clock over the real middleware: which torques come in time."""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path
import tempfile

import numpy as np

from benchmarks._cells import measured, show
from benchmarks._changed_arms import with_wrong_masses
from benchmarks._closed_loop import NominalFeedforward
from benchmarks.contact import learned, move
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation.torque_controlled import panda_setup

MIDDLEWARES = ('rmw_fastrtps_cpp', 'rmw_cyclonedds_cpp')
ROUTES = ('stream', 'plan, node', 'plan, in the loop')
COLUMNS = {
    'middleware': 'middleware',
    'route': 'route',
    'missed_percent_1': 'missed %',
    'missed_percent_2': '2 ms',
    'missed_percent_5': '5 ms',
    'lost': 'lost',
    'unsafe': 'unsafe',
    'answer_ms_median': 'median ms',
    'answer_ms_p99': '99 % ms',
    'answer_ms_max': 'max ms',
    'interval_ms_std': 'jitter ms',
    'interval_ms_p99': 'interval 99 % ms',
    'robot_late_percent': 'robot late %',
    'serve_cpu_percent': 'serve CPU %',
    'computed_torque_cpu_percent': 'controller CPU %',
    'rms_error_mrad': 'error mrad',
}


def main(arguments: list[str]) -> int:
    """Measure every cell, print a table; exit status 1 where an unsafe torque came."""
    options = _options(arguments)
    with tempfile.TemporaryDirectory() as folder:
        model = options.model or fitted(folder)
        cells = itertools.product(options.middlewares, options.routes)
        rows = [
            measured(
                'benchmarks._loop_robot',
                {
                    'middleware': middleware,
                    'route': route,
                    'seconds': options.seconds,
                    'model': model,
                },
            )
            for middleware, route in cells
        ]
    show(f'{options.seconds:g} s at 1 kHz, 7 joints', COLUMNS, rows, 190)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(any(row['unsafe'] for row in rows))


def fitted(folder: str) -> str:
    """Learn a minute of motion of the simulated arm, 500 samples."""
    setup, rng = panda_setup(), np.random.default_rng(0)
    nominal = NominalFeedforward(with_wrong_masses(setup.arm, 0.2, 0.02, rng))
    path = f'{folder}/model.npz'
    run = move(setup, nominal, rng, 60.0)
    learned(setup, [run], FitSettings(max_samples=500)).save(path)
    return path


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks loop_rate', description=__doc__)
    parser.add_argument('--routes', nargs='+', choices=ROUTES, default=ROUTES)
    parser.add_argument('--middlewares', nargs='+', default=MIDDLEWARES)
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--model', help='of the Panda; left out: one is fitted')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    return parser.parse_args(arguments)
