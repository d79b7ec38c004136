"""Derivatives of a contracted torque Gram matrix by every weight, in one pass over pairs."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels import jets, jets_adjoint, products, products_adjoint
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.gram import run_kinetic_step
from lip_id_ros.kernels.jets import Factor, Jet
from lip_id_ros.kernels.lanes import compiled, compiled_parallel, Index, LANES
from lip_id_ros.kernels.products import Product
from lip_id_ros.kernels.program import ADD, EnergyKernel, MULTIPLY, RESET, SQUARE
from lip_id_ros.kernels.weights import shapes, step_scales, Weights

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


def contracted_gradient(
    kernel: EnergyKernel, weights: Weights, x: Samples, contraction: Array
) -> Weights:
    """
    Differentiate sum(W * gram(weights)) by the weights (docs/maths.md, section 5).

    Parameters
    ----------
    kernel : EnergyKernel
    weights : Weights
    x : Samples
        N packed joint states.
    contraction : array, shape (N n, N n)
        W, symmetric.

    Returns
    -------
    Weights
        The derivative by each weight (not by its logarithm).

    """
    n_samples = x.dq.shape[1] - LANES
    tasks = (n_samples + 1) // 2
    parts = Weights(*(np.zeros((tasks, *shape.shape)) for shape in shapes(kernel)))
    scales = step_scales(kernel, weights)
    scale_parts = np.zeros((tasks, len(scales)))
    steps, links = kernel.kinetic, kernel.potential_links.astype(np.int64)
    bounds = np.append(np.flatnonzero(steps[:, 0] == RESET), len(steps))
    _all_pairs(parts, scale_parts, contraction, steps, bounds, links, scales, weights, x)
    signed = kernel.kinetic_signs * scale_parts.sum(axis=0)
    kinetic_scales = np.bincount(kernel.kinetic_links, signed, kernel.n_joints)
    sums = Weights(*(part.sum(axis=0) for part in parts))
    return sums._replace(kinetic_scales=kinetic_scales)


@compiled_parallel
def _all_pairs(
    parts: Weights,
    scale_parts: Array,
    contraction: Array,
    steps: Integers,
    bounds: Integers,
    links: Integers,
    scales: Array,
    w: Weights,
    x: Samples,
) -> None:
    n = w.potential_factors.shape[0]
    n_samples = x.dq.shape[1] - LANES
    longest = 0
    for k in range(len(bounds) - 1):
        longest = max(longest, bounds[k + 1] - bounds[k])
    for index in numba.prange((n_samples + 1) // 2):
        y, adj, tape = jets.new_jet(n), jets.new_jet(n), jets_adjoint.new_tape(longest, n)
        p, p_adj = products.new_product(n), products.new_product(n)
        p_tape = products_adjoint.new_tape(n, n)
        factor, out, work = jets.new_factor(), jets.new_factor(), np.empty((8, LANES))
        block = np.empty((n, n, LANES))
        short = np.int64(index)
        grad = Weights(
            parts.factors[short],
            parts.velocities[short],
            parts.kinetic_scales[short],
            parts.potential_factors[short],
            parts.potential_scales[short],
        )
        long = n_samples - 1 - short
        for half in range(2 if long > short else 1):
            t = long if half else short
            for u in range(0, t + 1, LANES):
                _load_contraction(block, contraction, t, u)
                for k in range(len(bounds) - 1):
                    segment = steps[bounds[k] : bounds[k + 1]]
                    _kinetic_segment(
                        grad, scale_parts[short], block, y, adj, tape, factor, out, work,
                        segment, scales, w, x, t, u,
                    )  # fmt: skip
                _potential(grad, block, p, p_adj, p_tape, factor, out, links, w, x, t, u)


@compiled
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


@compiled
def _kinetic_segment(
    grad: Weights,
    scale_grad: Array,
    block: Array,
    y: Jet,
    adj: Jet,
    tape: Jet,
    factor: Factor,
    out: Factor,
    work: Array,
    steps: Integers,
    scales: Array,
    w: Weights,
    x: Samples,
    t: Index,
    u: Index,
) -> None:
    for k in range(steps.shape[0]):
        step = steps[k]
        if step[0] == MULTIPLY or step[0] == SQUARE:
            jets_adjoint.copy_jet(jets_adjoint.tape_entry(tape, k), y, step[4], step[5])
        if step[0] != SQUARE:
            run_kinetic_step(y, factor, step, w, x, t, x, u)
    jets.reset(adj)
    for k in range(steps.shape[0] - 1, 0, -1):
        operation, b, group, scale, low, high = steps[k]
        if operation == SQUARE:
            scale_grad[scale] += jets_adjoint.emit_square(
                adj, work, block, jets_adjoint.tape_entry(tape, k), scales[scale], low, high
            )
        elif operation == MULTIPLY:
            jets.load_factor(factor, w.factors[group, b], x, t, x, u, b)
            jets_adjoint.clear_factor(out)
            jets_adjoint.multiply(adj, out, jets_adjoint.tape_entry(tape, k), factor, b, low, high)
            jets_adjoint.load_factor(grad.factors[group, b], out, x, t, x, u, b)
        elif operation == ADD:
            grad.velocities[group, b] += jets_adjoint.add_velocity(adj, x, t, x, u, b)


@compiled
def _potential(
    grad: Weights,
    block: Array,
    p: Product,
    adj: Product,
    tape: Product,
    factor: Factor,
    out: Factor,
    links: Integers,
    w: Weights,
    x: Samples,
    t: Index,
    u: Index,
) -> None:
    n = w.potential_factors.shape[0]
    products.start(p)
    for b in range(n):
        products_adjoint.copy_product(products_adjoint.tape_entry(tape, b), p)
        jets.load_factor(factor, w.potential_factors[b], x, t, x, u, b)
        products.extend(p, factor, b)
    products_adjoint.clear(adj)
    emitted = len(links) - 1
    for b in range(n - 1, -1, -1):
        if emitted >= 0 and links[emitted] == b:
            after = p if b == n - 1 else products_adjoint.tape_entry(tape, b + 1)
            grad.potential_scales[emitted] += products_adjoint.emit(
                adj, block, after, w.potential_scales[emitted], b + 1
            )
            emitted -= 1
        jets.load_factor(factor, w.potential_factors[b], x, t, x, u, b)
        jets_adjoint.clear_factor(out)
        products_adjoint.extend(adj, out, products_adjoint.tape_entry(tape, b), factor, b)
        jets_adjoint.load_factor(grad.potential_factors[b], out, x, t, x, u, b)
