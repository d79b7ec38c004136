"""
Information of designed motions beside published exciting trajectories of a Panda (excitation.md).

Designed with the chain of the URDF, for as long as the recording, within its positions, and its
largest velocities and accelerations. Log determinant of the mean information on the base
parameters at unit noise, and condition number of their regressor.

"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.linalg import svdvals

from benchmarks._real import ARMS
from lip_id_ros.arrays import Array
from lip_id_ros.description.urdf import parse_description, urdf_text
from lip_id_ros.excitation.arms import LINK_STD, UnknownArm
from lip_id_ros.excitation.design import design
from lip_id_ros.excitation.expected_error import Information, States
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import LimitedMotions
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.settings import PreprocessingSettings

HARMONICS, RANDOM, STATES = (5, 10), 10, 1000
UNKNOWN, KNOWN = 100.0, 1e-6
"""Prior deviations of the links' parameters, and of friction, which is not looked at here."""


def main(arguments: list[str]) -> int:
    """Print a line for each recording and each motion beside it."""
    parser = argparse.ArgumentParser(prog='benchmarks excitation_information', description=__doc__)
    parser.add_argument('data', type=Path, help='folder of the recordings')
    options = parser.parse_args(arguments)
    for name in ('Panda, 30 Hz', 'Panda, 1 kHz'):
        for line in _lines(name, options.data):
            print(line, flush=True)
    return 0


def _lines(name: str, data: Path) -> Iterator[str]:
    arm = ARMS[name]
    parts = arm.split(data, 'last', 'articulated', PreprocessingSettings())
    joints, types = parts[0].joint_names, parts[0].joint_types
    chain = parse_description(*urdf_text(data / arm.urdf), joints, types).chain
    base = _base(chain)
    q, dq, ddq = (np.concatenate([getattr(x, k) for x in parts]) for k in ('q', 'dq', 'ddq'))
    seconds = parts[1].t[-1] - parts[0].t[0]
    yield _line(name, 'recorded', *_information(chain, base, (q, dq, ddq)))
    fastest, steepest = (np.abs(x).max(axis=0) for x in (dq, ddq))
    jerk = np.full(len(joints), 1e6)
    limits = JointLimits(joints, q.min(axis=0), q.max(axis=0), fastest, steepest, jerk)
    for harmonics in HARMONICS:
        middle = 0.5 * (limits.lower + limits.upper)
        motions = LimitedMotions(limits, middle, seconds, harmonics)
        t, rng = np.linspace(0.0, seconds, STATES), np.random.default_rng(0)
        draws = [motions.motion(motions.random(rng)).sample(t) for _ in range(RANDOM)]
        best = max(_information(chain, base, each) for each in draws)
        yield _line(name, f'best of {RANDOM} random, {harmonics} harmonics', *best)
        criterion = Information(_learner(chain, limits), 100.0 * seconds, 48 * harmonics)
        motion = design(motions, criterion).motion
        found = _information(chain, base, motion.sample(t))
        yield _line(name, f'designed, {harmonics} harmonics', *found)


def _learner(chain: Chain, limits: JointLimits) -> UnknownArm:
    n = len(limits.velocity)
    std = np.repeat([UNKNOWN, KNOWN], [n * len(LINK_STD), 3 * n])
    return UnknownArm(chain, np.diag(std), np.ones(n), 0.02 * limits.velocity)


def _base(chain: Chain) -> Array:
    """Return an orthonormal basis of the parameters that torques depend on, shape (11 n, b)."""
    rng, n = np.random.default_rng(0), len(chain.prismatic)
    states = rng.uniform(-3.0, 3.0, (3, 500, n))
    _, sizes, rows = np.linalg.svd(_regressor(chain, *states), full_matrices=False)
    return np.asarray(rows[sizes > 1e-9 * sizes[0]].T)


def _information(chain: Chain, base: Array, states: States) -> tuple[float, float]:
    values = svdvals(_regressor(chain, *states) @ base / np.sqrt(len(states[0])))
    return float(2.0 * np.log(values).sum()), float(values[0] / values[-1])


def _regressor(chain: Chain, *states: Array) -> Array:
    found = torque_regressor(chain, *map(np.ascontiguousarray, states))
    return np.asarray(found.reshape(-1, found.shape[2]))


def _line(name: str, motion: str, log_det: float, condition: float) -> str:
    return f'| {name} | {motion} | {log_det:.1f} | {condition:.0f} |'
