"""
Payloads that are taken up and put down while an arm moves: found, missed, invented, and how well.

Each arm of four joints is fitted to its first minute, moves for a minute, and then takes a payload
up or puts it down every twenty seconds. Errors of torques are those 10 to 20 s after an event.

"""

from __future__ import annotations

import argparse
from dataclasses import replace
import json

import numpy as np

from benchmarks._arms import random_arm, sines, WIDTH
from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.rigid_body.pseudo_inertia import BODY
from lip_id_ros.workflow.fit import fit

N_JOINTS = 4
RATE_HZ, MOTION_S, REACH = 20.0, 1260.0, 1.6
FIRST_S, BEGIN_S, EVERY_S, LATE_S = 60.0, 120.0, 20.0, 10.0
VISCOUS, COULOMB, NOISE = 0.2, 0.15, 0.01
"""Of torques, in deviations of the links' torque."""

LIGHTEST, HEAVIEST, FARTHEST = 0.2, 3.0, 0.15
"""Of payloads [kg], and of their centres from the origin of the last link [m]."""


def main(arguments: list[str]) -> int:
    """Print a line for each arm, and one with the counts."""
    parser = argparse.ArgumentParser(prog='benchmarks payload_events', description=__doc__)
    parser.add_argument('--seeds', type=int, nargs='+', default=[0, 1])
    parser.add_argument('--events', type=int, default=24)
    options = parser.parse_args(arguments)
    for seed in options.seeds:
        for line in figures(seed, options.events):
            print(json.dumps(line), flush=True)
    return 0


def figures(seed: int, events: int) -> list[dict[str, object]]:
    """Return what became of each payload, and of the arm without any."""
    data, masses = simulated(seed, events)
    first, rest = data.select(data.t < FIRST_S), data.select(data.t >= FIRST_S)
    adaptation = Adaptation(fit(first))
    followed = adaptation.update(rest.t, rest.q, rest.dq, rest.ddq, rest.tau)
    found = adaptation.payload_events
    lines: list[dict[str, object]] = []
    for number, mass in enumerate(masses):
        start = BEGIN_S + number * EVERY_S
        own = [each for each in found if start <= each.t < start + EVERY_S]
        late = (rest.t >= start + LATE_S) & (rest.t < start + EVERY_S)
        errors = [_rms(tau[late] - rest.tau[late]) for tau in (followed.frozen, followed.tau)]
        line: dict[str, object] = {'seed': seed, 'mass': round(mass, 3), 'events': len(own)}
        if own and own[-1].payload is not None:
            payload = own[-1].payload
            line |= {'found': round(payload.mass, 3), 'std': round(payload.mass_std, 3)}
        line |= {'gone': bool(own) and own[-1].payload is None}
        lines.append({**line, 'rms_frozen_followed': [round(each, 4) for each in errors]})
    early = sum(each.t < BEGIN_S for each in found)
    lines.append({'seed': seed, 'invented_without_payload': early})
    return lines


def _rms(errors: Array) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def simulated(seed: int, events: int) -> tuple[Dataset, list[float]]:
    """Return a motion, and the mass at the last link after each event [kg]."""
    arm, rng = random_arm(N_JOINTS, seed), np.random.default_rng(seed)
    t = np.arange(0.0, MOTION_S, 1.0 / RATE_HZ)
    q, dq, ddq = sines(rng, t, N_JOINTS, 12, REACH)
    kept = t < BEGIN_S + events * EVERY_S
    t, q, dq, ddq = t[kept], q[kept], dq[kept], ddq[kept]
    bare = arm.torque(q, dq, ddq)
    size, tau, masses = bare.std(axis=0), bare.copy(), list[float]()
    for number in range(events):
        mass = float(np.exp(rng.uniform(*np.log([LIGHTEST, HEAVIEST]))))
        masses.append(0.0 if number % 2 else mass)
        rows = (t >= BEGIN_S + number * EVERY_S) & (t < BEGIN_S + (number + 1) * EVERY_S)
        links = arm.links.copy()
        links[-1, :BODY] += body(masses[-1], rng.uniform(-FARTHEST, FARTHEST, 3))
        tau[rows] = replace(arm, links=links).torque(q[rows], dq[rows], ddq[rows])
    friction = VISCOUS * dq / dq.std(axis=0) + COULOMB * np.tanh(dq / WIDTH)
    clean = tau + size * friction
    measured = clean + NOISE * size * rng.standard_normal(clean.shape)
    return Dataset.from_arrays(q, dq, ddq, measured, t=t), masses


def body(mass: float, centre: Array) -> Array:
    """Return the numbers of a ball of 5 cm, shape (10,)."""
    inertia = mass * ((centre @ centre + 1e-3) * np.eye(3) - np.outer(centre, centre))
    return np.concatenate([[mass], mass * centre, inertia[np.triu_indices(3)]])
