"""
How often what drives add is found and invented, on simulated arms of three joints.

`memory`: the LuGre model (Canudas de Wit and others, IEEE Transactions on Automatic Control 1995)
without its damping. `position`: a torque over the joint's own position, of any shape. `speed`:
efforts that fall with speed. `none`: friction alone. Another motion is unseen.

"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
import time

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks._arms import random_arm, RandomArm, sines
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.friction.conservative_terms import (
    lever_spring,
    position_curve,
    ripple,
    spring,
    velocity_curve,
)
from lip_id_ros.friction.terms import dahl
from lip_id_ros.identification import fit

N_JOINTS, RATE_HZ, SECONDS, REACH = 3, 50.0, 40.0, 1.6
NOISE, VISCOUS, COULOMB, STATIC = 0.01, 0.1, 0.3, 0.39
"""In standard deviations of the links' torques."""

STRIBECK, DISPLACEMENT, WIDTH, FINE_S = 0.05, 0.02, 0.005, 1e-3
BUMPS, BUMP, BREADTH, DROOP = 3, 0.3, 0.4, 0.3
"""Of a torque over the position [-, torque, rad], and of efforts that fall with speed."""

FOUND = {
    'memory': (dahl,),
    'position': (position_curve, ripple, spring, lever_spring),
    'speed': (velocity_curve,),
    'none': (),
}
"""Terms that stand for what a drive adds."""


def main(arguments: list[str]) -> int:
    """Print a line for each arm, and one with the counts of each kind of drive."""
    parser = argparse.ArgumentParser(prog='benchmarks drives', description=__doc__)
    parser.add_argument('--kinds', nargs='+', choices=FOUND, default=list(FOUND))
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(20)))
    options = parser.parse_args(arguments)
    errors: dict[str, list[float]] = {kind: [] for kind in options.kinds}
    counts = {kind: dict.fromkeys(FOUND, 0) for kind in options.kinds}
    for seed in options.seeds:
        for kind in options.kinds:
            found, error, cpu_s = fitted(kind, seed)
            for each, joints in found.items():
                counts[kind][each] += joints
            errors[kind].append(float(np.exp(np.log(error).mean())))
            shown = ' '.join(f'{x:.2g}' for x in error)
            print(f'{kind} | {seed} | {_shown(found)} | {shown} | {cpu_s:.0f}', flush=True)
    print(f'of {N_JOINTS * len(options.seeds)} joints:')
    for kind, count in counts.items():
        print(f'{kind} | {_shown(count)} | {np.median(errors[kind]):.2g} %')
        if 'none' in errors:
            ratio = np.exp(np.mean(np.log(np.array(errors[kind]) / np.array(errors['none']))))
            print(f'errors in those of none: {ratio:.2f}')
    return 0


def _shown(found: Mapping[str, int]) -> str:
    return ', '.join(f'{kind} {joints}' for kind, joints in found.items() if FOUND[kind])


def fitted(kind: str, seed: int) -> tuple[dict[str, int], Array, float]:
    """Return at how many joints each is found, errors of another motion [%], and the time."""
    arm = random_arm(N_JOINTS, seed)
    rng = np.random.default_rng(seed + 100)
    _, usual, _ = motion = sines(rng, _times(), N_JOINTS, 6, REACH)
    size, rate = arm.torque(*motion).std(axis=0), usual.std(axis=0)
    centres = rng.uniform(-REACH, REACH, (N_JOINTS, BUMPS))
    drives = Drives(kind, size, rate, centres)
    train, test = (_recorded(arm, drives, 2 * seed + k) for k in (1, 1000))
    started = time.process_time()
    model = fit(train)
    cpu_s = time.process_time() - started
    assert model.arm is not None
    assert test.tau_noiseless is not None
    terms = model.arm.friction.basis.terms
    found = {
        each: len({part.drive.joints[0] for part in terms if part.term.kind in kinds})
        for each, kinds in FOUND.items()
    }
    tau = model.predict(test.q, test.dq, test.ddq, test.t).tau
    return found, nmse_percent(tau, test.tau_noiseless), cpu_s


def _times() -> Array:
    return np.arange(round(RATE_HZ * SECONDS)) / RATE_HZ


@dataclass(frozen=True, eq=False)
class Drives:
    """
    The drives of an arm.

    Attributes
    ----------
    kind : str
    size : array, shape (n,)
        Standard deviations of the links' torques [N m].
    rate : array, shape (n,)
        And of usual velocities [rad/s].
    centres : array, shape (n, k)
        Of bumps of the torque over the position [rad].

    """

    kind: str
    size: Array
    rate: Array
    centres: Array

    def torque(self, t: Array, q: Array, dq: Array) -> Array:
        """Return the torques of the drives along a motion, shape (N, n) [N m]."""
        rate = dq / self.rate
        dry = _steady(dq) * np.tanh(dq / WIDTH)
        added = np.zeros_like(q)
        if self.kind == 'memory':
            dry = _remembering(t, q)
        elif self.kind == 'position':
            signs = (-1.0) ** np.arange(BUMPS)
            added = BUMP * np.exp(-np.square((q[:, :, None] - self.centres) / BREADTH)) @ signs
        elif self.kind == 'speed':
            added = -DROOP * np.tanh(rate) * np.abs(rate)
        return np.asarray(self.size * (VISCOUS * rate + dry + added))


def _recorded(arm: RandomArm, drives: Drives, seed: int) -> Dataset:
    rng, t = np.random.default_rng(seed), _times()
    q, dq, ddq = sines(rng, t, N_JOINTS, 6, REACH)
    tau = arm.torque(q, dq, ddq) + drives.torque(t, q, dq)
    return Dataset(
        t=t, q=q, dq=dq, ddq=ddq,
        tau=tau + NOISE * drives.size * rng.standard_normal(tau.shape),
        joint_names=tuple(f'joint_{k}' for k in range(N_JOINTS)),
        joint_types=('revolute',) * N_JOINTS,
        segment=np.zeros(len(t), np.int64),
        tau_noiseless=tau,
    )  # fmt: skip


def _steady(dq: Array) -> Array:
    """Return dry friction of steady motion, without its sign."""
    return COULOMB + (STATIC - COULOMB) * np.exp(-((dq / STRIBECK) ** 2))


def _remembering(t: Array, q: Array) -> Array:
    """Return the torque of bristles, whose deflection turns within the displacement."""
    fine = np.arange(t[0], t[-1] + FINE_S, FINE_S)
    dq = CubicSpline(t, q)(fine, 1)
    torque = np.zeros_like(dq)
    stiffness = COULOMB / DISPLACEMENT
    for k in range(1, len(fine)):
        steady = _steady(dq[k])
        kept = np.exp(-FINE_S * stiffness * np.abs(dq[k]) / steady)
        torque[k] = np.sign(dq[k]) * steady * (1.0 - kept) + kept * torque[k - 1]
    return np.array([np.interp(t, fine, each) for each in torque.T]).T
