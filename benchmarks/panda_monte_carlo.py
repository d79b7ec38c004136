"""The paper's Monte Carlo experiment (section `sec:gen`), for every kernel on the same data."""

from __future__ import annotations

import argparse
from itertools import product
import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table
import yaml

from benchmarks._panda import run_pair
from lip_id_ros.evaluation import evaluate
from lip_id_ros.files import write_whole
from lip_id_ros.identification import fit
from lip_id_ros.settings import Config, override

Cell = dict[str, Any]
KERNELS = ('lip', 'recursive', 'articulated')


def main(arguments: list[str]) -> int:
    """Fit every cell that is not in the result file yet, then print medians."""
    options = _options(arguments)
    settings = dict(pair.split('=', 1) for pair in options.set)
    cells = _read(options.results)
    wanted = list(product(options.joints, options.seeds, options.kernels))
    missing = [key for key in wanted if _name(*key, settings) not in cells]
    for n_joints, seed, kernel in track(missing, 'fitting', console=Console(stderr=True)):
        cells[_name(n_joints, seed, kernel, settings)] = measure(n_joints, seed, kernel, settings)
        _write(options.results, cells)
    for n_joints in options.joints:
        chosen = {
            kernel: [cells[_name(n_joints, seed, kernel, settings)] for seed in options.seeds]
            for kernel in options.kernels
        }
        Console(width=140).print(summarise(n_joints, chosen))
    return 0


def measure(n_joints: int, seed: int, kernel: str, changes: dict[str, str]) -> Cell:
    """Fit one kernel to one training run and evaluate it on the unseen one."""
    train, test = run_pair(n_joints, seed)
    values = {f'fit.{name}': yaml.safe_load(value) for name, value in changes.items()}
    config = override(Config(), {**values, 'fit.kernel': kernel}, 'the command line')
    model = fit(train, config.fit)
    evaluation = evaluate(model, test)
    return {
        'nmse_percent': list(evaluation.nmse_percent),
        'kinetic_nmse_percent': evaluation.kinetic_nmse_percent,
        'potential_nmse_percent': evaluation.potential_nmse_percent,
        'inertia_not_pd_percent': evaluation.inertia_not_pd_percent,
        'fit_s': model.summary['seconds_total'],
        'noise_std': list(model.summary['noise_std']),
    }


def summarise(n_joints: int, chosen: dict[str, list[Cell]]) -> Table:
    """Return the medians over the seeds, and each kernel's errors as a ratio of the paper's."""
    count = len(next(iter(chosen.values())))
    table = Table(title=f'{n_joints} joints, medians of {count} seeds: nMSE %')
    names = ['kernel', *(f'J{i + 1}' for i in range(n_joints)), 'T', 'V', 'M not p.d. %', 'fit s']
    for name in [*names, 'ratio to lip']:
        table.add_column(name, justify='left' if name == 'kernel' else 'right')
    paper = _medians(chosen['lip'], 'nmse_percent') if 'lip' in chosen else None
    for kernel, cells in chosen.items():
        errors = _medians(cells, 'nmse_percent')
        energies = ('kinetic_nmse_percent', 'potential_nmse_percent', 'inertia_not_pd_percent')
        figures = [*errors, *(_medians(cells, name) for name in energies)]
        ratio = '' if paper is None else f'{np.exp(np.log(errors / paper).mean()):.2f}'
        seconds = f'{_medians(cells, "fit_s"):.1f}'
        table.add_row(kernel, *(f'{float(value):.2g}' for value in figures), seconds, ratio)
    return table


def _medians(cells: list[Cell], name: str) -> Any:
    return np.median([cell[name] for cell in cells], axis=0)


def _name(n_joints: int, seed: int, kernel: str, changes: dict[str, str]) -> str:
    extra = ''.join(f' {name}={value}' for name, value in sorted(changes.items()))
    return f'{n_joints} joints, seed {seed}, {kernel}{extra}'


def _read(path: Path) -> dict[str, Cell]:
    cells: dict[str, Cell] = json.loads(path.read_text()) if path.exists() else {}
    return cells


def _write(path: Path, cells: dict[str, Cell]) -> None:
    write_whole(path, json.dumps(cells, indent=1, sort_keys=True).encode())


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks panda_monte_carlo', description=__doc__)
    parser.add_argument('--joints', type=int, nargs='+', default=[6])
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(3)))
    parser.add_argument('--kernels', nargs='+', default=list(KERNELS))
    parser.add_argument(
        '--set',
        nargs='*',
        default=[],
        metavar='NAME=VALUE',
        help='such as friction=false',
    )
    parser.add_argument(
        '--results', type=Path, default=Path('panda_monte_carlo.json'),
        help='kept and resumed from',
    )  # fmt: skip
    return parser.parse_args(arguments)
