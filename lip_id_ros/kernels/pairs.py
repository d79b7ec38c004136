"""Evaluate a kernel program for one sample and `LANES` others, forwards and in reverse mode."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels import jets, jets_adjoint, products
from lip_id_ros.kernels.features import PackedStates
from lip_id_ros.kernels.jets import Factor, Jet
from lip_id_ros.kernels.products import Product
from lip_id_ros.kernels.program import KernelArrays, Operation
from lip_id_ros.numba_jit import Index, jit, LANES


class Scratch(NamedTuple):
    """Working memory of one thread: running velocity kernel, running product, factor at hand."""

    y: Jet
    p: Product
    factor: Factor


class Tapes(NamedTuple):
    """
    Working memory of one thread on the way back.

    `adj` and `tape` are the adjoint of the running velocity kernel, and that kernel before every
    step; `p_adj` and `p_tape` the same of the running product; `factor_adj` is the adjoint of the
    factor at hand. `sums` has shape (8, LANES).
    """

    adj: Jet
    tape: Jet
    p_adj: Product
    p_tape: Product
    factor_adj: Factor
    sums: Array


@jit
def new_scratch(n: int) -> Scratch:
    """Allocate working memory for n joints."""
    y, p = jets.new_jets(1, n), products.new_products(1, n)
    return Scratch(jets.jet_at(y, 0), products.product_at(p, 0), jets.new_factor())


@jit
def new_tapes(n_steps: int, n: int) -> Tapes:
    """Allocate working memory for runs of at most `n_steps` steps, and n joints."""
    adjoint = new_scratch(n)
    tape, p_tape = jets.new_jets(n_steps, n), products.new_products(n, n)
    return Tapes(adjoint.y, tape, adjoint.p, p_tape, adjoint.factor, np.empty((8, LANES)))


@jit
def _run_step(
    work: Scratch,
    step: IntArray,
    k: KernelArrays,
    x: PackedStates,
    t: Index,
    z: PackedStates,
    u: Index,
) -> None:
    """Run one step on the velocity kernel other than the emission."""
    operation, b, group, coupled, high = step[0], step[1], step[2], step[4], step[5]
    if operation == Operation.RESET:
        jets.reset(work.y, high)
    elif operation == Operation.MULTIPLY:
        jets.load_factor(work.factor, k.factors[group, b], x, t, z, u, b)
        jets.multiply(work.y, work.factor, b, coupled, high)
    elif operation == Operation.ADD:
        jets.add_velocity(work.y, k.velocities[group, b], x, t, z, u, b)


@jit
def _extend_product(
    work: Scratch, b: int, k: KernelArrays, x: PackedStates, t: Index, z: PackedStates, u: Index
) -> None:
    jets.load_factor(work.factor, k.potential_factors[b], x, t, z, u, b)
    products.extend(work.p, work.factor, b)


@jit
def torque_block(
    block: Array,
    work: Scratch,
    k: KernelArrays,
    x: PackedStates,
    t: Index,
    z: PackedStates,
    u: Index,
) -> None:
    """Set block[i, j] to the torque covariances of x at t and z at u, u + 1, ..."""
    block[:] = 0.0
    for step in k.steps:
        if step[0] == Operation.SQUARE:
            jets.emit_square(block, work.y, k.kinetic_scales[step[3]], step[5])
        else:
            _run_step(work, step, k, x, t, z, u)
    products.fill(work.p, 1.0, k.potential_scales.shape[0])
    for b in range(k.potential_scales.shape[0]):
        _extend_product(work, b, k, x, t, z, u)
        if k.potential_scales[b] != 0.0:
            products.emit(block, work.p, k.potential_scales[b], b + 1)


@jit
def energy_rows(
    kinetic: Array,
    potential: Array,
    work: Scratch,
    k: KernelArrays,
    x: PackedStates,
    t: Index,
    z: PackedStates,
    u: Index,
) -> None:
    """Set row[j] to covariances of T, and of V, of x at t with torque j of z at u, u + 1, ..."""
    kinetic[:] = 0.0
    potential[:] = 0.0
    for step in k.steps:
        if step[0] == Operation.SQUARE:
            jets.emit_energy_square(kinetic, work.y, k.kinetic_scales[step[3]], step[5])
        else:
            _run_step(work, step, k, x, t, z, u)
    products.fill(work.p, 1.0, k.potential_scales.shape[0])
    for b in range(k.potential_scales.shape[0]):
        _extend_product(work, b, k, x, t, z, u)
        if k.potential_scales[b] != 0.0:
            products.emit_energy(potential, work.p, k.potential_scales[b], b + 1)


@jit
def add_kinetic_gradient(
    grad: KernelArrays,
    block: Array,
    work: Scratch,
    tapes: Tapes,
    steps: IntArray,
    k: KernelArrays,
    x: PackedStates,
    t: Index,
    u: Index,
) -> None:
    """Add the derivatives of sum(block * torque_block) by the weights of one run of steps."""
    adj, tape, out = tapes.adj, tapes.tape, tapes.factor_adj
    last = steps.shape[0] - 1  # a square, which leaves y as it is: no copy is needed
    for s in range(last):
        step = steps[s]
        if step[0] == Operation.MULTIPLY or step[0] == Operation.SQUARE:
            jets_adjoint.copy_jet(jets.jet_at(tape, s), work.y, step[4], step[5])
        if step[0] != Operation.SQUARE:
            _run_step(work, step, k, x, t, x, u)
    jets.reset(adj, steps[0, 5])
    for s in range(last, 0, -1):
        operation, b, group, link, coupled, high = steps[s]
        before = work.y if s == last else jets.jet_at(tape, s)
        if operation == Operation.SQUARE:
            grad.kinetic_scales[link] += jets_adjoint.emit_square(
                adj, tapes.sums, block, before, k.kinetic_scales[link], high
            )
        elif operation == Operation.MULTIPLY:
            jets.load_factor(work.factor, k.factors[group, b], x, t, x, u, b)
            jets_adjoint.clear_factor(out)
            jets_adjoint.multiply(adj, out, before, work.factor, b, coupled, high)
            jets_adjoint.load_factor(grad.factors[group, b], out, x, t, x, u, b)
        elif operation == Operation.ADD:
            grad.velocities[group, b] += jets_adjoint.add_velocity(adj, x, t, x, u, b)


@jit
def add_potential_gradient(
    grad: KernelArrays,
    block: Array,
    work: Scratch,
    tapes: Tapes,
    k: KernelArrays,
    x: PackedStates,
    t: Index,
    u: Index,
) -> None:
    """Add the derivatives of sum(block * torque_block) by the potential energy's weights."""
    p, factor = work.p, work.factor
    adj, tape, out = tapes.p_adj, tapes.p_tape, tapes.factor_adj
    n = k.potential_scales.shape[0]
    products.fill(p, 1.0, n)
    for b in range(n):
        products.copy_product(products.product_at(tape, b), p, n)
        _extend_product(work, b, k, x, t, x, u)
    products.fill(adj, 0.0, n)
    for b in range(n - 1, -1, -1):
        if k.potential_scales[b] != 0.0:
            after = p if b == n - 1 else products.product_at(tape, b + 1)
            grad.potential_scales[b] += products.emit_adjoint(
                adj, block, after, k.potential_scales[b], b + 1
            )
        jets.load_factor(factor, k.potential_factors[b], x, t, x, u, b)
        jets_adjoint.clear_factor(out)
        products.extend_adjoint(adj, out, products.product_at(tape, b), factor, b)
        jets_adjoint.load_factor(grad.potential_factors[b], out, x, t, x, u, b)
