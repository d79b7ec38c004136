"""Simulated arms of four joints with a coil spring, a gas spring, or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks._arms import random_arm, sines, WIDTH
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset

N_JOINTS, JOINT = 4, 1
RATE_HZ, SECONDS, REACH = 20.0, 60.0, 1.6
NOISE, FRICTION, SPRING = 0.002, 0.05, 0.7
"""Of torques, of each part of friction, and of springs, in deviations of the links' torque."""

KINDS = ('none', 'coil', 'gas')


def simulated(kind: str) -> Dataset:
    rng = np.random.default_rng([0, 0])
    t = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    q, dq, ddq = sines(rng, t, N_JOINTS, 6, REACH)
    links = random_arm(N_JOINTS, 0).torque(q, dq, ddq)
    size = links.std(axis=0)
    clean = links + FRICTION * size * (dq / dq.std(axis=0) + np.tanh(dq / WIDTH))
    if kind != 'none':
        clean[:, JOINT] += SPRING * size[JOINT] * spring(kind, 0, q[:, JOINT])
    tau = clean + NOISE * size * rng.standard_normal(clean.shape)
    return replace(Dataset.from_arrays(q, dq, ddq, tau, t=t), tau_noiseless=clean)


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
