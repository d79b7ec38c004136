"""
The default fit on simulated arms of many robots, beside least squares with true kinematics.

Prints the rows of the table of zoo.md.

"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product
from pathlib import Path
import time

import numpy as np

from benchmarks._results import line, Results, Row, short
from benchmarks._zoo import load_arm, MOTIONS, recorded, SerialArm, ZOO, ZooArm, ZooRecording
from benchmarks.baselines import method, MODELS
from benchmarks.baselines.rigid_body import contiguous, diagonal, identified, smooth_sign
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import LipIdError
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.progress import silent
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation.arm import panda_urdf

FIXED, TRUE = 'fixed sign', 'true friction'
RIVALS = (FIXED, TRUE)
"""Least squares with the true kinematics, with a usual friction function and with the true one."""
FIXED_WIDTH = 1.0 / 40.0
"""Of the smooth sign, in largest velocities of the joint: 0.05 rad/s at 2 rad/s."""


def main(arguments: list[str]) -> int:
    """Fit what is not in the file of results yet, and print rows."""
    parser = argparse.ArgumentParser(prog='benchmarks zoo', description=__doc__)
    parser.add_argument('--robots', type=Path, help='folder (default: of example-robot-data)')
    parser.add_argument('--results', type=Path, default=Path('zoo.json'))
    parser.add_argument('--arms', nargs='+', choices=ZOO, default=list(ZOO))
    parser.add_argument('--motions', nargs='+', choices=MOTIONS, default=list(MOTIONS))
    parser.add_argument('--seeds', nargs='+', type=int, default=[0])
    parser.add_argument('--models', nargs='+', choices=MODELS, default=[ARTICULATED])
    options = parser.parse_args(arguments)
    robots = options.robots or panda_urdf().parents[2]
    results = Results(options.results)
    models = [*RIVALS, *options.models]
    for name, motion, seed in product(options.arms, options.motions, options.seeds):
        for model in models:
            measure = partial(_measured, robots, ZOO[name], motion, seed, model)
            results.row(' | '.join((name, motion, str(seed), model)), measure)
    for motion in options.motions:
        print(f'{motion}:', *table(results.rows, motion, options.models[0]), '', sep='\n')
    return 0


def _measured(robots: Path, arm: ZooArm, motion: str, seed: int, model: str) -> Row:
    try:
        loaded = load_arm(robots / arm.urdf, arm.first, arm.last)
        return measured(loaded, motion, seed, model)
    except (LipIdError, np.linalg.LinAlgError) as error:  # the other arms are still to come
        return {'error': f'{type(error).__name__}: {error}'}


def measured(arm: SerialArm, motion: str, seed: int, model: str) -> Row:
    """
    Fit one model, and return its errors on the unseen motion [%], joint by joint.

    `nmse`: of the true torques. `nmse_measured`: of those with noise.

    """
    recording = recorded(arm, motion, seed)
    test = recording.test
    started = time.process_time()
    if model in RIVALS:
        tau = least_squares(arm.description.chain, recording, model)
    else:
        fitted = method(model, arm.description.place).fit(recording.train, FitSettings(), silent)
        tau = fitted.predict(test.q, test.dq, test.ddq).tau
    assert test.tau_noiseless is not None
    return {
        'cpu_s': time.process_time() - started,
        'nmse': nmse_percent(tau, test.tau_noiseless).tolist(),
        'nmse_measured': nmse_percent(tau, test.tau).tolist(),
    }


def least_squares(chain: Chain, recording: ZooRecording, rival: str) -> Array:
    """Identify links, rotors and friction with known kinematics, and return the test's torques."""

    def features(data: Dataset) -> Array:
        shapes: tuple[Array, ...] = recording.friction.features(data.dq)
        if rival == FIXED:
            width = FIXED_WIDTH * np.abs(recording.train.dq).max(axis=0)
            shapes = (data.dq, smooth_sign(data.dq, width))
        links = torque_regressor(chain, *contiguous(data.q, data.dq, data.ddq))
        return np.concatenate([links, *(diagonal(x) for x in shapes)], axis=2)

    parameters, _ = identified(features(recording.train), recording.train.tau)
    return np.asarray(features(recording.test) @ parameters)


def table(rows: Mapping[str, Row], motion: str, ours: str) -> Iterator[str]:
    """
    Yield a line for each arm that was fitted, and one for all joints of all arms.

    Geometric means over the joints of the errors of the measured torques, of ours and of both
    rivals; the ratios of ours to theirs; the same for the true torques; CPU seconds.

    """
    everything = []
    for name in ZOO:
        found = [_of(rows, name, motion, model) for model in (ours, *RIVALS)]
        if any('error' in row for row in found[0]):
            yield line(name, 'failed')
        elif all(found):
            keys = 'nmse_measured', 'nmse'
            logs = np.array([[_logs(each, key) for each in found] for key in keys])
            everything.append(logs)
            cpu = np.mean([row['cpu_s'] for row in found[0]])
            yield line(name, *_cells(logs), f'{cpu:.0f}')
    if everything:
        yield line('all joints', *_cells(np.concatenate(everything, axis=2)), '')


def _of(rows: Mapping[str, Row], name: str, motion: str, model: str) -> list[Row]:
    """Return the rows of all seeds."""
    split = {tuple(key.split(' | ')): row for key, row in rows.items()}
    return [
        row for (arm, of, _, by), row in split.items() if (arm, of, by) == (name, motion, model)
    ]


def _logs(rows: list[Row], key: str) -> Array:
    """Return the logarithms of the errors of all joints and seeds."""
    return np.log(np.concatenate([row[key] for row in rows]))


def _cells(logs: Array) -> Iterator[str]:
    """Yield means and ratios of logarithms of errors, shape (2, 3, joints)."""
    for models in logs:
        yield from (short(_mean(each)) for each in models)
        yield from (f'{_mean(models[0] - rival):.2f}' for rival in models[1:])


def _mean(logs: Array) -> float:
    return float(np.exp(logs.mean()))
