"""
The search for placements on real arms at many seeds: how often it finds the lowest minimum.

accuracy.md has 40 seeds of each recording.

"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
import time

import numpy as np

from benchmarks._cells import show
from benchmarks._real import ARMS, RealArm
from benchmarks._results import Results, Row
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_search import ArmSearch
from lip_id_ros.progress import silent

SAME = 0.016
"""Relative difference of residuals, in the geometric mean, of searches that found one minimum."""

COLUMNS = {
    'arm': 'recording',
    'lowest': 'lowest',
    'worst_percent': 'worst %',
    'agreed': 'agreed',
    'false_agreements': 'agreed on another',
    'descents': 'descents',
    'cpu_s': 'CPU s',
}


def main(arguments: list[str]) -> int:
    """Search what is not in the file of results yet, and print a table."""
    parser = argparse.ArgumentParser(prog='benchmarks placement_seeds', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the recordings')
    parser.add_argument('--results', type=Path, default=Path('placement_seeds.json'))
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS))
    parser.add_argument('--seeds', type=int, default=40)
    options = parser.parse_args(arguments)
    results, rows = Results(options.results), []
    for name in options.arms:
        fitter = _fitter(ARMS[name], options.data)
        runs = [
            results.row(f'{name} | {seed}', partial(_searched, fitter, seed))
            for seed in range(options.seeds)
        ]
        rows.append(_summary(name, runs))
    show(f'{options.seeds} seeds, first 70 %', COLUMNS, rows, 110)
    return 0


def _fitter(arm: RealArm, data: Path) -> ArmFitter:
    train, _ = arm.split(data, 'last')
    return ArmFitter(train)


def _searched(fitter: ArmFitter, seed: int) -> Row:
    started = time.process_time()
    found = ArmSearch(fitter).calibrated(seed, silent)
    return {
        'log_residual': float(np.log(found.noise_std / fitter.torque_std).mean()),
        'agreed': found.agreed,
        'descents': found.descents,
        'cpu_s': time.process_time() - started,
    }


def _summary(name: str, runs: list[Row]) -> Row:
    residual = np.array([run['log_residual'] for run in runs])
    agreed = np.array([run['agreed'] for run in runs])
    excess = np.expm1(residual - residual.min())
    descents = [run['descents'] for run in runs]
    return {
        'arm': name,
        'lowest': f'{np.sum(excess <= SAME)} of {len(runs)}',
        'worst_percent': round(100.0 * float(excess.max()), 1),
        'agreed': int(agreed.sum()),
        'false_agreements': int(np.sum(agreed & (excess > SAME))),
        'descents': f'{min(descents)} to {max(descents)}',
        'cpu_s': round(float(np.median([run['cpu_s'] for run in runs])), 1),
    }
