"""
Contacts on simulated arms of many robots: found, missed, invented, and where the monitor is blind.

Each arm is fitted to a minute of the zoo. Its monitor learns deviations in another minute at 100
Hz, is watched in a third, and each joint is pushed for half a second, four times, in a fourth.

"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
from pathlib import Path

import numpy as np

from benchmarks._zoo import drawn, load_arm, NOISE, random_motion, SerialArm, SimulatedZooArm, ZOO
from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.monitoring import Calibration, ContactDetector, external_torques, ExternalTorque
from lip_id_ros.simulation.arm import panda_urdf
from lip_id_ros.simulation.datasets import make_dataset
from lip_id_ros.simulation.trajectories import SinusoidTrajectory
from lip_id_ros.workflow.fit import fit

ARMS = ('UR3', 'UR5', 'UR10', 'Kinova', 'xArm7', 'Z1', 'TALOS', 'Baxter', 'TIAGo Pro', 'PR2')
SIZES = (1.0, 5.0, 20.0)
"""Of the contacts [N m]."""

FIRST_S, APART_S, LASTS_S, ROUNDS = 1.0, 2.0, 0.5, 4
"""One joint is pushed after the other, to and fro."""

LEARN_HZ, RATE_HZ, FREE_S, RESOLUTION = 25.0, 100.0, 60.0, 2.0 * np.pi / 2**18
"""Rates of what is learned from and of the monitor, and of positions [rad]."""

NO_ERROR = 0.0  # of simulated torques but noise


def main(arguments: list[str]) -> int:
    """Print a line for each arm and size."""
    parser = argparse.ArgumentParser(prog='benchmarks contact', description=__doc__)
    parser.add_argument('--arms', nargs='+', choices=ZOO, default=list(ARMS))
    parser.add_argument('--sizes', nargs='+', type=float, default=list(SIZES))
    parser.add_argument('--seed', type=int, default=0)
    options = parser.parse_args(arguments)
    for name in options.arms:
        entry = ZOO[name]
        arm = load_arm(Path(panda_urdf().parents[2]) / entry.urdf, entry.first, entry.last)
        for line in figures(arm, options.sizes, options.seed):
            print(json.dumps({'arm': name, **line}), flush=True)
    return 0


def figures(arm: SerialArm, sizes: Sequence[float], seed: int) -> list[dict[str, object]]:
    """Return what became of contacts of each size [N m]."""
    simulated, seen, _, rng = drawn(arm, 'random', seed)
    learned = np.arange(FREE_S * LEARN_HZ) / LEARN_HZ
    std = NOISE * simulated.inverse_dynamics(*seen.sample(learned)).std(axis=0)
    model = fit(make_dataset(simulated, seen, learned, std, rng))

    def stream(pushes: Array) -> tuple[Array, ...]:
        return measured(simulated, random_motion(arm.limits, rng), pushes, std, rng)

    free_s = np.zeros((round(FREE_S * RATE_HZ), arm.limits.n_joints))
    calibration, free = (watched(model, stream(free_s)) for _ in range(2))
    lines: list[dict[str, object]] = []
    for size in sizes:
        try:
            detector = Calibration.of(calibration, NO_ERROR).detector(model.joint_names, size)
        except DataError as error:  # too small for this arm
            lines.append({'torque': size, 'refused': str(error)})
            continue
        pushes = contacts(arm.limits.n_joints, size)
        line = found(model, detector, pushes, stream(pushes))
        false = sum(bool(np.any(detector.judge(each).touched)) for each in free)
        lines.append({'torque': size, 'false_flags': false, **line})
    return lines


def begins(n_joints: int, joint: int) -> list[float]:
    """Return when the pushes on a joint begin [s]."""
    return [FIRST_S + APART_S * (joint + n_joints * each) for each in range(ROUNDS)]


def contacts(n_joints: int, size: float) -> Array:
    """Return the external torques of pushes on all joints, (N, n) [N m]."""
    t = np.arange(round((FIRST_S + APART_S * n_joints * ROUNDS) * RATE_HZ)) / RATE_HZ
    pushes = np.zeros((len(t), n_joints))
    for joint in range(n_joints):
        for number, begin in enumerate(begins(n_joints, joint)):
            pushes[(t >= begin) & (t < begin + LASTS_S), joint] = size * (-1) ** (joint + number)
    return pushes


def measured(
    arm: SimulatedZooArm,
    motion: SinusoidTrajectory,
    pushes: Array,
    noise: Array,
    rng: np.random.Generator,
) -> tuple[Array, ...]:
    """Return t, q, dq and tau of an arm that keeps to its motion, and its true velocities."""
    t = np.arange(len(pushes)) / RATE_HZ
    q, dq, ddq = motion.sample(t)
    tau = arm.inverse_dynamics(q, dq, ddq) + noise * rng.standard_normal(q.shape) - pushes
    positions = RESOLUTION * np.round(q / RESOLUTION)
    return t, positions, np.gradient(positions, t, axis=0), tau, dq


def watched(model: InverseDynamicsModel, stream: tuple[Array, ...]) -> list[ExternalTorque]:
    """Return the external torques that the monitor estimates."""
    t, q, dq, tau, _ = stream
    return external_torques(model, t, q, dq, tau)


def found(
    model: InverseDynamicsModel,
    detector: ContactDetector,
    pushes: Array,
    stream: tuple[Array, ...],
) -> dict[str, object]:
    """Return counts of contacts: of all, of slow and fast joints, and where it saw nothing."""
    t, _, _, tau, dq = stream
    judged = [detector.judge(each) for each in watched(model, stream)]
    flags, blind = (np.array([getattr(x, of) for x in judged]) for of in ('touched', 'blind'))
    fast = np.sqrt(np.mean(dq**2, axis=0))
    rows = []
    for joint in range(pushes.shape[1]):
        for begin in begins(pushes.shape[1], joint):
            during = (t >= begin) & (t < begin + LASTS_S)
            flagged = t[during & flags[:, joint]]
            after = float(flagged[0] - begin) if flagged.size else None
            is_fast = np.abs(dq[during, joint]).mean() > fast[joint]
            rows.append((after, bool(blind[during, joint].mean() > 0.5), bool(is_fast)))
    seen = [row for row in rows if not row[1]]
    delays = [1e3 * row[0] for row in seen if row[0] is not None]

    def share(some: list[tuple[float | None, bool, bool]]) -> str:
        return f'{sum(row[0] is not None for row in some)} of {len(some)}'

    return {
        'found': share(rows),
        'found_where_it_sees': share(seen),
        'of_fast_joints': share([row for row in seen if row[2]]),
        'delay_ms': round(float(np.median(delays))) if delays else None,
        'longest_delay_ms': round(max(delays)) if delays else None,
        'blind_percent': round(100.0 * float(blind.mean())),
        'largest_torque': round(float(np.abs(tau).max()), 1),
    }
