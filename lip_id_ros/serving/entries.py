r"""
The posterior mean of inertia entries that share a product, contracted over training samples.

A run of `EnergyKernel.entries` has the kernel w P with w = v (v + 2 t) on velocities and P on
positions, so that its part of the posterior mean is

.. math:: \sum_t (D' w_\alpha)\, P + w_\alpha\, D'P - w\, \partial'_\alpha P

with w_alpha the derivative of w by the velocities of training sample t, summed with alpha_t
(docs/maths.md, section 6). P, D'P and d'_alpha P are the numbers that a query carries.

"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.program import EMIT, EXTEND, START
from lip_id_ros.kernels.recipe import Recipe
from lip_id_ros.numba_jit import jit, LANES
from lip_id_ros.serving.contraction import load_factor, Scratch, TrainingSide

Integers = NDArray[np.int64]


@jit
def energy_of_entries(
    tau: Array,
    how: Recipe,
    work: Scratch,
    side: TrainingSide,
    f: Array,
    g: Array,
    dq: Array,
    ddq: Array,
) -> float:
    """Return the entries' part of T; add d/dt dT/d(dq) - dT/dq to tau."""
    total = 0.0
    for k in range(len(how.entry_bounds) - 1):
        steps = how.entries[how.entry_bounds[k] : how.entry_bounds[k + 1]]
        for u in range(0, side.dq.shape[1], LANES):
            total += _forward(tau, how, steps, work, side, f, g, dq, ddq, u)
            _backward(tau, steps, work)
    return total


@jit
def _forward(
    tau: Array,
    how: Recipe,
    steps: Integers,
    work: Scratch,
    side: TrainingSide,
    f: Array,
    g: Array,
    dq: Array,
    ddq: Array,
    u: int,
) -> float:
    total = 0.0
    for k in range(steps.shape[0]):
        operation, b, link, low, middle, high = steps[k]
        if operation == START:
            work.x[:] = 0.0
            work.x[0] = 1.0
            work.dx[:] = 0.0
        elif operation == EXTEND:
            work.tape[k] = work.x
            load_factor(work.a[k], how.factors[link, b], f, g, side, u, b)
            _square(work.a[k])
            _extend(work.x, work.dx, work.a[k], dq[b])
        elif operation == EMIT:
            s, scale = how.velocities[link], how.kinetic_scales[link]
            _sum_velocities(work, s, side, dq, ddq, u, low, middle, high)
            total += _emit(work.tape[k], work.x, work.sums, scale)
            _rates_of_slopes(work.sums, work.dsums, work.x, work.dx)
            _add_momenta(tau, work.dsums, s, scale, side, u, low, middle, high)
    return total


@jit
def _square(a: Array) -> None:
    for m in range(LANES):
        a0, a1, a2, a3, a4, a5 = a[0, m], a[1, m], a[2, m], a[3, m], a[4, m], a[5, m]
        a[0, m] = a0 * a0
        a[1, m] = 2.0 * a0 * a1
        a[2, m] = 2.0 * a0 * a2
        a[3, m] = 2.0 * a0 * a3
        a[4, m] = 2.0 * (a3 * a1 + a0 * a4)
        a[5, m] = 2.0 * (a3 * a2 + a0 * a5)


@jit
def _extend(x: Array, dx: Array, a: Array, dq: float) -> None:
    for m in range(LANES):
        a0, a1, a2 = a[0, m], a[1, m], a[2, m]
        b0, b1, b2 = dq * a[3, m], dq * a[4, m], dq * a[5, m]
        p, p1, pa = x[0, m], x[1, m], x[2, m]
        d, d1, da = dx[0, m], dx[1, m], dx[2, m]
        x[0, m] = a0 * p
        x[1, m] = a0 * p1 + a1 * p
        x[2, m] = a0 * pa + a2 * p
        dx[0, m] = a0 * d + b0 * p
        dx[1, m] = a0 * d1 + b0 * p1 + a1 * d + b1 * p
        dx[2, m] = a0 * da + b0 * pa + a2 * d + b2 * p


@jit
def _sum_velocities(
    work: Scratch,
    s: Array,
    side: TrainingSide,
    dq: Array,
    ddq: Array,
    u: int,
    low: int,
    middle: int,
    high: int,
) -> None:
    # v and t, each with D' and d'_alpha
    work.sums[:] = 0.0
    work.dsums[:] = 0.0
    for j in range(low, high):
        out, dout = work.sums[0 if j < middle else 1], work.dsums[0 if j < middle else 1]
        near, far = s[j] * dq[j], s[j] * ddq[j]
        dz, ddz = side.dq[j, u : u + LANES], side.ddq[j, u : u + LANES]
        alpha = side.alpha[j, u : u + LANES]
        for m in range(LANES):
            out[0, m] += near * dz[m]
            out[1, m] += near * ddz[m]
            out[2, m] += near * alpha[m]
            dout[0, m] += far * dz[m]
            dout[1, m] += far * ddz[m]
            dout[2, m] += far * alpha[m]


@jit
def _emit(by_x: Array, x: Array, sums: Array, scale: float) -> float:
    # Sets by_x to the derivatives of the emitted energy by x, and returns the energy.
    v, t = sums[0], sums[1]
    total = 0.0
    for m in range(LANES):
        by_x[0, m] = 2.0 * scale * ((v[1, m] + t[1, m]) * v[2, m] + v[1, m] * t[2, m])
        by_x[1, m] = 2.0 * scale * ((v[0, m] + t[0, m]) * v[2, m] + v[0, m] * t[2, m])
        by_x[2, m] = -scale * v[0, m] * (v[0, m] + 2.0 * t[0, m])
        total += by_x[0, m] * x[0, m] + by_x[1, m] * x[1, m] + by_x[2, m] * x[2, m]
    return total


@jit
def _rates_of_slopes(sums: Array, dsums: Array, x: Array, dx: Array) -> None:
    # From the rates of v and t to those of the energy's slopes by them, in place. The slopes by v
    # have v + t where those by t have v.
    for m in range(LANES):
        for k in range(3):
            v, t, dv, dt = sums[0, k, m], sums[1, k, m], dsums[0, k, m], dsums[1, k, m]
            sums[0, k, m], sums[1, k, m] = v + t, v
            dsums[0, k, m], dsums[1, k, m] = dv + dt, dv
        p, p1, pa = x[0, m], x[1, m], x[2, m]
        d, d1, da = dx[0, m], dx[1, m], dx[2, m]
        for part in range(2):
            h, h1, ha = sums[part, 0, m], sums[part, 1, m], sums[part, 2, m]
            e, e1, ea = dsums[part, 0, m], dsums[part, 1, m], dsums[part, 2, m]
            dsums[part, 0, m] = 2.0 * (ea * p1 + ha * d1 - e * pa - h * da)
            dsums[part, 1, m] = 2.0 * (ea * p + ha * d)
            dsums[part, 2, m] = 2.0 * (e1 * p + h1 * d + e * p1 + h * d1)


@jit
def _add_momenta(
    tau: Array,
    rates: Array,
    s: Array,
    scale: float,
    side: TrainingSide,
    u: int,
    low: int,
    middle: int,
    high: int,
) -> None:
    # Adds d/dt dT/d(dq).
    for j in range(low, high):
        rate = rates[0 if j < middle else 1]
        dz, ddz = side.dq[j, u : u + LANES], side.ddq[j, u : u + LANES]
        alpha = side.alpha[j, u : u + LANES]
        total = 0.0
        for m in range(LANES):
            total += rate[0, m] * dz[m] + rate[1, m] * ddz[m] + rate[2, m] * alpha[m]
        tau[j] += scale * s[j] * total


@jit
def _backward(tau: Array, steps: Integers, work: Scratch) -> None:
    # Adds -dT/dq.
    adj = work.adj
    adj[:] = 0.0
    for k in range(steps.shape[0] - 1, 0, -1):
        operation, b = steps[k, 0], steps[k, 1]
        if operation == EMIT:
            for row in range(3):
                for m in range(LANES):
                    adj[row, m] += work.tape[k, row, m]
        elif operation == EXTEND:
            tau[b] -= _extend_back(adj, work.tape[k], work.a[k])


@jit
def _extend_back(adj: Array, x: Array, a: Array) -> float:
    # Returns the derivative of T by q_b; x are the numbers before the step.
    total = 0.0
    for m in range(LANES):
        a0, a1, a2 = a[0, m], a[1, m], a[2, m]
        s0, s1, s2 = a[3, m], a[4, m], a[5, m]
        p0, p1, p2 = adj[0, m], adj[1, m], adj[2, m]
        total += (p0 * s0 + p1 * s1 + p2 * s2) * x[0, m] + s0 * (p1 * x[1, m] + p2 * x[2, m])
        adj[0, m] = a0 * p0 + a1 * p1 + a2 * p2
        adj[1, m] = a0 * p1
        adj[2, m] = a0 * p2
    return total
