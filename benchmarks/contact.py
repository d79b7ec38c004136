"""Contacts on a simulated Panda: how soon they are flagged, and how often none is."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from lip_id_ros.config import FitSettings, PreprocessingSettings
from lip_id_ros.control import ComputedTorque, Feedforward, LearnedFeedforward
from lip_id_ros.gp import fit
from lip_id_ros.monitoring import external_torques, Thresholds
from lip_id_ros.preprocessing import for_training, preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.serving import Predictor
from lip_id_ros.simulation import (
    no_contact,
    NominalFeedforward,
    placed,
    SinusoidTrajectory,
    track,
    Tracking,
)
from lip_id_ros.simulation.panda import MOTION
from lip_id_ros.tracking.setup import panda_setup, Setup

Array = NDArray[np.float64]

EVERY = 10  # the observer runs at 100 Hz
FIRST, APART, LASTS = 2.0, 2.0, 0.5  # contacts [s]


@dataclass(frozen=True)
class Contacts:
    """A push on one joint after the other, for half a second each, to and fro."""

    n_joints: int
    torque: float

    def __call__(self, t: float) -> Array:
        """External torques [N m] at a time."""
        push = np.zeros(self.n_joints)
        joint, since = divmod(t - FIRST, APART)
        if 0 <= joint < self.n_joints and since < LASTS:
            push[int(joint)] = self.torque * (-1) ** int(joint)
        return push

    def begin(self, joint: int) -> float:
        """When the push on a joint begins [s]."""
        return FIRST + APART * joint


def main(arguments: list[str]) -> int:
    """Learn, watch a free motion, push, print a table."""
    options = _options(arguments)
    row = measure(options.joints, options.seed, options.torque, options.seconds, FitSettings())
    _print(row)
    if options.json:
        options.json.write_text(json.dumps(row, indent=1))
    return 0


def measure(
    n_joints: int, seed: int, torque: float, seconds: float, settings: FitSettings
) -> dict[str, Any]:
    """Return residuals of free motions and delays of flags [s]; None where a push was missed."""
    setup, rng = panda_setup(n_joints), np.random.default_rng(seed)
    nominal = NominalFeedforward(setup.arm.with_wrong_masses(0.2, 0.02, rng))
    training = move(setup, nominal, rng, seconds)
    samples = JointSamples(
        training.t, training.q, training.dq, training.tau, setup.arm.joint_names
    )
    prepared = for_training(preprocess(samples), PreprocessingSettings())
    predictor = Predictor(fit(prepared, settings))
    learned = LearnedFeedforward(predictor)
    # what is normal shows on a motion that the model has not seen
    thresholds = Thresholds.of_free_motion(watch(predictor, move(setup, learned, rng, seconds))[1])
    _, free = watch(predictor, move(setup, learned, rng, seconds))
    contacts = Contacts(n_joints, torque)
    pushed = move(setup, learned, rng, contacts.begin(n_joints), contacts)
    t, residual = watch(predictor, pushed)
    flags = thresholds.exceeded(residual)
    return {
        'threshold': thresholds.torque.tolist(),
        'largest_free': np.abs(free).max(axis=0).tolist(),
        'false_flags': int(thresholds.exceeded(free).any(axis=1).sum()),
        'delay_s': [delay(t, flags[:, joint], contacts.begin(joint)) for joint in range(n_joints)],
    }


def move(
    setup: Setup,
    feedforward: Feedforward,
    rng: np.random.Generator,
    seconds: float,
    contact: Callable[[float], Array | float] = no_contact,
) -> Tracking:
    """Move on random sums of sinusoids."""
    trajectory = SinusoidTrajectory.random(MOTION.first(len(setup.posture)), rng)
    simulated = placed(setup.arm, setup.drives, trajectory, rng)
    controller = ComputedTorque(feedforward, setup.gains)
    return track(simulated, controller, trajectory, seconds, contact)


def watch(predictor: Predictor, run: Tracking) -> tuple[Array, Array]:
    """Return times and external torques as estimated."""
    rows = slice(None, None, EVERY)
    t = run.t[rows]
    return t, external_torques(predictor, t, run.q[rows], run.dq[rows], run.tau[rows])


def delay(t: Array, flagged: NDArray[np.bool_], begin: float) -> float | None:
    """Return how long after its begin a push was flagged on its joint [s]."""
    during = (t >= begin) & (t < begin + LASTS) & flagged
    return float(t[np.argmax(during)] - begin) if during.any() else None


def _print(row: dict[str, Any]) -> None:
    table = Table(title=f'{row["false_flags"]} false flags')
    for name in ('joint', 'threshold N m', 'largest, free N m', 'flagged after ms'):
        table.add_column(name, justify='right')
    columns = zip(row['threshold'], row['largest_free'], row['delay_s'], strict=True)
    for number, (threshold, largest, seconds) in enumerate(columns, start=1):
        after = 'missed' if seconds is None else f'{1e3 * seconds:.0f}'
        table.add_row(f'J{number}', f'{threshold:.2f}', f'{largest:.2f}', after)
    Console().print(table)


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks contact', description=__doc__)
    parser.add_argument('--joints', type=int, default=7)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--torque', type=float, default=5.0, help='of each contact [N m]')
    parser.add_argument('--seconds', type=float, default=60.0, help='of free motion')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    return parser.parse_args(arguments)
