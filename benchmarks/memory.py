"""
How often friction that remembers is found and invented, on simulated arms of three joints.

Drives have the LuGre model (Canudas de Wit and others, IEEE Transactions on Automatic Control
1995) without its damping, or the same friction without memory. Another motion is unseen.

"""

from __future__ import annotations

import argparse
import time

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks._drives import random_arm, RandomArm, sines
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import nmse_percent
from lip_id_ros.friction.dahl import Dahl
from lip_id_ros.identification import fit

N_JOINTS, RATE_HZ, SECONDS, REACH = 3, 50.0, 40.0, 1.6
NOISE, VISCOUS, COULOMB, STATIC = 0.01, 0.1, 0.3, 0.39
"""In standard deviations of the links' torques."""

STRIBECK, DISPLACEMENT, WIDTH, FINE_S = 0.05, 0.02, 0.005, 1e-3
KINDS = ('memory', 'none')


def main(arguments: list[str]) -> int:
    """Print a line for each arm, and one with the counts of each kind of friction."""
    parser = argparse.ArgumentParser(prog='benchmarks memory', description=__doc__)
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(20)))
    options = parser.parse_args(arguments)
    errors: dict[str, list[float]] = {kind: [] for kind in KINDS}
    counts = dict.fromkeys(KINDS, 0)
    for seed in options.seeds:
        for kind in KINDS:
            found, error, cpu_s = fitted(kind, seed)
            counts[kind] += found
            errors[kind].append(float(np.exp(np.log(error).mean())))
            shown = ' '.join(f'{x:.2g}' for x in error)
            print(f'{kind} | {seed} | {found} of {N_JOINTS} | {shown} | {cpu_s:.0f}', flush=True)
    of = N_JOINTS * len(options.seeds)
    for kind in KINDS:
        print(f'{kind}: memory at {counts[kind]} of {of} joints; {np.median(errors[kind]):.2g} %')
    ratio = np.exp(np.mean(np.log(np.array(errors['memory']) / np.array(errors['none']))))
    print(f'errors with memory in those without: {ratio:.2f}')
    return 0


def fitted(kind: str, seed: int) -> tuple[int, Array, float]:
    """Return at how many joints memory was found, errors of another motion [%], and the time."""
    arm = random_arm(N_JOINTS, seed)
    rng = np.random.default_rng(seed + 100)
    size = arm.torque(*sines(rng, _times(), N_JOINTS, 6, REACH)).std(axis=0)
    train, test = (_recorded(arm, kind, size, 2 * seed + k) for k in (1, 1000))
    started = time.process_time()
    model = fit(train)
    cpu_s = time.process_time() - started
    assert model.arm is not None
    assert test.tau_noiseless is not None
    terms = model.arm.friction.basis.terms
    found = {part.drive.joints[0] for part in terms if isinstance(part.term, Dahl)}
    tau = model.predict(test.q, test.dq, test.ddq, test.t).tau
    return len(found), nmse_percent(tau, test.tau_noiseless), cpu_s


def _times() -> Array:
    return np.arange(round(RATE_HZ * SECONDS)) / RATE_HZ


def _recorded(arm: RandomArm, kind: str, size: Array, seed: int) -> Dataset:
    rng, t = np.random.default_rng(seed), _times()
    q, dq, ddq = sines(rng, t, N_JOINTS, 6, REACH)
    dry = _remembering(t, q) if kind == 'memory' else _steady(dq) * np.tanh(dq / WIDTH)
    tau = arm.torque(q, dq, ddq) + size * (VISCOUS * dq / dq.std(axis=0) + dry)
    return Dataset(
        t=t, q=q, dq=dq, ddq=ddq,
        tau=tau + NOISE * size * rng.standard_normal(tau.shape),
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
