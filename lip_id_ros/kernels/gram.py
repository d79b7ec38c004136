"""Torque Gram matrices of an energy kernel, energy covariances, and derivatives by the weights."""

from __future__ import annotations

import numba
import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels.features import PackedStates
from lip_id_ros.kernels.pairs import (
    add_kinetic_gradient,
    add_potential_gradient,
    energy_rows,
    new_scratch,
    new_tapes,
    torque_block,
)
from lip_id_ros.kernels.program import EnergyKernel, kernel_arrays, KernelArrays, Weights
from lip_id_ros.numba_jit import Index, jit, jit_parallel, LANES

MIRROR_ROWS = 256


def gram(kernel: EnergyKernel, weights: Weights, x: PackedStates) -> Array:
    """
    Gram matrix of the torques at N samples, without noise and friction.

    Shape (N n, N n), symmetric; row t n + i is torque i of sample t [(N m)^2 or N^2].
    """
    rows = np.arange(_count(x))
    out = np.empty((len(rows) * kernel.n_joints,) * 2)
    _fill(out, kernel_arrays(kernel, weights), x, x, np.zeros_like(rows), rows + 1)
    _mirror(out)
    return out


def cross_gram(kernel: EnergyKernel, weights: Weights, x: PackedStates, z: PackedStates) -> Array:
    """Covariances between the torques at N and M samples, shape (N n, M n), as in `gram`."""
    n, first = kernel.n_joints, np.zeros(_count(x), dtype=np.int64)
    out = np.empty((_count(x) * n, _count(z) * n))
    _fill(out, kernel_arrays(kernel, weights), x, z, first, first + _count(z))
    return out


def prior_blocks(kernel: EnergyKernel, weights: Weights, x: PackedStates) -> Array:
    """Return the prior covariance of the n torques at each sample, shape (N, n, n)."""
    n, rows = kernel.n_joints, np.arange(_count(x))
    out = np.empty((len(rows) * n, n))
    _fill(out, kernel_arrays(kernel, weights), x, x, rows, rows + 1)
    return out.reshape(-1, n, n)


def energy_covariance(
    kernel: EnergyKernel, weights: Weights, x: PackedStates, z: PackedStates
) -> tuple[Array, Array]:
    """
    Covariances of T and of V at x with the torques at z (paper, section `sec:energy_est`).

    Each of shape (N, M n) [J N m or J N].
    """
    shape = (_count(x), _count(z) * kernel.n_joints)
    kinetic, potential = np.empty(shape), np.empty(shape)
    _fill_energy(kinetic, potential, kernel_arrays(kernel, weights), x, z)
    return kinetic, potential


def contracted_gradient(
    kernel: EnergyKernel, weights: Weights, x: PackedStates, contraction: Array
) -> Weights:
    """
    Differentiate sum(W * gram(weights)) by the weights (maths.md, section 5).

    W is the symmetric contraction, shape (N n, N n). Returns the derivative by each weight, not by
    its logarithm.
    """
    tasks = (_count(x) + 1) // 2
    k = kernel_arrays(kernel, weights)
    parts = KernelArrays(*k[:2], *(np.zeros((tasks, *part.shape)) for part in k[2:]))
    _all_pairs(parts, contraction, k, x, int(np.diff(k.bounds).max(initial=0)))
    sums = Weights(*(part.sum(axis=0) for part in parts[2:]))
    return sums._replace(potential_scales=sums.potential_scales[kernel.potential_links])


def _count(x: PackedStates) -> int:
    return int(x.dq.shape[1]) - LANES


def _mirror(out: Array) -> None:
    """Copy what lies below the diagonal to above it."""
    for start in range(0, len(out), MIRROR_ROWS):
        rows = slice(start, start + MIRROR_ROWS)
        corner = np.tril(out[rows, rows])
        out[rows, start:] = out[start:, rows].T
        out[rows, rows] = corner + np.tril(corner, -1).T


@jit_parallel
def _fill(
    out: Array, k: KernelArrays, x: PackedStates, z: PackedStates, first: IntArray, stop: IntArray
) -> None:
    # Row t holds the blocks of columns first[t]..stop[t]-1. Threads take every other row from
    # either end, so that they share a triangle evenly.
    n, count = x.dq.shape[0], x.dq.shape[1] - LANES
    for index in numba.prange(count):
        work, block = new_scratch(n), np.empty((n, n, LANES))
        half = np.int64(index) // 2
        t = half if index % 2 == 0 else count - 1 - half
        for u in range(first[t], stop[t], LANES):
            torque_block(block, work, k, x, t, z, u)
            _store(out, block, t, u - first[t], min(LANES, stop[t] - u))


@jit
def _store(out: Array, block: Array, t: Index, column: Index, count: Index) -> None:
    n = block.shape[0]
    for i in range(n):
        for m in range(count):
            for j in range(n):
                out[t * n + i, (column + m) * n + j] = block[i, j, m]


@jit_parallel
def _fill_energy(
    kinetic: Array, potential: Array, k: KernelArrays, x: PackedStates, z: PackedStates
) -> None:
    n, columns = x.dq.shape[0], z.dq.shape[1] - LANES
    for index in numba.prange(x.dq.shape[1] - LANES):
        work, of_t, of_v = new_scratch(n), np.empty((n, LANES)), np.empty((n, LANES))
        t = np.int64(index)
        for u in range(0, columns, LANES):
            energy_rows(of_t, of_v, work, k, x, t, z, u)
            _store_row(kinetic[t], of_t, u, min(LANES, columns - u))
            _store_row(potential[t], of_v, u, min(LANES, columns - u))


@jit
def _store_row(out: Array, row: Array, u: Index, count: Index) -> None:
    n = row.shape[0]
    for m in range(count):
        for j in range(n):
            out[(u + m) * n + j] = row[j, m]


@jit_parallel
def _all_pairs(
    parts: KernelArrays, contraction: Array, k: KernelArrays, x: PackedStates, n_steps: int
) -> None:
    n, n_samples = x.dq.shape[0], x.dq.shape[1] - LANES
    # One short and one long row together, so that the threads share the triangle evenly.
    for index in numba.prange((n_samples + 1) // 2):
        work, tapes = new_scratch(n), new_tapes(n_steps, n)
        block = np.empty((n, n, LANES))
        short = np.int64(index)
        grad = _part(parts, short)
        long = n_samples - 1 - short
        for half in range(2 if long > short else 1):
            t = long if half else short
            for u in range(0, t + 1, LANES):
                _load_contraction(block, contraction, t, u)
                for run in range(len(k.bounds) - 1):
                    steps = k.steps[k.bounds[run] : k.bounds[run + 1]]
                    add_kinetic_gradient(grad, block, work, tapes, steps, k, x, t, u)
                add_potential_gradient(grad, block, work, tapes, k, x, t, u)


@jit
def _part(parts: KernelArrays, task: Index) -> KernelArrays:
    return KernelArrays(
        parts.steps,
        parts.bounds,
        parts.factors[task],
        parts.velocities[task],
        parts.kinetic_scales[task],
        parts.potential_factors[task],
        parts.potential_scales[task],
    )


@jit
def _load_contraction(block: Array, contraction: Array, t: Index, u: Index) -> None:
    # Pairs below the diagonal stand for their mirror images too; those beyond it do not count.
    n = block.shape[0]
    for m in range(LANES):
        weight = 2.0 if u + m < t else (1.0 if u + m == t else 0.0)
        for i in range(n):
            for j in range(n):
                if weight == 0.0:
                    block[i, j, m] = 0.0
                else:
                    block[i, j, m] = weight * contraction[t * n + i, (u + m) * n + j]
