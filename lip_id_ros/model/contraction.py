"""
Posterior means of the energies, contracted over the training samples (maths.md, section 6).

A query carries four numbers per training sample through the program of the kinetic energy, and
their time derivatives; torques follow from one pass back. The potential energy needs two.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels.program import KernelArrays, Operation
from lip_id_ros.numba_jit import jit, LANES


class TrainingSide(NamedTuple):
    """
    What the training samples contribute, sample last, padded with zeros to a multiple of `LANES`.

    `f`, `rate`, `turn`, shape (2, n, P): joint features, their time derivatives, and their
    derivatives along alpha. `dq`, `ddq`, `alpha`, shape (n, P).
    """

    f: Array
    rate: Array
    turn: Array
    dq: Array
    ddq: Array
    alpha: Array


class Scratch(NamedTuple):
    """Working memory of one query: its numbers, their adjoints, and what was before every step."""

    x: Array  # (4, LANES)
    dx: Array  # (4, LANES), time derivatives along the query
    adj: Array  # (4, LANES)
    dadj: Array  # (4, LANES)
    tape: Array  # (n_steps, 4, LANES), x before every step
    dtape: Array  # (n_steps, 4, LANES)
    a: Array  # (n_steps, 6, LANES): a, D'a, d'_alpha a, and by q_b


@jit
def new_scratch(k: KernelArrays) -> Scratch:
    """Allocate working memory for a kernel."""
    n_steps = max(k.steps.shape[0], k.potential_scales.shape[0])
    return Scratch(
        np.zeros((4, LANES)),
        np.zeros((4, LANES)),
        np.zeros((4, LANES)),
        np.zeros((4, LANES)),
        np.zeros((n_steps, 4, LANES)),
        np.zeros((n_steps, 4, LANES)),
        np.zeros((n_steps, 6, LANES)),
    )


@jit
def load_factor(
    a: Array, w: Array, f: Array, g: Array, side: TrainingSide, u: int, b: int
) -> None:
    """Evaluate the factor of joint b, of weights w, at a query's features f and slopes g."""
    w0 = w[0]
    wf1, wf2 = w[1] * f[0, b], w[2] * f[1, b]
    wg1, wg2 = w[1] * g[0, b], w[2] * g[1, b]
    f1, f2 = side.f[0, b, u : u + LANES], side.f[1, b, u : u + LANES]
    r1, r2 = side.rate[0, b, u : u + LANES], side.rate[1, b, u : u + LANES]
    t1, t2 = side.turn[0, b, u : u + LANES], side.turn[1, b, u : u + LANES]
    for m in range(LANES):
        a[0, m] = w0 + wf1 * f1[m] + wf2 * f2[m]
        a[1, m] = wf1 * r1[m] + wf2 * r2[m]
        a[2, m] = wf1 * t1[m] + wf2 * t2[m]
        a[3, m] = wg1 * f1[m] + wg2 * f2[m]
        a[4, m] = wg1 * r1[m] + wg2 * r2[m]
        a[5, m] = wg1 * t1[m] + wg2 * t2[m]


@jit
def _multiply(x: Array, dx: Array, a: Array, dq: float) -> None:
    for m in range(LANES):
        a0, a1, a2 = a[0, m], a[1, m], a[2, m]
        b0, b1, b2 = dq * a[3, m], dq * a[4, m], dq * a[5, m]
        y, y1, ya, yg = x[0, m], x[1, m], x[2, m], x[3, m]
        d, d1, da, dg = dx[0, m], dx[1, m], dx[2, m], dx[3, m]
        x[0, m] = a0 * y
        x[1, m] = a0 * y1 + a1 * y
        x[2, m] = a0 * ya
        x[3, m] = a0 * yg + a1 * ya - a2 * y
        dx[0, m] = a0 * d + b0 * y
        dx[1, m] = a0 * d1 + a1 * d + b0 * y1 + b1 * y
        dx[2, m] = a0 * da + b0 * ya
        dx[3, m] = a0 * dg + a1 * da - a2 * d + b0 * yg + b1 * ya - b2 * y


@jit
def _multiply_back(adj: Array, dadj: Array, x: Array, a: Array, dq: float) -> float:
    # Returns the derivative of T by q_b; x is the state before the step.
    total = 0.0
    for m in range(LANES):
        a0, a1, a2 = a[0, m], a[1, m], a[2, m]
        s0, s1, s2 = a[3, m], a[4, m], a[5, m]
        y, y1, ya, yg = x[0, m], x[1, m], x[2, m], x[3, m]
        p0, p1, p2, p3 = adj[0, m], adj[1, m], adj[2, m], adj[3, m]
        d0, d1, d2, d3 = dadj[0, m], dadj[1, m], dadj[2, m], dadj[3, m]
        total += p0 * s0 * y + p1 * (s0 * y1 + s1 * y) + p2 * s0 * ya
        total += p3 * (s0 * yg + s1 * ya - s2 * y)
        adj[0, m] = a0 * p0 + a1 * p1 - a2 * p3
        adj[1, m] = a0 * p1
        adj[2, m] = a0 * p2 + a1 * p3
        adj[3, m] = a0 * p3
        b0, b1, b2 = dq * s0, dq * s1, dq * s2
        dadj[0, m] = a0 * d0 + a1 * d1 - a2 * d3 + b0 * p0 + b1 * p1 - b2 * p3
        dadj[1, m] = a0 * d1 + b0 * p1
        dadj[2, m] = a0 * d2 + a1 * d3 + b0 * p2 + b1 * p3
        dadj[3, m] = a0 * d3 + b0 * p3
    return total


@jit
def _add(
    x: Array,
    dx: Array,
    weight: float,
    dq: float,
    ddq: float,
    side: TrainingSide,
    u: int,
    b: int,
) -> None:
    v, dv = weight * dq, weight * ddq
    dz, ddz = side.dq[b, u : u + LANES], side.ddq[b, u : u + LANES]
    alpha = side.alpha[b, u : u + LANES]
    for m in range(LANES):
        x[0, m] += v * dz[m]
        x[1, m] += v * ddz[m]
        x[2, m] += v * alpha[m]
        dx[0, m] += dv * dz[m]
        dx[1, m] += dv * ddz[m]
        dx[2, m] += dv * alpha[m]


@jit
def _add_back(dadj: Array, weight: float, side: TrainingSide, u: int, b: int) -> float:
    # Returns the time derivative of the momentum, d/dt dT/d(dq_b).
    dz, ddz = side.dq[b, u : u + LANES], side.ddq[b, u : u + LANES]
    alpha = side.alpha[b, u : u + LANES]
    total = 0.0
    for m in range(LANES):
        total += dadj[0, m] * dz[m] + dadj[1, m] * ddz[m] + dadj[2, m] * alpha[m]
    return weight * total


@jit
def _square(x: Array, scale: float) -> float:
    total = 0.0
    for m in range(LANES):
        total += x[0, m] * x[3, m] + x[1, m] * x[2, m]
    return 2.0 * scale * total


@jit
def _square_back(adj: Array, dadj: Array, x: Array, dx: Array, scale: float) -> None:
    k = 2.0 * scale
    for m in range(LANES):
        adj[0, m] += k * x[3, m]
        adj[1, m] += k * x[2, m]
        adj[2, m] += k * x[1, m]
        adj[3, m] += k * x[0, m]
        dadj[0, m] += k * dx[3, m]
        dadj[1, m] += k * dx[2, m]
        dadj[2, m] += k * dx[1, m]
        dadj[3, m] += k * dx[0, m]


@jit
def kinetic_energy(
    tau: Array,
    k: KernelArrays,
    work: Scratch,
    side: TrainingSide,
    f: Array,
    g: Array,
    dq: Array,
    ddq: Array,
) -> float:
    """Return T; add d/dt dT/d(dq) - dT/dq to tau."""
    total = 0.0
    for run in range(len(k.bounds) - 1):
        steps = k.steps[k.bounds[run] : k.bounds[run + 1]]
        for u in range(0, side.dq.shape[1], LANES):
            total += _forward(k, steps, work, side, f, g, dq, ddq, u)
            _backward(tau, k, steps, work, side, dq, u)
    return total


@jit
def _forward(
    k: KernelArrays,
    steps: IntArray,
    work: Scratch,
    side: TrainingSide,
    f: Array,
    g: Array,
    dq: Array,
    ddq: Array,
    u: int,
) -> float:
    total = 0.0
    for s in range(steps.shape[0]):
        operation, b, group, link = steps[s, 0], steps[s, 1], steps[s, 2], steps[s, 3]
        if operation == Operation.RESET:
            work.x[:] = 0.0
            work.dx[:] = 0.0
        elif operation == Operation.ADD:
            weight = k.velocities[group, b]
            _add(work.x, work.dx, weight, dq[b], ddq[b], side, u, b)
        elif operation == Operation.MULTIPLY:
            work.tape[s] = work.x
            load_factor(work.a[s], k.factors[group, b], f, g, side, u, b)
            _multiply(work.x, work.dx, work.a[s], dq[b])
        elif operation == Operation.SQUARE:
            work.tape[s] = work.x
            work.dtape[s] = work.dx
            total += _square(work.x, k.kinetic_scales[link])
    return total


@jit
def _backward(
    tau: Array,
    k: KernelArrays,
    steps: IntArray,
    work: Scratch,
    side: TrainingSide,
    dq: Array,
    u: int,
) -> None:
    work.adj[:] = 0.0
    work.dadj[:] = 0.0
    for s in range(steps.shape[0] - 1, 0, -1):
        operation, b, group, link = steps[s, 0], steps[s, 1], steps[s, 2], steps[s, 3]
        if operation == Operation.ADD:
            tau[b] += _add_back(work.dadj, k.velocities[group, b], side, u, b)
        elif operation == Operation.MULTIPLY:
            tau[b] -= _multiply_back(work.adj, work.dadj, work.tape[s], work.a[s], dq[b])
        elif operation == Operation.SQUARE:
            _square_back(work.adj, work.dadj, work.tape[s], work.dtape[s], k.kinetic_scales[link])


@jit
def potential_energy(
    tau: Array, k: KernelArrays, work: Scratch, side: TrainingSide, f: Array, g: Array
) -> float:
    """Return V and add dV/dq to tau, for one query with features f and slopes g."""
    total = 0.0
    if not k.potential_scales.any():
        return total
    for u in range(0, side.dq.shape[1], LANES):
        total += _potential_forward(k, work, side, f, g, u)
        _potential_backward(tau, k, work)
    return total


@jit
def _potential_forward(
    k: KernelArrays, work: Scratch, side: TrainingSide, f: Array, g: Array, u: int
) -> float:
    # x[0] is the product of the factors, x[1] its derivative along alpha.
    x = work.x
    x[0] = 1.0
    x[1] = 0.0
    total = 0.0
    for b in range(k.potential_scales.shape[0]):
        a = work.a[b]
        work.tape[b] = x
        load_factor(a, k.potential_factors[b], f, g, side, u, b)
        for m in range(LANES):
            x[1, m] = a[0, m] * x[1, m] + a[2, m] * x[0, m]
            x[0, m] *= a[0, m]
        total += k.potential_scales[b] * x[1].sum()
    return total


@jit
def _potential_backward(tau: Array, k: KernelArrays, work: Scratch) -> None:
    adj = work.adj
    adj[0] = 0.0
    adj[1] = 0.0
    for b in range(k.potential_scales.shape[0] - 1, -1, -1):
        adj[1] += k.potential_scales[b]
        a, x = work.a[b], work.tape[b]
        total = 0.0
        for m in range(LANES):
            total += adj[0, m] * a[3, m] * x[0, m]
            total += adj[1, m] * (a[3, m] * x[1, m] + a[5, m] * x[0, m])
            adj[0, m] = a[0, m] * adj[0, m] + a[2, m] * adj[1, m]
            adj[1, m] *= a[0, m]
        tau[b] += total
