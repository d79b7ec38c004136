"""The default fit beside its rivals on real arms: errors of unseen parts, and coverage."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
import sys
import time
from typing import Any

import numpy as np

from benchmarks._real import ARMS, RealArm, SPLITS
from lip_id_ros.baselines import method
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.model import InverseDynamicsModel, TorqueModel
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings, PreprocessingSettings

MODELS = ('articulated', 'rigid_body', 'rigid_body_friction', 'se', 'gip', 'recursive', 'lip')
DEFAULT = MODELS[0]


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print ratios to the rivals."""
    parser = argparse.ArgumentParser(prog='benchmarks real_arms', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the recordings')
    parser.add_argument('--results', type=Path, default=Path('real_arms.json'))
    parser.add_argument('--arms', nargs='+', choices=ARMS, default=list(ARMS))
    parser.add_argument('--splits', nargs='+', choices=SPLITS, default=list(SPLITS))
    parser.add_argument('--models', nargs='+', default=list(MODELS))
    parser.add_argument('--min-velocity', type=float, default=None)
    options = parser.parse_args(arguments)
    results = json.loads(options.results.read_text()) if options.results.exists() else {}
    preprocessing = PreprocessingSettings()
    if options.min_velocity is not None:
        preprocessing = PreprocessingSettings(min_velocity=options.min_velocity)
    for model in options.models:
        for name in options.arms:
            for split in options.splits:
                key = f'{name} | {split} | {model}'
                if key in results:
                    continue
                row = _measured(ARMS[name], options.data, split, model, preprocessing)
                results[key] = row
                options.results.write_text(json.dumps(results, indent=1))
                print(key, json.dumps(row), flush=True)
    _summarise(results)
    return 0


def _measured(
    arm: RealArm, data: Path, split: str, model: str, preprocessing: PreprocessingSettings
) -> dict[str, Any]:
    train, test = arm.split(data, split, preprocessing)
    started = time.process_time()
    try:
        fitted: TorqueModel = method(model, data / arm.urdf).fit(train, FitSettings(), silent)
    except LipIdError as error:
        return {'error': str(error)}
    row: dict[str, Any] = {'samples': train.n_samples, 'cpu_s': time.process_time() - started}
    row['nmse'] = nmse_percent(fitted.predict(test.q, test.dq, test.ddq).tau, test.tau).tolist()
    if isinstance(fitted, InverseDynamicsModel) and fitted.arm is not None:
        row['coverage'] = _coverage(fitted, test).tolist()
        row['friction'] = fitted.summary['friction']
        row['remainder'] = fitted.summary['remainder']
    return row


def _coverage(model: InverseDynamicsModel, test: Dataset) -> Any:
    """Return the share [%] of measured torques within two standard deviations, per joint."""
    found = model.predict(test.q, test.dq, test.ddq, return_std=True)
    assert found.std is not None
    return 100.0 * np.mean(np.abs(found.tau - test.tau) < 2.0 * found.std.measurement, axis=0)


def _summarise(results: dict[str, Any]) -> None:
    """Print geometric means of the ratio of the default's errors to each rival's."""
    for rival in sorted({key.split(' | ')[2] for key in results} - {DEFAULT}):
        ratios = {}
        for key, row in results.items():
            name, split, model = key.split(' | ')
            ours = results.get(f'{name} | {split} | {DEFAULT}', {})
            if model == rival and 'nmse' in row and 'nmse' in ours:
                ratio = np.log(np.array(ours['nmse']) / np.array(row['nmse']))
                ratios[f'{name}, {split}'] = ratio
        means = {key: round(float(np.exp(each.mean())), 2) for key, each in ratios.items()}
        every = float(np.exp(np.concatenate(list(ratios.values())).mean())) if ratios else np.nan
        print(f'{DEFAULT} / {rival}: {every:.2f}; {means}', file=sys.stderr)
