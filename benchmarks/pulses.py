"""
Known torque pulses on a real double pendulum: found, missed, invented, and how late.

FOLDER holds the logs of a double pendulum with known disturbances as CSV files, and beside each
with pulses `NAME.extra.csv` with columns tau_ext_j1, tau_ext_j2. The arm is fitted to the
logs `C1_*` and the free ones but the last, deviations are learned from the same logs, and the
last free log and those with pulses are judged sample by sample.

"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.loading.examined import load_dataset
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.monitoring import Calibration, ContactDetector, external_torques, ExternalTorque
from lip_id_ros.workflow.fit import fit

HELD_S = 0.5
"""Alarms closer than this are one [s]."""

AFTER_S = 0.15
"""After the end of a pulse its contact may still be found [s]."""

LEAST_PULSE = 0.05
"""Of its torque [N m]: smaller ones are none."""


class Log(NamedTuple):
    """Times (N,), and positions, velocities, torques and external torques (N, n)."""

    t: Array
    q: Array
    dq: Array
    tau: Array
    external: Array


class Pulse(NamedTuple):
    """First and last sample of a pulse at a joint, that at half its height, and its sign."""

    joint: int
    first: int
    last: int
    half: int
    sign: float


class Outcome(NamedTuple):
    """Of a log: pulses, delays of those found [s], false alarms, free minutes, blind shares."""

    pulses: int
    delays: list[float]
    false_alarms: int
    minutes: float
    blind: Array
    seen: list[tuple[Array, Array]]


def main(arguments: list[str]) -> int:
    """Print a line for each log, and one for all."""
    options = _options(arguments)
    free = sorted(options.folder.glob('free_*.csv'))
    training = [*sorted(options.folder.glob('C1_*.csv')), *free[:-1]]
    model = fit(load_dataset(training))
    calm = [each for path in training for each in _watched(model, read(path))]
    detector = Calibration.of(calm).detector(model.joint_names, options.smallest)
    pushed = [path for path in sorted(options.folder.glob('*.csv')) if _extra(path).exists()]
    outcomes = {path.stem: outcome(model, detector, read(path)) for path in (free[-1], *pushed)}
    for name, found in outcomes.items():
        print(json.dumps({'log': name, **summary([found])}), flush=True)
    print(json.dumps({'log': 'all with pulses', **summary(list(outcomes.values())[1:])}))
    return 0


def read(path: Path) -> Log:
    """Read a log, and the pulses beside it: none where there is no such file."""
    table = np.genfromtxt(path, delimiter=',', names=True)
    names = table.dtype.names or ()
    joints = [name.removeprefix('q_') for name in names if name.startswith('q_')]
    q, dq, tau = (
        np.stack([table[f'{of}_{joint}'] for joint in joints], axis=1) for of in ('q', 'dq', 'tau')
    )
    if not _extra(path).exists():
        return Log(table['t'], q, dq, tau, np.zeros_like(q))
    extra = np.genfromtxt(_extra(path), delimiter=',', names=True)
    external = np.stack([extra[f'tau_ext_{joint}'] for joint in joints], axis=1)
    return Log(table['t'], q, dq, tau, external)


def _extra(path: Path) -> Path:
    return path.with_suffix('.extra.csv')


def _watched(model: InverseDynamicsModel, log: Log) -> list[ExternalTorque]:
    return external_torques(model.with_rise_time(0.0), log.t, log.q, log.dq, log.tau)


def pulses(external: Array) -> list[Pulse]:
    """Return the pulses of external torques (N, n)."""
    found = []
    for joint, torque in enumerate(external.T):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], torque != 0.0, [0]])))
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            size = np.abs(torque[first:end])
            if size.max() > LEAST_PULSE:
                half = int(first + np.argmax(size >= 0.5 * size.max()))
                sign = float(np.sign(torque[first + size.argmax()]))
                found.append(Pulse(joint, int(first), int(end - 1), half, sign))
    return found


def outcome(model: InverseDynamicsModel, detector: ContactDetector, log: Log) -> Outcome:
    """Watch a log."""
    watched = _watched(model, log)
    judged = [detector.judge(each) for each in watched]
    torque = np.array([each.torque for each in watched])
    touched = np.array([each.touched for each in judged])
    blind = np.array([each.blind for each in judged])
    acting, delays, own = np.zeros(len(log.t), dtype=bool), [], pulses(log.external)
    for pulse in own:
        end = int(np.searchsorted(log.t, log.t[pulse.last] + AFTER_S))
        rows = slice(pulse.first, end)
        acting[rows] = True
        right = np.sign(torque[rows, pulse.joint]) == pulse.sign
        hits = np.flatnonzero(touched[rows, pulse.joint] & right)
        delays += [float(log.t[pulse.first + at] - log.t[pulse.half]) for at in hits[:1]]
    free = np.diff(log.t)[~acting[1:]].sum() / 60.0
    seen = [
        (torque[~hidden, joint], log.external[~hidden, joint])
        for joint, hidden in enumerate(blind.T)
    ]
    alarms = _alarms(log.t, touched.any(axis=1) & ~acting)
    return Outcome(len(own), delays, alarms, float(free), blind.mean(axis=0), seen)


def _alarms(t: Array, flagged: BoolArray) -> int:
    at = t[flagged]
    return int(at.size > 0) + int(np.sum(np.diff(at) > HELD_S))


def summary(outcomes: Sequence[Outcome]) -> dict[str, object]:
    """Return the figures of logs together."""
    delays = [each for found in outcomes for each in found.delays]
    alarms, minutes = (
        sum(getattr(x, name) for x in outcomes) for name in ('false_alarms', 'minutes')
    )
    figures: dict[str, object] = {
        'pulses': sum(each.pulses for each in outcomes),
        'found': len(delays),
        'median_delay_s': round(float(np.median(delays)), 3) if delays else None,
        'false_alarms_per_minute': round(alarms / minutes, 1),
        'blind': np.mean([each.blind for each in outcomes], axis=0).round(3).tolist(),
    }
    joints = [
        (
            np.concatenate([each[0] for each in column]),
            np.concatenate([each[1] for each in column]),
        )
        for column in zip(*(each.seen for each in outcomes), strict=True)
    ]
    if figures['pulses']:
        pairs = [np.corrcoef(found, true)[0, 1] for found, true in joints]
        figures['correlation'] = [round(float(each), 2) for each in pairs]
    return figures


def _options(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='benchmarks pulses', description=__doc__)
    parser.add_argument('folder', type=Path, metavar='FOLDER')
    parser.add_argument('--smallest', type=float, default=0.5, help='contact to be found [N m]')
    return parser.parse_args(arguments)
