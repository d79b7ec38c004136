"""
How long a model takes in a loop: a query, a prediction with parts, and standard deviations.

Each call takes one state; times are medians of single calls, as ratios within one run. The first
ratio is that of a query to as many tanh as seven joints with four terms of friction have. Queries
must leave nothing in memory.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
import gc
import json
from pathlib import Path
import sys
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks._panda import run_pair
from lip_id_ros.arrays import Array
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.numba_jit import jit

Call = Callable[[Array, Array, Array], object]
STATES, WARM_UP, SIGNS, LOOPS = 1000, 10_000, 28, 1000
ALLOWED_BLOCKS = 1000
"""Of memory, that the interpreter itself may keep beside; a leak would be one for each call."""


@dataclass(frozen=True)
class Times:
    """
    Times of single calls.

    `median_us`; `ratio` of it to that of a query, of a query to that of the signs; `p99` and
    `p999` in the median; `blocks` of memory more than before.

    """

    what: str
    calls: int
    median_us: float
    ratio: float
    p99: float
    p999: float
    blocks: int


def main(arguments: list[str]) -> int:
    """Measure, print a table; exit status 1 where queries leave something in memory."""
    parser = argparse.ArgumentParser(prog='benchmarks query', description=__doc__)
    parser.add_argument('--model', type=Path, help='model to ask (default: fits one of a Panda)')
    parser.add_argument('--calls', type=int, default=1_000_000)
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    model = InverseDynamicsModel.load(options.model) if options.model else fit(run_pair(7, 0)[0])
    rows = list(measured(model, options.calls))
    table = Table(title=f'{model.n_joints} joints, {model.n_samples} samples')
    for name in ('', 'calls', 'median [us]', 'ratio', '99 % / median', '99.9 % / median'):
        table.add_column(name, justify='right' if name else 'left')
    for row in rows:
        numbers = row.median_us, row.ratio, row.p99, row.p999
        table.add_row(row.what, str(row.calls), *(f'{value:.3g}' for value in numbers))
    Console(width=110).print(table)
    if options.json:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1))
    return int(rows[0].blocks > ALLOWED_BLOCKS)


def measured(model: InverseDynamicsModel, calls: int) -> Iterator[Times]:
    """Time a query, and fewer of what takes longer."""
    low, high = model.training_range
    states = np.random.default_rng(0).uniform(low, high, (STATES, *low.shape))

    def parts(q: Array, dq: Array, ddq: Array) -> object:
        return model.predict(q[None], dq[None], ddq[None])

    def torque_std(q: Array, dq: Array, ddq: Array) -> object:
        return model.torque_std(q[None], dq[None], ddq[None])

    def deviations(q: Array, dq: Array, ddq: Array) -> object:
        return model.standard_deviation(q[None], dq[None], ddq[None])

    query = _timed('query: torque, energies', model.query, states, calls, _signs_us())
    yield query
    for what, call, share in (
        ('predict: with the parts of the torque', parts, 10),
        ('deviations of torques', torque_std, 1000),
        ('deviations of torques and energies', deviations, 1000),
    ):
        yield _timed(what, call, states, max(1, calls // share), query.median_us)


def _timed(what: str, call: Call, states: Array, calls: int, unit_us: float) -> Times:
    nanoseconds = np.ones(calls, dtype=np.int64)  # written to, so that it is in memory
    for q, dq, ddq in states[: min(calls, WARM_UP)]:
        call(q, dq, ddq)
    gc.collect()
    before = sys.getallocatedblocks()
    for number in range(calls):
        q, dq, ddq = states[number % STATES]
        begin = time.perf_counter_ns()
        call(q, dq, ddq)
        nanoseconds[number] = time.perf_counter_ns() - begin
    gc.collect()
    blocks = sys.getallocatedblocks() - before
    median, p99, p999 = (float(x) for x in np.quantile(nanoseconds / 1e3, [0.5, 0.99, 0.999]))
    return Times(what, calls, median, median / unit_us, p99 / median, p999 / median, blocks)


def _signs_us() -> float:
    """Return how long the signs of one state of seven joints take [us]."""
    values = np.random.default_rng(0).standard_normal(SIGNS)
    _signs(values, 1)
    times = []
    for _ in range(20):
        begin = time.perf_counter_ns()
        _signs(values, LOOPS)
        times.append(time.perf_counter_ns() - begin)
    return min(times) / 1e3 / LOOPS


@jit
def _signs(values: Array, times: int) -> float:
    total = 0.0
    for k in range(times):
        for j in range(len(values)):
            total += np.tanh(values[j] + 1e-9 * k)
    return total
