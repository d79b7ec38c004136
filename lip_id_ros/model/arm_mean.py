"""
Posterior mean of an arm at joint states, compiled: links, friction and remainder.

A call from Python takes a quarter of a microsecond longer for every array that is passed, so that
the parameters of the arm are packed into two.

"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
import os

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.friction.compiled import add_friction, CompiledFriction
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.process_mean import FRICTION, GRAVITY, KINETIC
from lip_id_ros.model.remainder import Remainder
from lip_id_ros.numba_jit import jit
from lip_id_ros.rigid_body.rnea import pack_links, rnea, WORK_VECTORS

FEW = 5000
"""States that one thread evaluates; more are shared among all threads."""

REMAINDER_ROWS = 1000
"""States of which the covariances with the samples of the remainder are in memory at a time."""


class ArmMean:
    """
    Torques and energies of an arm with the posterior mean of its parameters.

    Construction packs the parameters; `one` is then hot: no checks, and nothing allocated but the
    result. Not for several threads at once.

    Parameters
    ----------
    arm : ArmPosterior
    remainder : Remainder or None

    """

    def __init__(self, arm: ArmPosterior, remainder: Remainder | None) -> None:
        n = len(arm.links)
        self._n = n
        self._packed = pack(arm)
        self._work = np.zeros((n, WORK_VECTORS, 3))
        self._state = np.zeros((3, n))
        self._remainder = remainder

    def one(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, float, float]:
        """Return torques, gravity torques, T and V at one joint state."""
        n, state, out = self._n, self._state, np.empty(4 * self._n + 2)
        # Copied, since numba would compile anew for arrays that are read-only or not contiguous.
        state[0], state[1], state[2] = q, dq, ddq
        evaluate_arm(out, state, *self._packed, self._work)
        tau = out[:n]
        if self._remainder is not None:
            rest = self._remainder.torque(*state[:, None])[0]
            tau = np.where(self._remainder.replaces, rest, tau + rest)
        return tau, out[2 * n : 3 * n], out[4 * n], out[4 * n + 1]

    def many(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
        """Return parts, shape (N, 3, n), and T and V, shape (N, 2), at contiguous (N, n)."""
        n, out = self._n, np.empty((len(q), 4 * self._n + 2))
        states = np.stack([q, dq, ddq], axis=1)
        if len(q) <= FEW:
            evaluate_arm_many(out, states, *self._packed)
        else:
            self._in_threads(out, states)
        parts = out[:, n : 4 * n].reshape(len(q), 3, n)
        if self._remainder is not None:
            self._add_remainder(parts, states)
        return parts, out[:, 4 * n :]

    def _in_threads(self, out: Array, states: Array) -> None:
        count = os.cpu_count() or 1
        ends = np.linspace(0, len(states), count + 1).astype(int)
        with ThreadPoolExecutor(count) as pool:
            runs = [
                pool.submit(evaluate_arm_many, out[a:b], states[a:b], *self._packed)
                for a, b in pairwise(ends)
            ]
            for run in runs:
                run.result()

    def _add_remainder(self, parts: Array, states: Array) -> None:
        remainder = self._remainder
        assert remainder is not None
        for start in range(0, len(parts), REMAINDER_ROWS):
            rows = slice(start, start + REMAINDER_ROWS)
            torque = remainder.torque(*states[rows].transpose(1, 0, 2))
            links = parts[rows, KINETIC] + parts[rows, GRAVITY]
            own = np.where(remainder.replaces, -links, parts[rows, FRICTION])
            parts[rows, FRICTION] = own + torque


def pack(arm: ArmPosterior) -> tuple[Array, IntArray]:
    """Return the numbers of an arm's mean, and its integers."""
    friction = CompiledFriction.of(arm.friction)
    links = pack_links(arm.chain, arm.links)
    floats = (links, friction.ratios, friction.width, friction.harmonic, friction.factor)
    sizes = [len(arm.links), len(links), len(friction.ends), len(friction.shape)]
    integers = (
        sizes,
        arm.chain.prismatic,
        friction.bearing,
        friction.ends,
        friction.shape,
        friction.side,
        friction.position,
        friction.loaded,
    )
    return (
        np.concatenate([np.ravel(part) for part in floats]),
        np.concatenate([np.asarray(part, dtype=np.int64) for part in integers]),
    )


@jit
def _friction(floats: Array, integers: IntArray) -> CompiledFriction:
    n, first, m, p = integers[0], integers[1], integers[2], integers[3]
    own = floats[first:]
    ratios = own[: m * n].reshape(m, n)
    own = own[m * n :]
    drives = integers[4 + n :]
    primitives = drives[2 * m :]
    return CompiledFriction(
        ratios,
        drives[:m],
        drives[m : 2 * m],
        primitives[:p],
        primitives[p : 2 * p],
        primitives[2 * p : 3 * p],
        own[:p],
        own[p : 2 * p],
        own[2 * p : 3 * p],
        primitives[3 * p : 4 * p] != 0,
    )


@jit
def evaluate_arm(out: Array, state: Array, floats: Array, integers: IntArray, work: Array) -> None:
    """
    Evaluate an arm at one joint state.

    Parameters
    ----------
    out : array, shape (4 n + 2,)
        Set to torques; torques of the kinetic energy, of gravity and of friction; T and V.
    state : array, shape (3, n)
        q, dq, ddq.
    floats, integers : arrays
        By `pack`.
    work : array, shape (n, 7, 3)
        Working memory.

    """
    n = integers[0]
    out[:] = 0.0
    kinetic, gravity, friction = out[n : 2 * n], out[2 * n : 3 * n], out[3 * n : 4 * n]
    links, prismatic = floats[: integers[1]], integers[4 : 4 + n] != 0
    q, dq, ddq = state[0], state[1], state[2]
    out[4 * n], out[4 * n + 1] = rnea(kinetic, gravity, links, prismatic, work, q, dq, ddq)
    load = out[:n]
    for i in range(n):
        load[i] = kinetic[i] + gravity[i]
    add_friction(_friction(floats, integers), q, dq, load, friction)
    for i in range(n):
        out[i] = load[i] + friction[i]


@jit
def evaluate_arm_many(out: Array, states: Array, floats: Array, integers: IntArray) -> None:
    """Evaluate an arm at N joint states, shape (N, 3, n): `evaluate_arm` for every row."""
    work = np.empty((integers[0], WORK_VECTORS, 3))
    for t in range(states.shape[0]):
        evaluate_arm(out[t], states[t], floats, integers, work)
