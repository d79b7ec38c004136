"""
The default fit beside fits with fewer terms, on simulated arms of kinds that are hard.

Drives have memory, stick, droop or pull by soft cables; recordings are short, periodic or coarse.
Prints a line for each kind of arm, and one for all: geometric means over joints and seeds of the
errors of another motion's measured torques [%]: of the default (`fit.terms: processes`), without
processes (`named`), and with links and friction alone (`friction`).

"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
import time

import numpy as np

from benchmarks._families import FAMILIES, FamilyArm
from benchmarks._results import Results, Row
from lip_id_ros.arrays import Array
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.identification import fit
from lip_id_ros.identification.identify import OFFERS
from lip_id_ros.settings import FitSettings


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print the lines of the table."""
    parser = argparse.ArgumentParser(prog='benchmarks families', description=__doc__)
    parser.add_argument('--results', type=Path, default=Path('families.json'))
    parser.add_argument('--families', nargs='+', choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument('--seeds', nargs='+', type=int, default=list(range(3)))
    options = parser.parse_args(arguments)
    results, every = Results(options.results), []
    for name in options.families:
        rows = {
            terms: [
                results.row(f'{name} | {seed} | {terms}', partial(measured, name, seed, terms))
                for seed in options.seeds
            ]
            for terms in OFFERS
        }
        every.append(logs_of(rows))
        print(line(name, every[-1]), flush=True)
    print(line('all', np.concatenate(every, axis=1)))
    return 0


def measured(name: str, seed: int, terms: str) -> Row:
    """Fit an arm, and return its errors on another motion [%], and what was selected."""
    train, test = FamilyArm(FAMILIES[name], seed).recorded(seed)
    started = time.process_time()
    model = fit(train, FitSettings(terms=terms))
    cpu_s = time.process_time() - started
    tau = model.predict(test.q, test.dq, test.ddq, test.t).tau
    return {
        'nmse': nmse_percent(tau, test.tau).tolist(),
        'cpu_s': cpu_s,
        'friction': model.summary['friction'],
        'remainder': model.summary['remainder'],
    }


def logs_of(rows: Mapping[str, Sequence[Row]]) -> Array:
    """Return the logarithms of errors of each kind of fit, shape (kinds, joints of all seeds)."""
    return np.log([np.concatenate([row['nmse'] for row in some]) for some in rows.values()])


def line(name: str, logs: Array) -> str:
    """Return geometric means of errors, the default first, and its ratio to the best of all."""
    means = np.exp(logs.mean(axis=1))
    cells = [f'{each:.2g}' for each in means]
    return f'| {name} | {" | ".join(cells)} | {means[0] / means.min():.2f} |'
