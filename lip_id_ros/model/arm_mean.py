"""
Posterior mean of an arm at joint states, compiled.

Links, friction and residual GP. All numbers of a query are in one array: each costs a call from
Python a quarter of a microsecond.
"""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.friction.compiled import add_friction, CompiledFriction
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.residual_gp import add_means, ResidualGP, ResidualGPMean
from lip_id_ros.model.torque_model import Parts
from lip_id_ros.numba_jit import in_threads, jit
from lip_id_ros.rigid_body.chain import LINK_PARAMETERS
from lip_id_ros.rigid_body.motions import set_frames, VECTORS
from lip_id_ros.rigid_body.regressor import potential_regressor
from lip_id_ros.rigid_body.rnea import (
    inertial_torque,
    moving_torque,
    pack_links,
    rnea,
    unpack_links,
    weight_torque,
)


class ArmMean:
    """
    Torques and energies of an arm with the posterior mean of its parameters.

    `one` is hot: no checks, nothing allocated but the result; not for several threads at once.
    """

    def __init__(
        self, arm: ArmPosterior, friction: CompiledFriction, residual_gp: ResidualGP | None
    ) -> None:
        self._n = n = len(arm.links)
        floats, self._integers = pack(arm, friction)
        out = 4 * n + 2
        self._memory = np.concatenate([np.zeros(3 * n + out + (n + 1) * VECTORS * 3), floats])
        self._floats = self._memory[-len(floats) :]
        self._q, self._dq, self._ddq = self._memory[: 3 * n].reshape(3, n)
        self._out = self._memory[3 * n : 3 * n + out]
        self._residual_gp = None if residual_gp is None else ResidualGPMean(residual_gp)

    def one(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, float, float]:
        """Return torques, gravity torques, T and V at one joint state."""
        n = self._n
        # Copied, since numba would compile anew for arrays that are read-only or not contiguous.
        self._q[:], self._dq[:], self._ddq[:] = q, dq, ddq
        if self._residual_gp is None:
            evaluate_in_memory(self._memory, self._integers)
        else:
            rest = self._residual_gp
            evaluate_all_in_memory(self._memory, self._integers, rest.floats, rest.integers)
        out = self._out.copy()
        energies = out[4 * n :].tolist()
        return out[:n], out[2 * n : 3 * n], energies[0], energies[1]

    def many(self, q: Array, dq: Array, ddq: Array) -> Parts:
        """Return the parts of the torques, and T and V, at contiguous (N, n)."""
        n, out = self._n, np.empty((len(q), 5 * self._n + 2))

        def evaluate(rows: slice) -> None:
            states = q[rows], dq[rows], ddq[rows]
            evaluate_arm_many(out[rows], *states, self._floats, self._integers)

        in_threads(evaluate, len(q))
        tau, inertial, coriolis, gravity, friction = (
            out[:, k * n : (k + 1) * n] for k in range(5)
        )
        parts = Parts(tau, inertial, coriolis, gravity, friction, out[:, -2], out[:, -1])
        if self._residual_gp is not None:
            parts.friction[:] -= parts.tau
            self._residual_gp.add_to(parts.tau, q, dq, ddq)
            parts.friction[:] += parts.tau
        return parts


class ChangingArmMean(ArmMean):
    """The same of an arm whose links and friction change."""

    def __init__(self, arm: ArmPosterior, residual_gp: ResidualGP | None) -> None:
        features = arm.friction.basis.compiled
        super().__init__(arm, features, residual_gp)
        self._chain = arm.chain
        n, factors = self._n, features.factor
        self._links = self._floats[12 * n : (12 + LINK_PARAMETERS) * n]
        self._factors, self._units = self._floats[-len(factors) :], factors
        sizes = np.diff(features.ends, prepend=0)
        self._column = self._links.size + np.repeat(np.arange(len(sizes)), sizes)
        self.use(np.concatenate([arm.links.ravel(), arm.friction.coefficients]))

    def use(self, numbers: Array) -> None:
        """Evaluate other parameters of the links, then coefficients of friction, (11 n + K,)."""
        self._links[:] = numbers[: self._links.size]
        np.multiply(self._units, numbers[self._column], out=self._factors)

    def potential_slopes(self, q: Array) -> Array:
        """Return the slopes of the potential energy by the links at one position, (11 n,)."""
        return np.asarray(potential_regressor(self._chain, q[None])[0])


def pack(arm: ArmPosterior, friction: CompiledFriction) -> tuple[Array, IntArray]:
    """Return the numbers of an arm with compiled friction, and its integers."""
    links = pack_links(arm.chain, arm.links)
    shapes = friction.width, friction.harmonic, friction.acceleration, friction.centre
    floats = (
        links,
        friction.ratios,
        friction.shares,
        friction.rise_time,
        *shapes,
        friction.factor,
    )
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
def unpack_friction(floats: Array, integers: IntArray) -> CompiledFriction:
    """Return the friction that `pack` packed."""
    n, first, m, p = integers[0], integers[1], integers[2], integers[3]
    own = floats[first:]
    ratios = own[: m * n].reshape(m, n)
    shares = own[m * n : 2 * m * n].reshape(m, n)
    rise_time = own[2 * m * n : 2 * m * n + m]
    own = own[2 * m * n + m :]
    drives = integers[4 + n :]
    primitives = drives[2 * m :]
    return CompiledFriction(
        ratios,
        shares,
        rise_time,
        drives[:m],
        drives[m : 2 * m],
        primitives[:p],
        primitives[p : 2 * p],
        primitives[2 * p : 3 * p],
        own[:p],
        own[p : 2 * p],
        own[2 * p : 3 * p],
        own[3 * p : 4 * p],
        own[4 * p : 5 * p],
        primitives[3 * p : 4 * p] != 0,
    )


@jit
def evaluate_in_memory(memory: Array, integers: IntArray) -> None:
    """
    Evaluate an arm at one joint state.

    Memory has one after the other: q, dq, ddq; the result, which is set: torques; torques of the
    kinetic energy, of gravity and of friction; T and V; working memory; `pack`'s numbers.
    """
    n = integers[0]
    q, dq, ddq = memory[:n], memory[n : 2 * n], memory[2 * n : 3 * n]
    out = memory[3 * n : 7 * n + 2]
    end = 7 * n + 2 + (n + 1) * VECTORS * 3
    work = memory[7 * n + 2 : end].reshape(n + 1, VECTORS, 3)
    floats = memory[end:]
    out[:] = 0.0
    kinetic, gravity, friction = out[n : 2 * n], out[2 * n : 3 * n], out[3 * n : 4 * n]
    links = unpack_links(floats[: integers[1]], integers[4 : 4 + n])
    out[4 * n], out[4 * n + 1] = rnea(kinetic, gravity, links, work, q, dq, ddq)
    load = out[:n]
    for i in range(n):
        load[i] = kinetic[i] + gravity[i]
    add_friction(unpack_friction(floats, integers), q, dq, ddq, load, friction)
    for i in range(n):
        out[i] = load[i] + friction[i]


@jit
def evaluate_all_in_memory(
    memory: Array, integers: IntArray, residual_gp: Array, residual_gp_integers: IntArray
) -> None:
    """Evaluate an arm and its residual GP as `evaluate_in_memory` and `add_means` do."""
    evaluate_in_memory(memory, integers)
    n = integers[0]
    q, dq = memory[:n].reshape(1, n), memory[n : 2 * n].reshape(1, n)
    ddq = memory[2 * n : 3 * n].reshape(1, n)
    tau = memory[3 * n : 4 * n].reshape(1, n)
    add_means(tau, q, dq, ddq, residual_gp, residual_gp_integers)


@jit
def evaluate_arm_many(
    out: Array, q: Array, dq: Array, ddq: Array, floats: Array, integers: IntArray
) -> None:
    """
    Evaluate an arm at N joint states.

    `out`, shape (N, 5 n + 2): torques, inertial, Coriolis, gravity and friction torques; T and V.
    """
    n = integers[0]
    work = np.empty((n + 1, VECTORS, 3))
    links = unpack_links(floats[: integers[1]], integers[4 : 4 + n])
    drives = unpack_friction(floats, integers)
    still = np.zeros(n)
    for t in range(len(out)):
        row = out[t]
        row[:] = 0.0
        load, inertial, coriolis = row[:n], row[n : 2 * n], row[2 * n : 3 * n]
        gravity, friction = row[3 * n : 4 * n], row[4 * n : 5 * n]
        set_frames(work, links.chain, q[t])
        row[5 * n] = moving_torque(coriolis, links, work, dq[t], still)
        row[5 * n + 1] = weight_torque(gravity, links, work)
        inertial_torque(inertial, links, work, ddq[t])
        for i in range(n):
            load[i] = inertial[i] + coriolis[i] + gravity[i]
        add_friction(drives, q[t], dq[t], ddq[t], load, friction)
        for i in range(n):
            load[i] += friction[i]
