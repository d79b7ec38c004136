"""What follows an arm is never much worse than the fit, whatever some minutes teach."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
import zlib

import numpy as np
import pytest

from benchmarks._arms import random_arm, sines, WIDTH
from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel

N_JOINTS, RATE_HZ, REACH = 4, 20.0, 1.6
VISCOUS, COULOMB, NOISE = 0.4, 0.3, 0.01
"""In deviations of the links' torque."""

FIT_S, SOUND_S, HOSTILE_S, JUDGED_S = 60.0, 300.0, 120.0, 30.0
SHARE = 0.8
"""Of the friction that was fitted: so there is something to follow, and to lose."""

TOUCHED, TOUCH_S, PUSH = 0.3, (0.5, 3.0), (0.5, 2.0)
"""Share of the time in contact, its length, and its torque in deviations of the links' torque."""

States = tuple[Array, Array, Array]
Hostile = Callable[['Arm', np.random.Generator, States], tuple[States, Array]]
"""From sound motion to the states (N, n), and the torques that are measured."""


class Arm:
    """An arm of random links with a share of viscous and dry friction, and noise."""

    def __init__(self, share: float) -> None:
        self.links = random_arm(N_JOINTS, 0)
        states = motion(np.random.default_rng(0), 600.0)
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


def far(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Move twice as far and as fast as the arm that was fitted."""
    q, dq, ddq = (2.0 * x for x in states)
    return (q, dq, ddq), arm.measured((q, dq, ddq), rng)


def resting(arm: Arm, rng: np.random.Generator, states: States) -> tuple[States, Array]:
    """Rest, held by friction of the last motion."""
    still = np.zeros_like(states[0])
    rest = still + states[0][0], still, still
    held = arm.share * arm.size * COULOMB * rng.uniform(-1.0, 1.0, N_JOINTS)
    return rest, arm.measured(rest, rng) + held


HOSTILE: dict[str, Hostile] = {
    'contacts': touched,
    'a sign turned': turned,
    'rest': resting,
    'states far away': far,
}


@cache
def fitted() -> InverseDynamicsModel:
    rng, arm = np.random.default_rng(0), Arm(1.0)
    states = motion(rng, FIT_S)
    return fit(Dataset.from_arrays(*states, arm.measured(states, rng)))


@pytest.mark.slow
@pytest.mark.parametrize('name', HOSTILE)
def test_nothing_true_is_lost(name: str) -> None:
    """Squared errors of what is served, in those of the fit; at rest the fit has hardly any."""
    rng, arm = np.random.default_rng([0, zlib.crc32(name.encode())]), Arm(SHARE)
    before, after = motion(rng, SOUND_S), motion(rng, SOUND_S)
    states, tau = HOSTILE[name](arm, rng, motion(rng, HOSTILE_S))
    parts = (before, states, after)
    stream = tuple(np.concatenate(each) for each in zip(*parts, strict=True))
    told = np.concatenate([arm.measured(before, rng), tau, arm.measured(after, rng)])
    served, frozen = followed(stream, told)
    clean = np.concatenate([arm.clean(each) for each in parts])
    errors = [(each - clean) ** 2 / arm.size**2 for each in (served, frozen)]
    window, n = round(JUDGED_S * RATE_HZ), len(before[0])
    early, during, late = (
        [each[rows].reshape(-1, window, N_JOINTS).mean(axis=(1, 2)) for each in errors]
        for rows in (slice(0, n), slice(n, -n), slice(-n, None))
    )
    assert early[0][-1] < 0.1 * early[1][-1]
    assert np.mean(during[0]) < 1.1 * max(np.mean(during[1]), np.mean(early[1]))
    assert np.all(late[0] < 1.1 * late[1])
    assert late[0][-1] < 0.1 * late[1][-1]


def followed(stream: tuple[Array, ...], tau: Array) -> tuple[Array, Array]:
    """Follow second by second; return torques that are served and those of the fit, (N, n)."""
    adaptation, each = Adaptation(fitted()), round(RATE_HZ)
    served, frozen = np.empty_like(tau), np.empty_like(tau)
    for k in range(0, len(tau), each):
        rows = slice(k, k + each)
        q, dq, ddq = (x[rows] for x in stream)
        found = adaptation.update(np.arange(k, k + len(q)) / RATE_HZ, q, dq, ddq, tau[rows])
        served[rows], frozen[rows] = found.served, found.frozen
        assert not adaptation.arm.beyond(adaptation.trusted_numbers).any()
    return served, frozen
