"""
The default fit beside its rivals on real arms: errors of unseen parts, and coverage.

Prints the rows of the tables of real recordings in accuracy.md and comparison.md.

"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from pathlib import Path
import time

import numpy as np

from benchmarks._real import ARMS, RealArm, rounded, SPLITS
from benchmarks._results import by_error, geometric_mean, line, Results, Row, short
from benchmarks.baselines import method
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.model import InverseDynamicsModel, TorqueModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings

PLAIN = ('se', 'gip', 'lip', 'recursive')
KNOWN = ('rigid_body', 'rigid_body_friction')
"""With kinematics of a URDF; as those of the default, their samples are all, near rest too."""


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print rows of tables."""
    parser = argparse.ArgumentParser(prog='benchmarks real_arms', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the recordings')
    parser.add_argument('--results', type=Path, default=Path('real_arms.json'))
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS))
    parser.add_argument('--splits', nargs='+', choices=SPLITS, default=list(SPLITS))
    parser.add_argument('--models', nargs='+', default=[ARTICULATED, *KNOWN, *PLAIN])
    parser.add_argument(
        '--fits', type=int, default=1, help='of slightly different torques, for the median of each'
    )
    options = parser.parse_args(arguments)
    results = Results(options.results)
    for model, name, split in product(options.models, options.arms, options.splits):
        measure = partial(_median, ARMS[name], options.data, split, model, options.fits)
        results.row(f'{name}, {split} | {model}', measure)
    for table in (accuracy, known_kinematics, plain):
        print(*table(results.rows), '', sep='\n')
    return 0


def _median(arm: RealArm, data: Path, split: str, model: str, count: int) -> Row:
    """Return the fit of the median geometric mean of errors, and the lowest and the highest."""
    train, test = arm.split(data, split, ARTICULATED if model in KNOWN else model)
    urdf = data / arm.urdf
    rows = [_measured(rounded(train, seed), test, model, urdf) for seed in range(count)]
    if any('error' in row for row in rows):
        return next(row for row in rows if 'error' in row)
    rows = by_error(rows)
    spread = [geometric_mean(rows[0]), geometric_mean(rows[-1])]
    return {**rows[(count - 1) // 2], 'spread': spread}


def _measured(train: Dataset, test: Dataset, model: str, urdf: Path) -> Row:
    started = time.process_time()
    try:
        fitted: TorqueModel = method(model, urdf).fit(train, FitSettings(), silent)
    except LipIdError as error:
        return {'error': str(error)}
    row: Row = {'samples': train.n_samples, 'cpu_s': time.process_time() - started}
    row['nmse'] = nmse_percent(fitted.predict(test.q, test.dq, test.ddq).tau, test.tau).tolist()
    if isinstance(fitted, InverseDynamicsModel) and fitted.arm is not None:
        row['coverage'] = _coverage(fitted, test).tolist()
        row['friction'] = fitted.summary['friction']
        row['remainder'] = fitted.summary['remainder']
    return row


def _coverage(model: InverseDynamicsModel, test: Dataset) -> Array:
    """Return the share [%] of measured torques within two standard deviations, per joint."""
    found = model.predict(test.q, test.dq, test.ddq, return_std=True)
    assert found.std is not None
    inside = np.abs(found.tau - test.tau) < 2.0 * found.std.measurement
    return np.asarray(100.0 * np.mean(inside, axis=0))


def accuracy(rows: Mapping[str, Row]) -> Iterator[str]:
    """Yield a line for each split: errors, their means, spread of fits, coverage, CPU seconds."""
    for name, row in _of(rows, ARTICULATED).items():
        errors = ' '.join(short(x) for x in row['nmse'])
        covered = ' '.join(f'{x:.0f}' for x in row['coverage'])
        spread = ' to '.join(short(x) for x in row['spread'])
        cells = (errors, *_means(row), spread, covered, f'{row["cpu_s"]:.0f}')
        yield line(f'{name} 30 %', *cells)


def known_kinematics(rows: Mapping[str, Row]) -> Iterator[str]:
    """
    Yield a line for each recording, and one for all joints.

    Both means of the default; for each rival both means, and the geometric mean of the ratio of
    the default's errors to its errors.

    """
    rivals = {rival: _of(rows, rival) for rival in KNOWN}
    logs: dict[str, list[Array]] = {rival: [] for rival in KNOWN}
    for name, ours in _of(rows, ARTICULATED).items():
        cells = [name, *_means(ours)]
        for rival, found in rivals.items():
            if name in found:
                logs[rival].append(np.log(np.array(ours['nmse']) / np.array(found[name]['nmse'])))
                cells += [*_means(found[name]), f'{np.exp(logs[rival][-1].mean()):.2f}']
        yield line(*cells)
    for rival, each in logs.items():
        if each:
            yield line('all joints', rival, f'{np.exp(np.concatenate(each).mean()):.2f}')


def plain(rows: Mapping[str, Row]) -> Iterator[str]:
    """Yield a line for each recording: means of all models, and the default's in the least."""
    rivals = {rival: _of(rows, rival) for rival in PLAIN}
    for name, ours in _of(rows, ARTICULATED).items():
        means = [np.mean(found[name]['nmse']) for found in rivals.values() if name in found]
        cells = [_means(found[name])[0] if name in found else '' for found in rivals.values()]
        ratio = [f'{np.mean(ours["nmse"]) / min(means):.2f}'] if means else []
        yield line(name, _means(ours)[0], *cells, *ratio)


def _of(rows: Mapping[str, Row], model: str) -> dict[str, Row]:
    """Return the rows of a model by recording and split, without those that failed."""
    pairs = {tuple(key.split(' | ')): row for key, row in rows.items() if 'nmse' in row}
    return {name: row for (name, each), row in pairs.items() if each == model}


def _means(row: Row) -> tuple[str, str]:
    return short(float(np.mean(row['nmse']))), short(geometric_mean(row))
