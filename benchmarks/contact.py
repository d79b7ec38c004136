"""Contacts on a simulated Panda: how soon they are flagged, and how often none is."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
import json
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks._changed_arms import with_wrong_masses
from benchmarks._driven_panda import move
from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.monitoring import ContactDetector, external_torques, ExternalTorque
from lip_id_ros.monitoring.detection import DEVIATIONS, LEAST_SHOWN
from lip_id_ros.preprocessing import preprocess
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import FitSettings, PreprocessingSettings
from lip_id_ros.simulation import panda
from lip_id_ros.workflow.fit import fit

EVERY = 10  # the observer runs at 100 Hz
FIRST, APART, LASTS = 1.0, 2.0, 0.5  # contacts [s]
MOTIONS = 2  # that are learned from
NO_ERROR = 0.0  # of simulated torques but noise
# The low-pass must let through what the observer sees; around the turn of a joint it smears the
# step of its friction.
PREPROCESSING = PreprocessingSettings(cutoff_hz=12.5, max_samples=2000, min_velocity=0.2)


@dataclass(frozen=True)
class Contacts:
    """Pushes of half a second each, on one joint after the other, to and fro."""

    n_joints: int
    torque: float
    rounds: int = 4

    def __call__(self, t: float) -> Array:
        """External torques [N m] at a time."""
        push = np.zeros(self.n_joints)
        number, since = divmod(t - FIRST, APART)
        if 0 <= number < self.n_joints * self.rounds and since < LASTS:
            round_, joint = divmod(int(number), self.n_joints)
            push[joint] = self.torque * (-1) ** (joint + round_)
        return push

    def begins(self, joint: int) -> list[float]:
        """When the pushes on a joint begin [s]."""
        return [FIRST + APART * (joint + self.n_joints * each) for each in range(self.rounds)]

    @property
    def duration(self) -> float:
        """Length of the motion that has them all [s]."""
        return FIRST + APART * self.n_joints * self.rounds


def main(arguments: list[str]) -> int:
    """Learn, watch a free motion, push, print a table; exit status 1 where anything was wrong."""
    options = _options(arguments)
    rows = []
    for seed in options.seeds:
        rows.append(measure(options.joints, seed, options.torque, options.seconds, FitSettings()))
        print(json.dumps(rows[-1]), flush=True)
    _print(rows)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1))
    missed = any(None in joint for row in rows for joint in row['delay_s'])
    return int(missed or any(row['false_flags'] for row in rows))


def measure(
    n_joints: int, seed: int, torque: float, seconds: float, settings: FitSettings
) -> dict[str, Any]:
    """
    Return what free motion showed, and the delays of flags [s]; None where a push was missed.

    Two motions are learned from, another sets the thresholds, a third must not be flagged, and a
    fourth is pushed.

    """
    rng = np.random.default_rng(seed)
    nominal = with_wrong_masses(panda(n_joints), 0.2, 0.02, rng)
    model = learned([move(nominal, rng, seconds) for _ in range(MOTIONS)], settings)
    _, normal = watch(model, move(nominal, rng, seconds))
    detector = ContactDetector.calibrated(model.joint_names, normal, torque, NO_ERROR)
    _, free = watch(model, move(nominal, rng, seconds))
    contacts = Contacts(n_joints, torque)
    t, pushed = watch(model, move(nominal, rng, contacts.duration, contacts))
    std, large, false, blind = judged(detector, free)
    flags = judged(detector, pushed)[2]
    return {
        'seed': seed,
        'noise': model.noise_std.tolist(),
        'deviation': np.median(std, axis=0).tolist(),
        'largest_free': large.tolist(),
        'false_flags': int(false.any(axis=1).sum()),
        'blind': blind.mean(axis=0).tolist(),
        'delay_s': [
            [delay(t, flags[:, joint], begin) for begin in contacts.begins(joint)]
            for joint in range(n_joints)
        ],
    }


def learned(runs: Sequence[JointSamples], settings: FitSettings) -> InverseDynamicsModel:
    """Fit the arm to measured motions."""
    return fit(preprocess(runs, PREPROCESSING), settings)


def watch(model: InverseDynamicsModel, run: JointSamples) -> tuple[Array, list[ExternalTorque]]:
    """Return times and the estimated external torques."""
    rows = slice(None, None, EVERY)
    t = run.t[rows]
    return t, external_torques(
        model.with_rise_time(0.0), t, run.position[rows], run.velocity[rows], run.effort[rows]
    )


def judged(
    detector: ContactDetector, estimates: Sequence[ExternalTorque]
) -> tuple[Array, Array, BoolArray, BoolArray]:
    """Return deviations, the largest estimate in the threshold, flags, blindness."""
    found = [detector.judge(each) for each in estimates]
    std = np.array([each.std for each in found])
    blind = np.array([each.blind for each in found])
    threshold = np.maximum(DEVIATIONS * std, LEAST_SHOWN * detector.smallest)
    share = np.array([each.torque for each in estimates]) / threshold
    largest = np.abs(np.where(blind, 0.0, share)).max(axis=0)
    return std, largest, np.array([each.touched for each in found]), blind


def delay(t: Array, flagged: BoolArray, begin: float) -> float | None:
    """Return how long after its begin a push was flagged on its joint [s]."""
    during = (t >= begin) & (t < begin + LASTS) & flagged
    return float(t[np.argmax(during)] - begin) if during.any() else None


def _print(rows: list[dict[str, Any]]) -> None:
    false = ', '.join(str(row['false_flags']) for row in rows)
    table = Table(title=f'{len(rows)} seeds; false flags: {false}')
    for name in ('joint', 'deviation N m', 'free, share of it', 'flagged after ms', 'missed'):
        table.add_column(name, justify='right')
    for joint in range(len(rows[0]['deviation'])):
        deviations = [row['deviation'][joint] for row in rows]
        shares = [row['largest_free'][joint] for row in rows]
        delays = [each for row in rows for each in row['delay_s'][joint]]
        found = [1e3 * each for each in delays if each is not None]
        table.add_row(
            f'J{joint + 1}',
            f'{min(deviations):.2f} to {max(deviations):.2f}',
            f'{max(shares):.2f}',
            f'{min(found):.0f} to {max(found):.0f}' if found else '',
            f'{delays.count(None)} of {len(delays)}',
        )
    Console().print(table)


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks contact', description=__doc__)
    parser.add_argument('--joints', type=int, default=7)
    parser.add_argument('--seeds', type=int, nargs='+', default=[0, 1, 2, 3, 4])
    parser.add_argument('--torque', type=float, default=5.0, help='of each contact [N m]')
    parser.add_argument('--seconds', type=float, default=60.0, help='of free motion')
    parser.add_argument('--json', type=Path, help='also write the figures here')
    return parser.parse_args(arguments)
