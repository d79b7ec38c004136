"""
Errors of an arm that warms up: of the fit to its first minute, of the same followed, and refitted.

Viscous friction falls by 40 % and dry friction by 15 % in twenty minutes, offsets wander. The arm
is refitted to the last two minutes, and judged on the half minute after them. Rivals learn from
each sample after they have predicted it, as the arm that is followed does, from the first minute
on.

"""

from __future__ import annotations

import argparse
from dataclasses import replace
import json
import time

import numpy as np

from benchmarks._drives import random_arm, sines, WIDTH
from benchmarks._online import sparse_spectrum, true_regressor
from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.workflow.fit import fit

N_JOINTS = 4
RATE_HZ, FIRST_S, WARM_UP_S, REACH = 20.0, 60.0, 1200.0, 1.6
VISCOUS, COULOMB, OFFSET, NOISE = 0.4, 0.3, 0.02, 0.01
"""Of torques, in deviations of the links' torque; the offset's walk in a root minute."""

FALLS = (0.4, 0.15)
TIME_CONSTANT_S = 600.0
LAST_S, JUDGED_S = 120.0, 30.0
JUDGED_AT = (300.0, 600.0, 900.0, 1170.0)
FADING = 1.0 / (LAST_S * RATE_HZ)
"""What rivals forget in a step."""

NAMES = ('frozen', 'followed', 'refitted', 'true regressor', 'spectrum', 'fading spectrum')


def main(arguments: list[str]) -> int:
    """Print a line for each arm, and one with the geometric means."""
    parser = argparse.ArgumentParser(prog='benchmarks warm_up', description=__doc__)
    parser.add_argument('--seeds', type=int, nargs='+', default=list(range(4)))
    options = parser.parse_args(arguments)
    rows = []
    for seed in options.seeds:
        figures = errors(seed)
        rows.append([figures[name] for name in NAMES])
        print(json.dumps({'seed': seed, **figures}), flush=True)
    means = np.exp(np.mean(np.log(rows), axis=0))
    found = (f'{name} {each:.3g}' for name, each in zip(NAMES, means, strict=True))
    print('nMSE [%]:', *found, flush=True)
    return 0


def errors(seed: int) -> dict[str, float]:
    """Return nMSE [%] of noiseless torques, the mean over joints and times, and the coverage."""
    data = simulated(seed)
    first, rest = data.select(data.t < FIRST_S), data.select(data.t >= FIRST_S)
    model = fit(first)
    adaptation = Adaptation(model)
    start = time.perf_counter()
    followed = adaptation.update(rest.t, rest.q, rest.dq, rest.ddq, rest.tau)
    seconds = time.perf_counter() - start
    within = np.abs(rest.tau - followed.tau) <= 2.0 * followed.std
    found: dict[str, list[float]] = {name: [] for name in NAMES}
    learned = {
        'frozen': followed.frozen,
        'followed': followed.tau,
        **rivals(seed, data, first.n_samples),
    }
    for at in JUDGED_AT:
        judged = (rest.t >= FIRST_S + at) & (rest.t < FIRST_S + at + JUDGED_S)
        last = (rest.t >= FIRST_S + at - LAST_S) & (rest.t < FIRST_S + at)
        refitted = fit(rest.select(last)).predict(
            *(x[judged] for x in (rest.q, rest.dq, rest.ddq))
        )
        assert rest.tau_noiseless is not None
        truth = rest.tau_noiseless[judged]
        all_of = {name: tau[judged] for name, tau in learned.items()} | {'refitted': refitted.tau}
        for name, tau in all_of.items():
            nmse = 100.0 * np.mean((tau - truth) ** 2, axis=0) / truth.var(axis=0)
            found[name].append(float(nmse.mean()))
    return {
        **{name: float(np.mean(each)) for name, each in found.items()},
        'covered_percent': float(100.0 * within.mean()),
        'learned_percent': float(100.0 * followed.learned.mean()),
        'us_per_sample': 1e6 * seconds / rest.n_samples,
    }


def rivals(seed: int, data: Dataset, first: int) -> dict[str, Array]:
    """Return torques (N, n) that rivals predict of all samples but the `first`."""
    arm, states = random_arm(N_JOINTS, seed), (data.q, data.dq, data.ddq)
    noise = NOISE * arm.torque(*states).std(axis=0)
    kept, fading = sparse_spectrum(states, data.tau, first, (0.0, FADING))
    return {
        'true regressor': true_regressor(arm, states, data.tau, noise, FADING)[first:],
        'spectrum': kept[first:],
        'fading spectrum': fading[first:],
    }


def simulated(seed: int) -> Dataset:
    """Return the first minute and the warm-up, in one motion."""
    arm, rng = random_arm(N_JOINTS, seed), np.random.default_rng(seed)
    t, q, dq, ddq = motion(rng)
    links = arm.torque(q, dq, ddq)
    size = links.std(axis=0)
    warm = 1.0 - np.exp(-np.maximum(t - FIRST_S, 0.0) / TIME_CONSTANT_S)
    warm /= 1.0 - np.exp(-WARM_UP_S / TIME_CONSTANT_S)
    viscous, coulomb = (1.0 - fall * warm for fall in FALLS)
    walk = np.cumsum(rng.standard_normal(q.shape), axis=0) / np.sqrt(60.0 * RATE_HZ)
    walk -= walk[t < FIRST_S][-1]
    walk[t < FIRST_S] = 0.0
    clean = links + size * (
        VISCOUS * viscous[:, None] * dq / dq.std(axis=0)
        + COULOMB * coulomb[:, None] * np.tanh(dq / WIDTH)
        + OFFSET * walk
    )
    tau = clean + NOISE * size * rng.standard_normal(clean.shape)
    return replace(Dataset.from_arrays(q, dq, ddq, tau, t=t), tau_noiseless=clean)


def motion(rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    """Return times and sums of sines within the reach, with their derivatives."""
    t = np.arange(0.0, FIRST_S + WARM_UP_S, 1.0 / RATE_HZ)
    return t, *sines(rng, t, N_JOINTS, 12, REACH)
