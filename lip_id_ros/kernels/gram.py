"""Torque Gram matrices and energy covariances of an energy kernel, fused and parallel."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels import jets, products
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.jets import Factor, Jet
from lip_id_ros.kernels.lanes import compiled, compiled_parallel, Index, LANES
from lip_id_ros.kernels.products import Product
from lip_id_ros.kernels.program import ADD, EnergyKernel, MULTIPLY, RESET, SQUARE
from lip_id_ros.kernels.weights import step_scales, Weights

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


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
    _fill_lower(out, *_arguments(kernel, weights), x)
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
    _fill_cross(out, *_arguments(kernel, weights), x, z)
    return out


def prior_blocks(kernel: EnergyKernel, weights: Weights, x: Samples) -> Array:
    """Return the prior covariance of the n torques at each sample, shape (N, n, n)."""
    n_samples = x.dq.shape[1] - LANES
    out = np.empty((n_samples, kernel.n_joints, kernel.n_joints))
    _fill_diagonal(out, *_arguments(kernel, weights), x)
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
    _fill_energy(kinetic, potential, *_arguments(kernel, weights), x, z)
    return kinetic, potential


def _arguments(
    kernel: EnergyKernel, weights: Weights
) -> tuple[Integers, Integers, Array, Weights]:
    links = kernel.potential_links.astype(np.int64)
    return kernel.kinetic, links, step_scales(kernel, weights), weights


@compiled
def run_kinetic_step(
    y: Jet, factor: Factor, step: Integers, w: Weights, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Run one step of a program other than the emission."""
    operation, b, k, low, high = step[0], step[1], step[2], step[4], step[5]
    if operation == RESET:
        jets.reset(y)
    elif operation == MULTIPLY:
        jets.load_factor(factor, w.factors[k, b], x, t, z, u, b)
        jets.multiply(y, factor, b, low, high)
    elif operation == ADD:
        jets.add_velocity(y, w.velocities[k, b], x, t, z, u, b)


@compiled
def torque_block(
    block: Array,
    y: Jet,
    p: Product,
    factor: Factor,
    steps: Integers,
    links: Integers,
    scales: Array,
    w: Weights,
    x: Samples,
    t: Index,
    z: Samples,
    u: Index,
) -> None:
    """Set block[i, j] to the torque covariances of x at t and z at u, u + 1, ..."""
    n = w.potential_factors.shape[0]
    block[:] = 0.0
    for k in range(steps.shape[0]):
        if steps[k, 0] == SQUARE:
            jets.emit_square(block, y, scales[steps[k, 3]], steps[k, 4], steps[k, 5])
        else:
            run_kinetic_step(y, factor, steps[k], w, x, t, z, u)
    products.start(p)
    emitted = 0
    for b in range(n):
        jets.load_factor(factor, w.potential_factors[b], x, t, z, u, b)
        products.extend(p, factor, b)
        if emitted < len(links) and links[emitted] == b:
            products.emit(block, p, w.potential_scales[emitted], b + 1)
            emitted += 1


@compiled
def _energy_rows(
    kinetic: Array,
    potential: Array,
    y: Jet,
    p: Product,
    factor: Factor,
    steps: Integers,
    links: Integers,
    scales: Array,
    w: Weights,
    x: Samples,
    t: Index,
    z: Samples,
    u: Index,
) -> None:
    n = w.potential_factors.shape[0]
    kinetic[:] = 0.0
    potential[:] = 0.0
    for k in range(steps.shape[0]):
        if steps[k, 0] == SQUARE:
            jets.emit_energy_square(kinetic, y, scales[steps[k, 3]], steps[k, 4], steps[k, 5])
        else:
            run_kinetic_step(y, factor, steps[k], w, x, t, z, u)
    products.start(p)
    emitted = 0
    for b in range(n):
        jets.load_factor(factor, w.potential_factors[b], x, t, z, u, b)
        products.extend(p, factor, b)
        if emitted < len(links) and links[emitted] == b:
            products.emit_energy(potential, p, w.potential_scales[emitted], b + 1)
            emitted += 1


@compiled
def _store(out: Array, block: Array, t: Index, u: Index, count: Index) -> None:
    n = block.shape[0]
    for i in range(n):
        for m in range(count):
            for j in range(n):
                out[t * n + i, (u + m) * n + j] = block[i, j, m]


@compiled_parallel
def _fill_lower(
    out: Array, steps: Integers, links: Integers, scales: Array, w: Weights, x: Samples
) -> None:
    n = w.potential_factors.shape[0]
    n_samples = x.dq.shape[1] - LANES
    # One short and one long row together, so that the threads share the triangle evenly.
    for index in numba.prange((n_samples + 1) // 2):
        y, p, factor = jets.new_jet(n), products.new_product(n), jets.new_factor()
        block = np.empty((n, n, LANES))
        short = np.int64(index)
        long = n_samples - 1 - short
        for half in range(2 if long > short else 1):
            t = long if half else short
            for u in range(0, t + 1, LANES):
                torque_block(block, y, p, factor, steps, links, scales, w, x, t, x, u)
                _store(out, block, t, u, min(LANES, t + 1 - u))


@compiled_parallel
def _fill_cross(
    out: Array,
    steps: Integers,
    links: Integers,
    scales: Array,
    w: Weights,
    x: Samples,
    z: Samples,
) -> None:
    n = w.potential_factors.shape[0]
    columns = z.dq.shape[1] - LANES
    for index in numba.prange(x.dq.shape[1] - LANES):
        y, p, factor = jets.new_jet(n), products.new_product(n), jets.new_factor()
        block = np.empty((n, n, LANES))
        t = np.int64(index)
        for u in range(0, columns, LANES):
            torque_block(block, y, p, factor, steps, links, scales, w, x, t, z, u)
            _store(out, block, t, u, min(LANES, columns - u))


@compiled_parallel
def _fill_diagonal(
    out: Array, steps: Integers, links: Integers, scales: Array, w: Weights, x: Samples
) -> None:
    n = w.potential_factors.shape[0]
    for index in numba.prange(x.dq.shape[1] - LANES):
        y, p, factor = jets.new_jet(n), products.new_product(n), jets.new_factor()
        block = np.empty((n, n, LANES))
        t = np.int64(index)
        torque_block(block, y, p, factor, steps, links, scales, w, x, t, x, t)
        out[t] = block[:, :, 0]


@compiled_parallel
def _fill_energy(
    kinetic: Array,
    potential: Array,
    steps: Integers,
    links: Integers,
    scales: Array,
    w: Weights,
    x: Samples,
    z: Samples,
) -> None:
    n = w.potential_factors.shape[0]
    columns = z.dq.shape[1] - LANES
    for index in numba.prange(x.dq.shape[1] - LANES):
        y, p, factor = jets.new_jet(n), products.new_product(n), jets.new_factor()
        a, b = np.empty((n, LANES)), np.empty((n, LANES))
        t = np.int64(index)
        for u in range(0, columns, LANES):
            _energy_rows(a, b, y, p, factor, steps, links, scales, w, x, t, z, u)
            for m in range(min(LANES, columns - u)):
                kinetic[t, (u + m) * n : (u + m + 1) * n] = a[:, m]
                potential[t, (u + m) * n : (u + m + 1) * n] = b[:, m]


@compiled_parallel
def _mirror(out: Array) -> None:
    for index in numba.prange(out.shape[0]):
        i = np.int64(index)
        for j in range(i + 1, out.shape[1]):
            out[i, j] = out[j, i]
