"""One sample against `LANES` others: a recipe run forwards on tapes, then backwards."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels import (
    entries,
    entries_adjoint,
    jets,
    jets_adjoint,
    products,
    products_adjoint,
)
from lip_id_ros.kernels.entries import Terms
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.jets import Factor, Jet
from lip_id_ros.kernels.pairs import run_entry_step, run_potential_step, run_square_step, Scratch
from lip_id_ros.kernels.products import Product
from lip_id_ros.kernels.program import ADD, EMIT, EXTEND, MULTIPLY, SQUARE
from lip_id_ros.kernels.recipe import Recipe
from lip_id_ros.numba_jit import Index, jit, LANES


class Tapes(NamedTuple):
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
    terms : Terms
        Adjoint of the entries at hand.
    sums : array, shape (8, LANES)

    """

    adj: Jet
    tape: Jet
    p_adj: Product
    p_tape: Product
    out: Factor
    terms: Terms
    sums: Array


@jit
def new_tapes(n_squares: int, n_entries: int, n: int) -> Tapes:
    """Allocate working memory for runs of so many steps, and n joints."""
    return Tapes(
        jets.new_jet(n),
        jets_adjoint.new_tape(n_squares, n),
        products.new_product(n),
        products_adjoint.new_tape(max(n_entries, n), n),
        jets.new_factor(),
        entries.new_terms(n),
        np.empty((8, LANES)),
    )


@jit
def go_back_squares(
    grad: Recipe,
    block: Array,
    work: Scratch,
    tapes: Tapes,
    steps: IntArray,
    how: Recipe,
    x: Samples,
    t: Index,
    u: Index,
) -> None:
    """Add the derivatives of sum(block * torque_block) by the weights of one run of squares."""
    factor, adj, tape, out = work.factor, tapes.adj, tapes.tape, tapes.out
    for k in range(steps.shape[0]):
        step = steps[k]
        if step[0] == MULTIPLY or step[0] == SQUARE:
            jets_adjoint.copy_jet(jets_adjoint.tape_entry(tape, k), work.y, step[4], step[5])
        if step[0] != SQUARE:
            run_square_step(work, step, how, x, t, x, u)
    jets.reset(adj, steps[0, 4], steps[0, 5])
    for k in range(steps.shape[0] - 1, 0, -1):
        operation, b, group, link, low, high = steps[k]
        before = jets_adjoint.tape_entry(tape, k)
        if operation == SQUARE:
            grad.kinetic_scales[link] += jets_adjoint.emit_square(
                adj, tapes.sums, block, before, how.kinetic_scales[link], low, high
            )
        elif operation == MULTIPLY:
            jets.load_factor(factor, how.factors[group, b], x, t, x, u, b)
            jets_adjoint.clear_factor(out)
            jets_adjoint.multiply(adj, out, before, factor, b, low, high)
            jets_adjoint.load_factor(grad.factors[group, b], out, x, t, x, u, b)
        elif operation == ADD:
            grad.velocities[group, b] += jets_adjoint.add_velocity(adj, x, t, x, u, b)


@jit
def go_back_entries(
    grad: Recipe,
    block: Array,
    work: Scratch,
    tapes: Tapes,
    steps: IntArray,
    how: Recipe,
    x: Samples,
    t: Index,
    u: Index,
) -> None:
    """Add the derivatives of sum(block * torque_block) by the weights of one run of entries."""
    adj, tape, end = tapes.p_adj, tapes.p_tape, steps[0, 5]
    for k in range(steps.shape[0]):
        products_adjoint.copy_product(products_adjoint.tape_entry(tape, k), work.p, end)
        if steps[k, 0] != EMIT:
            run_entry_step(work, steps[k], how, x, t, x, u)
    products_adjoint.clear(adj, end)
    for k in range(steps.shape[0] - 1, 0, -1):
        before = products_adjoint.tape_entry(tape, k)
        operation, b, link, low, middle, high = steps[k]
        if operation == EMIT:
            s, scale = how.velocities[link], how.kinetic_scales[link]
            bounds = (low, middle, high)
            entries.prepare(work.terms, before, s, x, t, x, u, *bounds)
            entries_adjoint.emit(adj, tapes.terms, block, work.terms, before, scale, *bounds)
            grad.kinetic_scales[link] += entries_adjoint.prepare(
                grad.velocities[link], adj, tapes.terms, block, work.terms, s, scale, x, t, x, u,
                *bounds,
            )  # fmt: skip
        elif operation == EXTEND:
            _extension(
                grad.factors[link, b], work, tapes, before, how.factors[link, b],
                b, low, high, x, t, u,
            )  # fmt: skip


@jit
def _extension(
    grad: Array,
    work: Scratch,
    tapes: Tapes,
    before: Product,
    w: Array,
    b: int,
    low: int,
    high: int,
    x: Samples,
    t: Index,
    u: Index,
) -> None:
    factor, out = work.factor, tapes.out
    jets.load_factor(factor, w, x, t, x, u, b)
    products.square(factor)
    jets_adjoint.clear_factor(out)
    products_adjoint.extend(tapes.p_adj, out, before, factor, b, low, high)
    jets.load_factor(factor, w, x, t, x, u, b)
    products_adjoint.square(out, factor)
    jets_adjoint.load_factor(grad, out, x, t, x, u, b)


@jit
def go_back_potential(
    grad: Recipe,
    block: Array,
    work: Scratch,
    tapes: Tapes,
    how: Recipe,
    x: Samples,
    t: Index,
    u: Index,
) -> None:
    """Add the derivatives of sum(block * torque_block) by the potential energy's weights."""
    p, factor = work.p, work.factor
    adj, tape, out = tapes.p_adj, tapes.p_tape, tapes.out
    n = how.potential_scales.shape[0]
    products.start(p, n)
    for b in range(n):
        products_adjoint.copy_product(products_adjoint.tape_entry(tape, b), p, n)
        run_potential_step(work, b, how, x, t, x, u)
    products_adjoint.clear(adj, n)
    for b in range(n - 1, -1, -1):
        if how.potential_scales[b] != 0.0:
            after = p if b == n - 1 else products_adjoint.tape_entry(tape, b + 1)
            grad.potential_scales[b] += products_adjoint.emit(
                adj, block, after, how.potential_scales[b], b + 1
            )
        jets.load_factor(factor, how.potential_factors[b], x, t, x, u, b)
        jets_adjoint.clear_factor(out)
        products_adjoint.extend(adj, out, products_adjoint.tape_entry(tape, b), factor, b, 0, b)
        jets_adjoint.load_factor(grad.potential_factors[b], out, x, t, x, u, b)
