"""
How often coupled positions are found, and how well such arms are learned.

Simulated arms of six joints, a minute at 20 Hz, noise of 1 %, another minute unseen. Each arm is
fitted with and without its couplings; a seed has the same links for all.

"""

from __future__ import annotations

import argparse
from functools import partial
from itertools import product
from pathlib import Path
import time

import numpy as np

from benchmarks._coupled import ARMS, coupled_arm, recorded
from benchmarks._results import Results, Row
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.identification import fit
from lip_id_ros.rigid_body.couplings import couplings_of

MOTIONS = ('random', 'periodic')


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print a line for each kind of arm."""
    parser = argparse.ArgumentParser(prog='benchmarks couplings', description=__doc__)
    parser.add_argument('--results', type=Path, default=Path('couplings.json'))
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS))
    parser.add_argument('--motions', nargs='+', choices=MOTIONS, default=list(MOTIONS))
    parser.add_argument('--seeds', nargs='+', type=int, default=list(range(5)))
    options = parser.parse_args(arguments)
    results = Results(options.results)
    for arm, motion in product(options.arms, options.motions):
        rows = [
            results.row(f'{arm} | {motion} | {seed}', partial(measured, arm, motion, seed))
            for seed in options.seeds
        ]
        print(line(arm, motion, rows), flush=True)
    return 0


def measured(arm: str, motion: str, seed: int) -> Row:
    """Fit an arm, and return what was found, and its errors of the true torques [%]."""
    train, test = recorded(coupled_arm(ARMS[arm], seed), motion == 'periodic', seed)
    started = time.process_time()
    model = fit(train)
    cpu_s = time.process_time() - started
    assert model.arm is not None
    assert test.tau_noiseless is not None
    tau = model.predict(test.q, test.dq, test.ddq).tau
    return {
        'found': [list(each) for each in couplings_of(model.arm.chain.couplings)],
        'nmse': nmse_percent(tau, test.tau_noiseless).tolist(),
        'cpu_s': cpu_s,
    }


def line(arm: str, motion: str, rows: list[Row]) -> str:
    """Return how many arms were found as they are, the geometric mean of errors, and the time."""
    truth = sorted(map(list, ARMS[arm]))
    right = sum(sorted(row['found']) == truth for row in rows)
    error = np.exp(np.log([row['nmse'] for row in rows]).mean())
    cpu_s = np.mean([row['cpu_s'] for row in rows])
    return f'| {arm} | {motion} | {right} of {len(rows)} | {error:.2g} | {cpu_s:.0f} |'
