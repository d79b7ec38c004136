"""
The default fit beside its rivals on real arms: errors of unseen parts, and coverage.

Prints the rows of the tables of real recordings in docs/accuracy.md and docs/comparison.md.

"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from pathlib import Path
import time

import numpy as np

from benchmarks._real import ARMS, RealArm, SPLITS
from benchmarks._results import Results, Row
from lip_id_ros.arrays import Array
from lip_id_ros.baselines import method
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.model import InverseDynamicsModel, TorqueModel
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings, PreprocessingSettings

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
    parser.add_argument('--min-velocity', type=float, default=-1.0, help='(default: by the model)')
    options = parser.parse_args(arguments)
    preprocessing = PreprocessingSettings(min_velocity=options.min_velocity)
    results = Results(options.results)
    for model, name, split in product(options.models, options.arms, options.splits):
        measure = partial(_measured, ARMS[name], options.data, split, model, preprocessing)
        results.row(f'{name}, {split} | {model}', measure)
    for line in (*accuracy(results.rows), *comparison(results.rows)):
        print(line)
    return 0


def _measured(
    arm: RealArm, data: Path, split: str, model: str, preprocessing: PreprocessingSettings
) -> Row:
    kernel = ARTICULATED if model in KNOWN else model
    train, test = arm.split(data, split, kernel, preprocessing)
    started = time.process_time()
    try:
        fitted: TorqueModel = method(model, data / arm.urdf).fit(train, FitSettings(), silent)
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
    """Yield a line for each fit of the default: errors, their means, coverage, CPU seconds."""
    for name, row in _of(rows, ARTICULATED).items():
        errors = ' '.join(_short(x) for x in row['nmse'])
        covered = ' '.join(f'{x:.0f}' for x in row['coverage'])
        yield _line(f'{name} 30 %', errors, *_means(row), covered, f'{row["cpu_s"]:.0f}')


def comparison(rows: Mapping[str, Row]) -> Iterator[str]:
    """
    Yield a line for each recording and rival: means, and ratios of the default's errors to these.

    The first ratio is the geometric mean over the joints, the second that of the means.

    """
    ours = _of(rows, ARTICULATED)
    for rival in (*KNOWN, *PLAIN):
        logs = []
        for name, row in _of(rows, rival).items():
            if name in ours:
                logs.append(np.log(np.array(ours[name]['nmse']) / np.array(row['nmse'])))
                of_means = np.mean(ours[name]['nmse']) / np.mean(row['nmse'])
                ratios = f'{np.exp(logs[-1].mean()):.2f}', f'{of_means:.2f}'
                yield _line(name, *_means(ours[name]), rival, *_means(row), *ratios)
        if logs:
            yield _line('all joints', rival, f'{np.exp(np.concatenate(logs).mean()):.2f}')


def _of(rows: Mapping[str, Row], model: str) -> dict[str, Row]:
    """Return the rows of a model by recording and split, without those that failed."""
    pairs = {tuple(key.split(' | ')): row for key, row in rows.items() if 'nmse' in row}
    return {name: row for (name, each), row in pairs.items() if each == model}


def _means(row: Row) -> tuple[str, str]:
    errors = np.array(row['nmse'])
    return _short(errors.mean()), _short(np.exp(np.log(errors).mean()))


def _short(value: float) -> str:
    return f'{value:.2g}' if value < 99.5 else f'{value:.0f}'


def _line(*cells: str) -> str:
    return f'| {" | ".join(cells)} |'
