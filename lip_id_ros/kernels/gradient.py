"""Derivatives of a contracted torque Gram matrix by every weight, in one pass over pairs."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels import jets, jets_adjoint, products, products_adjoint
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.jets import Factor, Jet
from lip_id_ros.kernels.lanes import compiled, compiled_parallel, Index, LANES
from lip_id_ros.kernels.pairs import new_scratch, run_kinetic_step, run_potential_step, Scratch
from lip_id_ros.kernels.products import Product
from lip_id_ros.kernels.program import ADD, EnergyKernel, MULTIPLY, SQUARE
from lip_id_ros.kernels.recipe import Recipe, recipe
from lip_id_ros.kernels.weights import Weights

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
    tasks = (x.dq.shape[1] - LANES + 1) // 2
    how = recipe(kernel, weights)
    parts = Recipe(how.steps, how.bounds, *(np.zeros((tasks, *part.shape)) for part in how[2:]))
    _all_pairs(parts, contraction, how, x)
    signed = kernel.kinetic_signs * parts.scales.sum(axis=0)
    return Weights(
        factors=parts.factors.sum(axis=0),
        velocities=parts.velocities.sum(axis=0),
        kinetic_scales=np.bincount(kernel.kinetic_links, signed, kernel.n_joints),
        potential_factors=parts.potential_factors.sum(axis=0),
        potential_scales=parts.potential_scales.sum(axis=0)[kernel.potential_links],
    )


class _Tapes(NamedTuple):
    """
    Working memory of one thread.

    Attributes
    ----------
    adj, tape : Jet
        Adjoint of the running velocity kernel, and that kernel before every step.
    p_adj, p_tape : Product
        The same of the running product.
    out : Factor
        Adjoint of the factor at hand.
    sums : array, shape (8, LANES)

    """

    adj: Jet
    tape: Jet
    p_adj: Product
    p_tape: Product
    out: Factor
    sums: Array


@compiled
def _new_tapes(length: int, n: int) -> _Tapes:
    return _Tapes(
        jets.new_jet(n),
        jets_adjoint.new_tape(length, n),
        products.new_product(n),
        products_adjoint.new_tape(n, n),
        jets.new_factor(),
        np.empty((8, LANES)),
    )


@compiled
def _part(parts: Recipe, k: Index) -> Recipe:
    return Recipe(
        parts.steps,
        parts.bounds,
        parts.scales[k],
        parts.factors[k],
        parts.velocities[k],
        parts.potential_factors[k],
        parts.potential_scales[k],
    )


@compiled_parallel
def _all_pairs(parts: Recipe, contraction: Array, how: Recipe, x: Samples) -> None:
    n, n_samples = x.dq.shape[0], x.dq.shape[1] - LANES
    longest = np.max(np.diff(how.bounds))
    for index in numba.prange((n_samples + 1) // 2):
        work, tapes = new_scratch(n), _new_tapes(longest, n)
        block = np.empty((n, n, LANES))
        short = np.int64(index)
        grad = _part(parts, short)
        long = n_samples - 1 - short
        for half in range(2 if long > short else 1):
            t = long if half else short
            for u in range(0, t + 1, LANES):
                _load_contraction(block, contraction, t, u)
                for k in range(len(how.bounds) - 1):
                    steps = how.steps[how.bounds[k] : how.bounds[k + 1]]
                    _kinetic_segment(grad, block, work, tapes, steps, how, x, t, u)
                _potential(grad, block, work, tapes, how, x, t, u)


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
    grad: Recipe,
    block: Array,
    work: Scratch,
    tapes: _Tapes,
    steps: Integers,
    how: Recipe,
    x: Samples,
    t: Index,
    u: Index,
) -> None:
    y, _, factor = work
    adj, tape, out = tapes.adj, tapes.tape, tapes.out
    for k in range(steps.shape[0]):
        step = steps[k]
        if step[0] == MULTIPLY or step[0] == SQUARE:
            jets_adjoint.copy_jet(jets_adjoint.tape_entry(tape, k), y, step[4], step[5])
        if step[0] != SQUARE:
            run_kinetic_step(y, factor, step, how, x, t, x, u)
    jets.reset(adj, steps[0, 4], steps[0, 5])
    for k in range(steps.shape[0] - 1, 0, -1):
        operation, b, group, scale, low, high = steps[k]
        before = jets_adjoint.tape_entry(tape, k)
        if operation == SQUARE:
            grad.scales[scale] += jets_adjoint.emit_square(
                adj, tapes.sums, block, before, how.scales[scale], low, high
            )
        elif operation == MULTIPLY:
            jets.load_factor(factor, how.factors[group, b], x, t, x, u, b)
            jets_adjoint.clear_factor(out)
            jets_adjoint.multiply(adj, out, before, factor, b, low, high)
            jets_adjoint.load_factor(grad.factors[group, b], out, x, t, x, u, b)
        elif operation == ADD:
            grad.velocities[group, b] += jets_adjoint.add_velocity(adj, x, t, x, u, b)


@compiled
def _potential(
    grad: Recipe,
    block: Array,
    work: Scratch,
    tapes: _Tapes,
    how: Recipe,
    x: Samples,
    t: Index,
    u: Index,
) -> None:
    _, p, factor = work
    adj, tape, out = tapes.p_adj, tapes.p_tape, tapes.out
    n = how.potential_scales.shape[0]
    products.start(p)
    for b in range(n):
        products_adjoint.copy_product(products_adjoint.tape_entry(tape, b), p)
        run_potential_step(p, factor, b, how, x, t, x, u)
    products_adjoint.clear(adj)
    for b in range(n - 1, -1, -1):
        if how.potential_scales[b] != 0.0:
            after = p if b == n - 1 else products_adjoint.tape_entry(tape, b + 1)
            grad.potential_scales[b] += products_adjoint.emit(
                adj, block, after, how.potential_scales[b], b + 1
            )
        jets.load_factor(factor, how.potential_factors[b], x, t, x, u, b)
        jets_adjoint.clear_factor(out)
        products_adjoint.extend(adj, out, products_adjoint.tape_entry(tape, b), factor, b)
        jets_adjoint.load_factor(grad.potential_factors[b], out, x, t, x, u, b)
