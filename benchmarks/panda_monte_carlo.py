"""
The paper's Monte Carlo experiment (section `sec:gen`), for every model on the same data.

`rigid_body`, least squares with true kinematics, is the limit. accuracy.md has 10 seeds.

"""

from __future__ import annotations

import argparse
from functools import partial
from itertools import product
from pathlib import Path
import time
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
import yaml

from benchmarks._panda import run_pair
from benchmarks._results import Results, Row
from benchmarks.baselines import method
from lip_id_ros.evaluation import evaluate
from lip_id_ros.progress import silent
from lip_id_ros.settings import Config, override
from lip_id_ros.simulation.arm import panda_urdf

MODELS = ('lip', 'recursive', 'articulated', 'rigid_body')


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, then print medians."""
    options = _options(arguments)
    results = Results(options.results)
    for n_joints in options.joints:
        chosen: dict[str, list[Row]] = {model: [] for model in options.models}
        for seed, model in product(options.seeds, options.models):
            name = ' '.join([f'{n_joints} joints, seed {seed}, {model}', *sorted(options.set)])
            measure = partial(measured, n_joints, seed, model, options.set)
            chosen[model].append(results.row(name, measure))
        Console(width=140).print(summarise(n_joints, chosen))
    return 0


def measured(n_joints: int, seed: int, model: str, changes: list[str]) -> Row:
    """Fit one model to one training run and evaluate it on the unseen one."""
    train, test = run_pair(n_joints, seed)
    pairs = [change.split('=', 1) for change in changes]
    values = {f'fit.{name}': yaml.safe_load(value) for name, value in pairs}
    settings = override(Config(), values, 'the command line').fit
    started = time.process_time()
    fitted = method(model, panda_urdf()).fit(train, settings, silent)
    cpu_s = time.process_time() - started
    evaluation = evaluate(fitted, test)
    return {
        'nmse_percent': list(evaluation.nmse_percent),
        'kinetic_nmse_percent': evaluation.kinetic_nmse_percent,
        'potential_nmse_percent': evaluation.potential_nmse_percent,
        'inertia_not_pd_percent': evaluation.inertia_not_pd_percent,
        'within_two_std_percent': evaluation.within_two_std_percent,
        'cpu_s': cpu_s,
    }


def summarise(n_joints: int, chosen: dict[str, list[Row]]) -> Table:
    """Return the medians over the seeds, and the ratio of errors to those of the first model."""
    first, *_ = chosen
    table = Table(title=f'{n_joints} joints, medians of {len(chosen[first])} seeds: nMSE %')
    names = ['model', *(f'J{i + 1}' for i in range(n_joints)), 'T', 'V', 'M not p.d. %', 'CPU s']
    for name in [*names, f'ratio to {first}']:
        table.add_column(name, justify='left' if name == 'model' else 'right')
    reference = _medians(chosen[first], 'nmse_percent')
    for model, rows in chosen.items():
        errors = _medians(rows, 'nmse_percent')
        others = ('kinetic_nmse_percent', 'potential_nmse_percent', 'inertia_not_pd_percent')
        figures = [*errors, *(_medians(rows, name) for name in others)]
        shown = ['' if np.isnan(value) else f'{value:.2g}' for value in figures]
        ratio = np.exp(np.log(errors / reference).mean())
        table.add_row(model, *shown, f'{_medians(rows, "cpu_s"):.1f}', f'{ratio:.2g}')
    return table


def _medians(rows: list[Row], name: str) -> Any:
    return np.median(np.array([row[name] for row in rows], dtype=np.float64), axis=0)


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks panda_monte_carlo', description=__doc__)
    parser.add_argument('--joints', type=int, nargs='+', default=[6])
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(3)))
    parser.add_argument('--models', nargs='+', default=list(MODELS))
    parser.add_argument(
        '--set', nargs='*', default=[], metavar='NAME=VALUE', help='such as friction=false'
    )
    parser.add_argument('--results', type=Path, default=Path('panda_monte_carlo.json'))
    return parser.parse_args(arguments)
