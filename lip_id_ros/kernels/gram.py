"""Torque Gram matrices and energy covariances of an energy kernel, fused and parallel."""

from __future__ import annotations

import numba
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.pairs import kinetic_rows, new_scratch, potential_rows, torque_block
from lip_id_ros.kernels.program import EnergyKernel
from lip_id_ros.kernels.recipe import Recipe, recipe
from lip_id_ros.kernels.weights import Weights
from lip_id_ros.numba_jit import Index, jit, jit_parallel, LANES


def gram(kernel: EnergyKernel, weights: Weights, x: Samples) -> Array:
    """
    Gram matrix of the torques at one set of samples.

    Parameters
    ----------
    kernel : EnergyKernel
    weights : Weights
    x : Samples
        N packed joint states.

    Returns
    -------
    array, shape (N n, N n)
        Symmetric; row t n + i is torque i of sample t [(N m)^2 or N^2]. Without noise and
        friction.

    """
    n_samples = x.dq.shape[1] - LANES
    out = np.empty((n_samples * kernel.n_joints,) * 2)
    _fill_lower(out, recipe(kernel, weights), x)
    _mirror(out)
    return out


def cross_gram(kernel: EnergyKernel, weights: Weights, x: Samples, z: Samples) -> Array:
    """
    Covariances between the torques at two sets of samples.

    Parameters
    ----------
    kernel : EnergyKernel
    weights : Weights
    x, z : Samples
        N and M packed joint states.

    Returns
    -------
    array, shape (N n, M n)
        As in `gram`.

    """
    n = kernel.n_joints
    out = np.empty(((x.dq.shape[1] - LANES) * n, (z.dq.shape[1] - LANES) * n))
    _fill_cross(out, recipe(kernel, weights), x, z)
    return out


def prior_blocks(kernel: EnergyKernel, weights: Weights, x: Samples) -> Array:
    """Return the prior covariance of the n torques at each sample, shape (N, n, n)."""
    n_samples = x.dq.shape[1] - LANES
    out = np.empty((n_samples, kernel.n_joints, kernel.n_joints))
    _fill_diagonal(out, recipe(kernel, weights), x)
    return out


def energy_covariance(
    kernel: EnergyKernel, weights: Weights, x: Samples, z: Samples
) -> tuple[Array, Array]:
    """
    Covariances of the energies at x with the torques at z (paper, section `sec:energy_est`).

    Returns
    -------
    kinetic, potential : arrays, shape (N, M n)
        Covariances of T and V with the torques [J N m or J N].

    """
    shape = (x.dq.shape[1] - LANES, (z.dq.shape[1] - LANES) * kernel.n_joints)
    kinetic, potential = np.empty(shape), np.empty(shape)
    _fill_energy(kinetic, potential, recipe(kernel, weights), x, z)
    return kinetic, potential


@jit
def _store(out: Array, block: Array, t: Index, u: Index, count: Index) -> None:
    n = block.shape[0]
    for i in range(n):
        for m in range(count):
            for j in range(n):
                out[t * n + i, (u + m) * n + j] = block[i, j, m]


@jit_parallel
def _fill_lower(out: Array, how: Recipe, x: Samples) -> None:
    n, n_samples = x.dq.shape[0], x.dq.shape[1] - LANES
    # One short and one long row together, so that the threads share the triangle evenly.
    for index in numba.prange((n_samples + 1) // 2):
        work, block = new_scratch(n), np.empty((n, n, LANES))
        short = np.int64(index)
        long = n_samples - 1 - short
        for half in range(2 if long > short else 1):
            t = long if half else short
            for u in range(0, t + 1, LANES):
                torque_block(block, work, how, x, t, x, u)
                _store(out, block, t, u, min(LANES, t + 1 - u))


@jit_parallel
def _fill_cross(out: Array, how: Recipe, x: Samples, z: Samples) -> None:
    n, columns = x.dq.shape[0], z.dq.shape[1] - LANES
    for index in numba.prange(x.dq.shape[1] - LANES):
        work, block = new_scratch(n), np.empty((n, n, LANES))
        t = np.int64(index)
        for u in range(0, columns, LANES):
            torque_block(block, work, how, x, t, z, u)
            _store(out, block, t, u, min(LANES, columns - u))


@jit_parallel
def _fill_diagonal(out: Array, how: Recipe, x: Samples) -> None:
    n = x.dq.shape[0]
    for index in numba.prange(x.dq.shape[1] - LANES):
        work, block = new_scratch(n), np.empty((n, n, LANES))
        t = np.int64(index)
        torque_block(block, work, how, x, t, x, t)
        out[t] = block[:, :, 0]


@jit_parallel
def _fill_energy(kinetic: Array, potential: Array, how: Recipe, x: Samples, z: Samples) -> None:
    n, columns = x.dq.shape[0], z.dq.shape[1] - LANES
    for index in numba.prange(x.dq.shape[1] - LANES):
        work, row = new_scratch(n), np.empty((n, LANES))
        t = np.int64(index)
        for u in range(0, columns, LANES):
            kinetic_rows(row, work, how, x, t, z, u)
            _store_row(kinetic[t], row, u, min(LANES, columns - u))
            potential_rows(row, work, how, x, t, z, u)
            _store_row(potential[t], row, u, min(LANES, columns - u))


@jit
def _store_row(out: Array, row: Array, u: Index, count: Index) -> None:
    n = row.shape[0]
    for m in range(count):
        for j in range(n):
            out[(u + m) * n + j] = row[j, m]


@jit_parallel
def _mirror(out: Array) -> None:
    for index in numba.prange(out.shape[0]):
        i = np.int64(index)
        for j in range(i + 1, out.shape[1]):
            out[i, j] = out[j, i]
