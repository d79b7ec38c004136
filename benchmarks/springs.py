"""
How often springs between two points are found and invented, on simulated arms of four joints.

Each arm is fitted with a coil spring, with a gas spring, and without.

"""

from __future__ import annotations

import argparse
from dataclasses import replace
import json
import time

import numpy as np

from benchmarks._drives import random_arm, sines, WIDTH
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.identify import identify

N_JOINTS, JOINT = 4, 1
RATE_HZ, SECONDS, REACH = 20.0, 60.0, 1.6
NOISE, FRICTION, SPRING = 0.002, 0.05, 0.7
"""Of torques, of each part of friction, and of springs, in deviations of the links' torque."""

KINDS = ('none', 'coil', 'gas')


def main(arguments: list[str]) -> int:
    """Print a line for each kind of spring and each arm, and one with the counts of each kind."""
    parser = argparse.ArgumentParser(prog='benchmarks springs', description=__doc__)
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(8)))
    parser.add_argument('--kinds', choices=KINDS, nargs='+', default=KINDS)
    options = parser.parse_args(arguments)
    for kind in options.kinds:
        right, errors = 0, []
        for seed in options.seeds:
            found, error, seconds = fitted(kind, seed)
            expected = [int(kind != 'none' and joint == JOINT) for joint in range(N_JOINTS)]
            right += found == expected
            errors.append(error)
            line = {'kind': kind, 'seed': seed, 'springs': found, 'nmse': error}
            print(json.dumps({**line, 'cpu_s': round(seconds, 1)}), flush=True)
        middle = float(np.exp(np.median(np.log(errors))))
        print(f'{kind}: {right} of {len(errors)} right, median nMSE {middle:.2g} %', flush=True)
    return 0


def fitted(kind: str, seed: int) -> tuple[list[int], float, float]:
    """Return the springs found at each joint, nMSE of an unseen motion [%], and CPU seconds."""
    training, test = (simulated(kind, seed, motion) for motion in (0, 1))
    start = time.process_time()
    found = identify(training)
    seconds = time.process_time() - start
    names = found.fit.friction.names()
    springs = [sum(name == 'lever spring' for name in own) for own in names]
    assert test.tau_noiseless is not None
    left = test.tau_noiseless - found.torque(test.q, test.dq, test.ddq)
    ratio = 100.0 * left.var(axis=0) / test.tau_noiseless.var(axis=0)
    return springs, float(np.exp(np.mean(np.log(ratio)))), seconds


def simulated(kind: str, seed: int, number: int) -> Dataset:
    """Return one of the motions of an arm."""
    arm, rng = random_arm(N_JOINTS, seed), np.random.default_rng([seed, number])
    t, q, dq, ddq = motion(rng)
    links = arm.torque(q, dq, ddq)
    size, rate = simulated_sizes(seed)
    clean = links + FRICTION * size * (dq / rate + np.tanh(dq / WIDTH))
    if kind != 'none':
        clean[:, JOINT] += SPRING * size[JOINT] * spring(kind, seed, q[:, JOINT])
    tau = clean + NOISE * size * rng.standard_normal(clean.shape)
    return replace(Dataset.from_arrays(q, dq, ddq, tau, t=t), tau_noiseless=clean)


def simulated_sizes(seed: int) -> tuple[Array, Array]:
    """Return deviations in the first motion of links' torques [N m] and velocities, each (n,)."""
    _, *state = motion(np.random.default_rng([seed, 0]))
    return random_arm(N_JOINTS, seed).torque(*state).std(axis=0), state[1].std(axis=0)


def spring(kind: str, seed: int, q: Array) -> Array:
    """Return the torque of a spring, whose deviation is about one within the reach."""
    rng = np.random.default_rng([seed, 2])
    a, b = rng.uniform(0.04, 0.12), rng.uniform(0.15, 0.4)
    centre, reach = rng.uniform(-np.pi, np.pi), np.linspace(-REACH, REACH, 101)

    def torque(at: Array) -> Array:
        length = np.sqrt(a**2 + b**2 - 2.0 * a * b * np.cos(at - centre))
        shortest, longest = b - a, b + a
        if kind == 'coil':
            force = length - 0.7 * shortest
        else:  # a gas spring pushes, and more where it is short
            force = -(1.0 + 0.3 * (longest - length) / (longest - shortest))
        return force * a * b * np.sin(at - centre) / length

    return torque(q) / torque(reach).std()


def motion(rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Return times and sums of sines within the reach, with their derivatives."""
    t = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    return t, *sines(rng, t, N_JOINTS, 6, REACH)
