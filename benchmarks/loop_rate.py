"""A robot on a 1 kHz wall clock over the real middleware: which torques come in time."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import itertools
import json
from pathlib import Path
import tempfile
import time

import numpy as np

from benchmarks._cells import measured, show
from benchmarks._changed_arms import with_wrong_masses
from benchmarks._driven_panda import move
from benchmarks.contact import learned
from benchmarks.serve_rate import MIDDLEWARES
from lip_id_ros.arrays import Array
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation import panda

ROUTES = ('stream', 'plan')
AHEAD = (1, 2, 5)
"""How many ticks ahead a question may be asked."""

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
    'robot_late_percent': 'robot late %',
    'serve_cpu_percent': 'serve CPU %',
    'rms_error_mrad': 'error mrad',
}


def main(arguments: list[str]) -> int:
    """Measure every cell, print a table; exit status 1 where an unsafe torque came."""
    parser = argparse.ArgumentParser(prog='benchmarks loop_rate', description=__doc__)
    parser.add_argument('--routes', nargs='+', choices=ROUTES, default=ROUTES)
    parser.add_argument('--middlewares', nargs='+', default=MIDDLEWARES)
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--model', help='of the Panda; left out: one is fitted')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        model = options.model or fitted(folder)
        request = {'seconds': options.seconds, 'model': model}
        rows = [
            measured(
                'benchmarks._loop_robot', {**request, 'middleware': middleware, 'route': route}
            )
            for middleware, route in itertools.product(options.middlewares, options.routes)
        ]
    show(f'{options.seconds:g} s at 1 kHz, 7 joints', COLUMNS, rows, 170)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return int(any(row['unsafe'] for row in rows))


def fitted(folder: str) -> str:
    """Learn a minute of motion of the simulated arm, 500 samples."""
    rng = np.random.default_rng(0)
    run = move(with_wrong_masses(panda(), 0.2, 0.02, rng), rng, 60.0)
    path = f'{folder}/model.npz'
    learned([run], FitSettings(max_samples=500)).save(path)
    return path


class Timeline:
    """Ticks of a wall clock, `period` [s] apart, and when each was asked and answered."""

    def __init__(self, n_ticks: int, period: float) -> None:
        self.n_ticks = n_ticks
        self._period = period
        self._due, self._asked, self._answered = np.full((3, n_ticks), np.nan)
        self._unsafe = 0

    def ticks(self) -> Iterator[int]:
        """Yield the number of each tick when it is due, or at once where that has passed."""
        begin = time.perf_counter() + self._period
        for number in range(self.n_ticks):
            self._due[number] = begin + number * self._period
            ahead = self._due[number] - time.perf_counter()
            if ahead > 0:
                time.sleep(ahead)
            yield number

    def asked(self, number: int) -> None:
        """Note that a tick asks for its torque now."""
        self._asked[number] = time.perf_counter()

    def answered(self, number: int, safe: bool) -> None:
        """Note an answer; those to no tick are of the time before."""
        if 0 <= number < self.n_ticks and not np.isnan(self._asked[number]):
            self._answered[number] = time.perf_counter()
            self._unsafe += not safe

    @property
    def n_lost(self) -> int:
        """Number of ticks without an answer."""
        return int(np.isnan(self._answered).sum())

    def figures(self) -> dict[str, float]:
        """
        Return what the loop saw.

        An answer is missed that comes later than a period after its question, or never, so that
        a robot that is late itself does not count against what answers it. Where references are
        sent ticks ahead, answers have so many periods.

        """
        times = self._answered - self._asked
        answered = times[~np.isnan(times)]
        intervals = np.diff(self._answered[~np.isnan(self._answered)])
        return {
            'ticks': self.n_ticks,
            'lost': int(np.isnan(times).sum()),
            **{f'missed_percent_{ticks}': self._missed(times, ticks) for ticks in AHEAD},
            'unsafe': self._unsafe,
            'answer_ms_median': 1e3 * float(np.median(answered)),
            'answer_ms_p99': 1e3 * float(np.quantile(answered, 0.99)),
            'answer_ms_max': 1e3 * float(answered.max()),
            'interval_ms_std': 1e3 * float(intervals.std()),
            'robot_late_percent': 100
            * float(np.mean(self._asked - self._due > 0.5 * self._period)),
        }

    def _missed(self, times: Array, ticks: int) -> float:
        return 100 * float(1 - (times <= ticks * self._period).sum() / self.n_ticks)
