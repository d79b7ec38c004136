"""
An arm that is followed through an hour that teaches nothing true, with sound motion around it.

Friction is less than the fit has it, so that there is something to follow, and to lose.

Prints a line for each kind of hour: squared errors of noiseless torques that are served, in those
of the fit: before it, during it (where the fit has hardly any, at rest, in those before it), and
in half minutes after it (the worst, and the last); the
largest change of torques from one second's update to the next, in the noise's deviations; the
seconds in which the trust region was left; and how often what was learned was forgotten.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import json
import zlib

import numpy as np

from benchmarks._drives import random_arm, RandomArm, sines, WIDTH
from benchmarks.warm_up import COULOMB, N_JOINTS, NOISE, RATE_HZ, REACH, VISCOUS
from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.workflow.fit import fit

FIT_S, SOUND_S, HOUR_S, JUDGED_S = 60.0, 300.0, 3600.0, 30.0
SHARE = 0.8
"""Of the friction that was fitted."""

TOUCHED, TOUCH_S, PUSH = 0.3, (0.5, 3.0), (0.5, 2.0)
"""Share of the time in contact, its length, and its torque in deviations of the links' torque."""

States = tuple[Array, Array, Array]
Hour = Callable[['Arm', np.random.Generator, States], tuple[States, Array]]
"""From sound motion to the states (N, n), and the torques that are measured."""


class Arm:
    """An arm of random links with a share of viscous and dry friction, and noise."""

    def __init__(self, seed: int, share: float) -> None:
        self.links: RandomArm = random_arm(N_JOINTS, seed)
        states = motion(np.random.default_rng(seed), 600.0)
        self.share, self.speed = share, states[1].std(axis=0)
        self.size = self.links.torque(*states).std(axis=0)

    def clean(self, states: States) -> Array:
        """Return torques (N, n) without noise [N m]."""
        _, dq, _ = states
        friction = VISCOUS * dq / self.speed + COULOMB * np.tanh(dq / WIDTH)
        return np.asarray(self.links.torque(*states) + self.share * self.size * friction)

    def measured(self, states: States, rng: np.random.Generator) -> Array:
        """Return torques (N, n) with noise [N m]."""
        clean = self.clean(states)
        return np.asarray(clean + NOISE * self.size * rng.standard_normal(clean.shape))


def motion(rng: np.random.Generator, seconds: float) -> States:
    """Return sums of sines, each (N, n)."""
    q, dq, ddq = sines(rng, np.arange(0.0, seconds, 1.0 / RATE_HZ), N_JOINTS, 12, REACH)
    return q, dq, ddq


def touched(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Have something push joints for a third of the time."""
    tau, k = arm.measured(states, rng), 0
    while k < len(tau):
        count = round(RATE_HZ * rng.uniform(*TOUCH_S))
        push = rng.uniform(*PUSH) * rng.choice([-1.0, 0.0, 1.0], N_JOINTS)
        tau[k : k + count] += arm.size * push
        k += round(count / TOUCHED)
    return states, tau


def turned(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Turn the sign of one joint's effort."""
    return states, arm.measured(states, rng) * np.where(np.arange(N_JOINTS) == 1, -1.0, 1.0)


def stuck(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Have one joint's effort stand still."""
    tau = arm.measured(states, rng)
    tau[:, 1] = tau[0, 1]
    return states, tau


def saturated(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Have one joint's effort reach no further than its usual size."""
    tau = arm.measured(states, rng)
    tau[:, 1] = np.clip(tau[:, 1], -arm.size[1], arm.size[1])
    return states, tau


def far(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Move twice as far and as fast as the arm that was fitted."""
    q, dq, ddq = (2.0 * x for x in states)
    return (q, dq, ddq), arm.measured((q, dq, ddq), rng)


def exchanged(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Exchange the efforts of two joints."""
    return states, arm.measured(states, rng)[:, [1, 0, *range(2, N_JOINTS)]]


def resting(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Rest, held by friction of the last motion."""
    still = np.zeros_like(states[0])
    rest = still + states[0][0], still, still
    held = arm.share * arm.size * COULOMB * rng.uniform(-1.0, 1.0, N_JOINTS)
    return rest, arm.measured(rest, rng) + held


def one_sine(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Repeat one sine in all joints."""
    angle = 1.5 * np.arange(len(states[0]))[:, None] / RATE_HZ
    size = rng.uniform(0.3, 0.8, N_JOINTS)
    only = size * np.sin(angle), 1.5 * size * np.cos(angle), -(1.5**2) * size * np.sin(angle)
    return only, arm.measured(only, rng)


HOURS: dict[str, Hour] = {
    'contacts': touched,
    'a sign turned': turned,
    'a stuck effort': stuck,
    'a saturated effort': saturated,
    'efforts exchanged': exchanged,
    'rest': resting,
    'one sine': one_sine,
    'states far away': far,
}


def main(arguments: list[str]) -> int:
    """Print a line for each hour and arm."""
    parser = argparse.ArgumentParser(prog='benchmarks hostile_adaptation', description=__doc__)
    parser.add_argument('--seeds', type=int, nargs='+', default=[0, 1])
    parser.add_argument('--hours', nargs='+', choices=HOURS, default=list(HOURS))
    parser.add_argument('--seconds', type=float, default=HOUR_S, help='how long an hour is')
    options = parser.parse_args(arguments)
    for name in options.hours:
        for seed in options.seeds:
            found = measured(name, seed, options.seconds)
            print(json.dumps({'hour': name, 'seed': seed, **found}), flush=True)
    return 0


def measured(name: str, seed: int, seconds: float) -> dict[str, float]:
    """Follow an arm through an hour of a kind, and through sound motion around it."""
    rng, fitted = np.random.default_rng([seed, zlib.crc32(name.encode())]), Arm(seed, 1.0)
    first = motion(rng, FIT_S)
    data = Dataset.from_arrays(*first, fitted.measured(first, rng))
    adaptation, arm = Adaptation(fit(data)), Arm(seed, SHARE)
    before, after = motion(rng, SOUND_S), motion(rng, SOUND_S)
    states, tau = HOURS[name](arm, rng, motion(rng, seconds))
    parts = (before, states, after)
    q, dq, ddq = (np.concatenate(each) for each in zip(*parts, strict=True))
    told = np.concatenate([arm.measured(before, rng), tau, arm.measured(after, rng)])
    served, frozen, steps, beyond = followed(adaptation, (q, dq, ddq), told, after)
    clean = np.concatenate([arm.clean(each) for each in parts])
    errors = [(each - clean) ** 2 / arm.size**2 for each in (served, frozen)]
    window, n = round(JUDGED_S * RATE_HZ), len(before[0])
    early, during, late = (
        [each[rows].reshape(-1, window, N_JOINTS).mean(axis=(1, 2)) for each in errors]
        for rows in (slice(0, n), slice(n, -n), slice(-n, None))
    )
    return {
        'before': float(early[0][-1] / early[1][-1]),
        'during': float(np.mean(during[0]) / max(np.mean(during[1]), np.mean(early[1]))),
        'after': float(np.max(late[0] / late[1])),
        'at_last': float(late[0][-1] / late[1][-1]),
        'largest_step': steps,
        'beyond': beyond,
        'forgotten': adaptation.n_forgotten,
    }


def followed(
    adaptation: Adaptation, stream: States, tau: Array, probe: States
) -> tuple[Array, Array, float, int]:
    """
    Follow a stream second by second.

    Torques that are served and those of the fit, (N, n); the largest root mean square change of
    torques at probing states from one second to the next, in deviations of the noise; and the
    seconds in which what is served is beyond the trust region.
    """
    each, n, (q, dq, ddq) = round(RATE_HZ), len(tau), stream
    served, frozen = np.empty_like(tau), np.empty_like(tau)
    some = slice(None, None, max(1, len(probe[0]) // 50))
    noise, largest, beyond = adaptation.arm.noise.std_at(probe[1][some]), 0.0, 0
    before: Array | None = None
    for k in range(0, n, each):
        rows = slice(k, k + each)
        t = np.arange(k, min(k + each, n)) / RATE_HZ
        found = adaptation.update(t, q[rows], dq[rows], ddq[rows], tau[rows])
        served[rows], frozen[rows] = found.served, found.frozen
        numbers = adaptation.trusted_numbers
        now, _ = adaptation.arm.linearised(numbers, probe[0][some], probe[1][some], probe[2][some])
        if before is not None:
            largest = max(largest, float(np.sqrt(np.mean(((now - before) / noise) ** 2))))
        beyond += bool(adaptation.arm.beyond(numbers).any())
        before = now
    return served, frozen, largest, beyond
