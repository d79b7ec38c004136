"""
Round trip of `serve` on a real ROS graph: rates, executors and middlewares.

With `--updates`, `serve` follows updates of its model in every other turn of some seconds: a row
without them, and one with them.

"""

from __future__ import annotations

import argparse
import itertools
import json
from pathlib import Path
import tempfile

from benchmarks._cells import measured, show
from benchmarks._panda import run_pair
from lip_id_ros.identification import fit
from lip_id_ros.settings import FitSettings

EXECUTORS = ('events', 'single_threaded')
MIDDLEWARES = ('rmw_fastrtps_cpp', 'rmw_cyclonedds_cpp')
COLUMNS = {
    'middleware': 'middleware',
    'executor': 'executor',
    'rate_hz': 'Hz',
    'updates_hz': 'updates Hz',
    'deviations_hz': 'std Hz',
    'followed': 'followed',
    'sent_per_second': 'sent per s',
    'lost': 'lost',
    'wrong': 'wrong',
    'late_percent_1': 'after 1 ms %',
    'late_percent_2': '2 ms %',
    'late_percent_5': '5 ms %',
    'answer_ms_median': 'median ms',
    'answer_ms_p99': '99 % ms',
    'answer_ms_max': 'max ms',
    'deviations': 'std',
    'serve_cpu_percent': 'CPU %',
}


def main(arguments: list[str]) -> int:
    """Measure every cell, print a table."""
    parser = argparse.ArgumentParser(prog='benchmarks serve_rate', description=__doc__)
    parser.add_argument('--rates', type=float, nargs='+', default=[100, 250, 500, 1000])
    parser.add_argument('--executors', nargs='+', choices=EXECUTORS, default=EXECUTORS)
    parser.add_argument('--middlewares', nargs='+', default=MIDDLEWARES)
    parser.add_argument('--updates', type=float, help='rate of updates of the model [Hz]')
    parser.add_argument('--deviations', type=float, help='rate of standard deviations [Hz]')
    parser.add_argument('--seconds', type=float, default=10.0, help='of each row')
    parser.add_argument('--model', help='of the Panda; left out: one is fitted')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        model = options.model or fitted(folder)
        cells = itertools.product(options.middlewares, options.executors, options.rates)
        rows = [
            row
            for middleware, executor, rate_hz in cells
            for row in measured(
                'benchmarks._serve_client',
                {
                    'middleware': middleware,
                    'executor': executor,
                    'rate_hz': rate_hz,
                    'updates_hz': options.updates,
                    'deviations_hz': options.deviations,
                    'seconds': options.seconds,
                    'model': model,
                },
            )['rows']
        ]
    show(
        f'{options.seconds:g} s of single-point references to serve, 7 joints', COLUMNS, rows, 130
    )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(any(row['wrong'] for row in rows))


def fitted(folder: str) -> str:
    """Fit a model of a 7-joint Panda with 500 samples: how well does not matter here."""
    path = f'{folder}/model.npz'
    train, _ = run_pair(7, seed=0)
    fit(train, FitSettings(subset=100, iterations=8, max_samples=500)).save(path)
    return path
