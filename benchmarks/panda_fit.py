"""Speed of a fit: 500 samples of a 7-joint Panda, every kernel."""

from __future__ import annotations

import argparse
from collections.abc import Callable
import json
from pathlib import Path
import time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks._panda import run_pair
from lip_id_ros.evaluation import evaluate
from lip_id_ros.identification import fit
from lip_id_ros.kernels import FAMILY
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.settings import FitSettings

KERNELS = (ARTICULATED, *sorted(FAMILY))


def main(arguments: list[str]) -> int:
    """Fit with each kernel, time the parts, print a table."""
    parser = argparse.ArgumentParser(prog='benchmarks panda_fit', description=__doc__)
    parser.add_argument('--joints', type=int, default=7)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--kernels', nargs='+', choices=KERNELS, default=KERNELS)
    parser.add_argument('--json', type=Path, help='also write the figures here')
    options = parser.parse_args(arguments)
    rows = [measure(kernel, options.joints, options.seed) for kernel in options.kernels]
    _print(rows)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    return 0


def measure(kernel: str, n_joints: int, seed: int) -> dict[str, Any]:
    """Return times [s] and errors [%] of one kernel."""
    train, test = run_pair(n_joints, seed)
    _check_against_plain(fit(train, FitSettings(kernel=kernel, iterations=1)))
    model = fit(train, FitSettings(kernel=kernel))
    process = model.process
    gram = seconds(lambda: process.prior.gram(process.states)) if process else [0.0]
    query = seconds(lambda: model.query(test.q[0], test.dq[0], test.ddq[0]), 2000)
    evaluation = evaluate(model, test)
    return {
        'kernel': kernel,
        'gram_s': gram[len(gram) // 2],
        'fit_s': model.summary['seconds_total'],
        'iterations': model.summary.get('iterations', 0),
        'query_us': 1e6 * query[len(query) // 2],
        'query_us_p99': 1e6 * query[int(0.99 * len(query))],
        'nmse_percent': [float(value) for value in evaluation.nmse_percent],
    }


def seconds(call: Callable[[], object], repeats: int = 5) -> list[float]:
    """Return the sorted times of several calls, after one that compiles and warms up [s]."""
    call()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        call()
        times.append(time.perf_counter() - started)
    return sorted(times)


def _check_against_plain(model: InverseDynamicsModel) -> None:
    # Fast and wrong would not count: the mean is the textbook one.
    process = model.process
    if process is None:
        return
    few = [x[:5] for x in (process.states.q, process.states.dq, process.states.ddq)]
    states = process.prior.kernel.states(*few)
    expected = process.prior.cross_gram(states, process.states) @ process.alpha.ravel()
    got = model.predict(*few).tau
    np.testing.assert_allclose(got, expected.reshape(got.shape), rtol=1e-6, atol=1e-6)


def _print(rows: list[dict[str, Any]]) -> None:
    table = Table(title='500 samples')
    for name in ('kernel', 'Gram s', 'fit s', 'iterations', 'query us', 'p99 us', 'nMSE %'):
        table.add_column(name, justify='left' if name == 'kernel' else 'right')
    for row in rows:
        table.add_row(
            row['kernel'],
            f'{row["gram_s"]:.3f}',
            f'{row["fit_s"]:.1f}',
            str(row['iterations']),
            f'{row["query_us"]:.0f}',
            f'{row["query_us_p99"]:.0f}',
            ' '.join(f'{value:.3g}' for value in row['nmse_percent']),
        )
    Console().print(table)
