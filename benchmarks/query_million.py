"""A million queries of one model: how long each takes, and whether memory grows."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
import gc
import json
from pathlib import Path
import sys
import time

import numba
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks._panda import run_pair
from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel

Call = Callable[[Array, Array, Array], object]
STATES = 1000
WARM_UP = 10_000
ALLOWED_BLOCKS = 1000
"""Objects that the interpreter itself may keep beside; a leak would be a million."""


@dataclass(frozen=True)
class Times:
    """
    Times of single calls [microseconds], and what stayed in memory.

    Attributes
    ----------
    what : str
    calls : int
    median, p99, p999, longest : float
        [microseconds].
    blocks : int
        Memory blocks of the interpreter more than before.
    kilobytes : int
        Resident memory more than before.

    """

    what: str
    calls: int
    median: float
    p99: float
    p999: float
    longest: float
    blocks: int
    kilobytes: int


def main(arguments: list[str]) -> int:
    """Measure, print a table; exit status 1 where memory grew."""
    options = _options(arguments)
    model = InverseDynamicsModel.load(options.model) if options.model else fit(run_pair(7, 0)[0])
    rows = list(measure(model, options.calls))
    _print(rows, f'{model.n_joints} joints, {model.n_samples} samples')
    if options.json:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1))
    return int(rows[0].blocks > ALLOWED_BLOCKS)


def measure(model: InverseDynamicsModel, calls: int) -> Iterator[Times]:
    """Time torque with both energies, with parts, and standard deviations."""
    low, high = model.training_range
    states = np.random.default_rng(0).uniform(low, high, (STATES, *low.shape))
    few = max(1, calls // 10)

    def parts(q: Array, dq: Array, ddq: Array) -> object:
        return model.predict(q[None], dq[None], ddq[None])

    def deviation(q: Array, dq: Array, ddq: Array) -> object:
        return model.standard_deviation(q[None], dq[None], ddq[None])

    def torque_deviation(q: Array, dq: Array, ddq: Array) -> object:
        return model.torque_std(q[None], dq[None], ddq[None])

    yield timed('torque and energies', model.query, states, calls)
    with frozen():
        yield timed('the same, objects frozen', model.query, states, few)
    with uncollected():
        yield timed('the same, no collection', model.query, states, few)
    yield timed('with parts', parts, states, few)
    fewest = max(1, calls // 10_000)
    yield timed('standard deviations', deviation, states, fewest)
    yield timed('standard deviations of torques alone', torque_deviation, states, fewest)


def timed(what: str, call: Call, states: Array, calls: int) -> Times:
    """Time single calls, after some that warm up."""
    nanoseconds = np.ones(calls, dtype=np.int64)  # written to, so that it is in memory
    _run(call, states, nanoseconds[: min(calls, WARM_UP)])
    blocks, kilobytes = _memory()
    _run(call, states, nanoseconds)
    blocks_after, kilobytes_after = _memory()
    quantiles = np.quantile(nanoseconds / 1e3, [0.5, 0.99, 0.999, 1.0])
    median, p99, p999, longest = (float(value) for value in quantiles)
    return Times(
        what, calls, median, p99, p999, longest,
        blocks_after - blocks, kilobytes_after - kilobytes,
    )  # fmt: skip


@contextmanager
def uncollected() -> Iterator[None]:
    """Keep the garbage collector from running."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


@contextmanager
def frozen() -> Iterator[None]:
    """Keep what is there now out of every collection."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


def _run(call: Call, states: Array, nanoseconds: IntArray) -> None:
    for number in range(len(nanoseconds)):
        q, dq, ddq = states[number % STATES]
        begin = time.perf_counter_ns()
        call(q, dq, ddq)
        nanoseconds[number] = time.perf_counter_ns() - begin


def _memory() -> tuple[int, int]:
    gc.collect()
    resident = int(Path('/proc/self/statm').read_text().split()[1])
    return sys.getallocatedblocks(), 4 * resident


def _print(rows: list[Times], title: str) -> None:
    table = Table(title=f'{title}, {numba.get_num_threads()} threads; microseconds')
    names = ('', 'calls', 'median', '99 %', '99.9 %', 'longest', 'blocks more', 'kB more')
    for name in names:
        table.add_column(name, justify='right' if name else 'left')
    for row in rows:
        times = (row.median, row.p99, row.p999, row.longest)
        table.add_row(
            row.what,
            str(row.calls),
            *(f'{value:.0f}' for value in times),
            str(row.blocks),
            str(row.kilobytes),
        )
    Console(width=110).print(table)


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks query_million', description=__doc__)
    parser.add_argument('--model', type=Path, help='model to ask (default: fits one of a Panda)')
    parser.add_argument('--calls', type=int, default=1_000_000)
    parser.add_argument('--json', type=Path, help='also write the figures here')
    return parser.parse_args(arguments)
