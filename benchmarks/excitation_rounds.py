"""
Errors after rounds of designed motions from nothing, beside random ones (excitation.md).

The default fit finds the chain. A first motion of 10 s is designed without a model, and a second
one, of 10 or 20 s, from what was learned of the first. All motions so far are learned from.

"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
import time

import numpy as np

from benchmarks._results import Results, Row
from benchmarks.excitation import Arm, arm_of, EFFECTS, random_motion, ROBOTS, SECONDS, unseen
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.excitation.planning import design_motion
from lip_id_ros.excitation.settings import ExcitationConfig, SearchSettings
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.settings import FitSettings

FIRST_S = 10.0
RANDOM_SEEDS = 1
Case = tuple[str, str, int]


def measured(case: Case) -> Row:
    """Return errors on unseen motions after each round [%], joint by joint."""
    robot, effects, seed = case
    arm, started = arm_of(robot, effects), time.process_time()
    rng = np.random.default_rng(seed)
    first = arm.record(design_motion(_config(arm, seed, FIRST_S)).motion, rng)
    model = fit(first, FitSettings(seed=seed))
    data = {'first 10 s': [first]}
    for name, seconds in (('two of 10 s', FIRST_S), ('first and 20 s', SECONDS)):
        config = _config(arm, seed, seconds)
        data[name] = [first, arm.record(design_motion(config, model=model).motion, rng)]
    for k in range(RANDOM_SEEDS):
        random = arm.record(random_motion(arm, 1000 * seed + k), rng)
        data[f'random 20 s, {k}'] = [random]
        data[f'first and random 20 s, {k}'] = [first, random]
    found: Row = {'first 10 s': _errors(robot, effects, model)}
    for name, parts in data.items():
        if name not in found:
            found[name] = _errors(robot, effects, _fitted(parts, seed))
    return {**found, 'cpu_s': time.process_time() - started}


def _config(arm: Arm, seed: int, seconds: float) -> ExcitationConfig:
    motion = replace(arm.motion, duration_s=seconds)
    return ExcitationConfig(motion, search=SearchSettings(seed=seed))


def _fitted(parts: list[Dataset], seed: int) -> InverseDynamicsModel:
    return fit(concatenate(parts), FitSettings(seed=seed))


def _errors(robot: str, effects: str, model: InverseDynamicsModel) -> list[float]:
    errors = []
    for test in unseen(robot, effects):
        assert test.tau_noiseless is not None
        tau = model.predict(test.q, test.dq, test.ddq).tau
        errors.append(nmse_percent(tau, test.tau_noiseless))
    return [float(each) for each in np.mean(errors, axis=0)]


RATIOS = {
    'two of 10 s': 'random 20 s',
    'first and 20 s': 'first and random 20 s',
}
"""What is compared with what."""


def table(
    rows: Mapping[str, Row], robots: list[str], effects: list[str], seeds: list[int]
) -> None:
    """Print medians over seeds of geometric means over joints, and of their ratios."""
    header = ('Arm', 'Drives', 'Motions', 'Seeds', 'nMSE [%]', 'of random', 'ratio', 'range')
    print(f'| {" | ".join(header)} |\n|{"---|" * len(header)}')
    for robot, drives in product(robots, effects):
        found = [rows[key] for seed in seeds if (key := _key((robot, drives, seed))) in rows]
        for name, other in RATIOS.items():
            ours = np.array([_mean([row[name]]) for row in found])
            theirs = np.array(
                [_mean([row[f'{other}, {k}'] for k in range(RANDOM_SEEDS)]) for row in found]
            )
            ratios = ours / theirs
            figures = f'{np.median(ours):.3g} | {np.median(theirs):.3g} | {np.median(ratios):.2f}'
            print(
                f'| {robot} | {drives} | {name} | {len(found)} | {figures} | '
                f'{ratios.min():.2f} to {ratios.max():.2f} |'
            )


def _mean(errors: list[list[float]]) -> float:
    return float(np.exp(np.mean(np.log(errors))))


def _key(case: Case) -> str:
    return ' | '.join(map(str, case))


def main(arguments: list[str]) -> int:
    """Measure what is not in the file of results yet, and print the table."""
    parser = argparse.ArgumentParser(prog='benchmarks excitation_rounds', description=__doc__)
    parser.add_argument('--results', type=Path, default=Path('excitation_rounds.json'))
    parser.add_argument('--robots', nargs='+', choices=ROBOTS, default=list(ROBOTS))
    parser.add_argument('--effects', nargs='+', choices=EFFECTS, default=list(EFFECTS))
    parser.add_argument('--seeds', nargs='+', type=int, default=[0, 1, 2])
    options = parser.parse_args(arguments)
    results = Results(options.results)
    for seed, robot, effects in product(options.seeds, options.robots, options.effects):
        case = robot, effects, seed
        results.row(_key(case), partial(measured, case))
    table(results.rows, options.robots, options.effects, options.seeds)
    return 0
