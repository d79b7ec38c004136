"""One sample against `LANES` others: a recipe run forwards, and what it emits."""

from __future__ import annotations

from typing import NamedTuple

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels import entries, jets, products
from lip_id_ros.kernels.entries import Terms
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.jets import Factor, Jet
from lip_id_ros.kernels.products import Product
from lip_id_ros.kernels.program import ADD, EMIT, EXTEND, MULTIPLY, RESET, SQUARE, START
from lip_id_ros.kernels.recipe import Recipe
from lip_id_ros.numba_jit import Index, jit


class Scratch(NamedTuple):
    """
    Working memory of one thread.

    Attributes
    ----------
    y : Jet
        The running velocity kernel.
    p : Product
        The running product.
    factor : Factor
        The factor at hand.
    terms : Terms
        Of the entries at hand.

    """

    y: Jet
    p: Product
    factor: Factor
    terms: Terms


@jit
def new_scratch(n: int) -> Scratch:
    """Allocate working memory for n joints."""
    return Scratch(
        jets.new_jet(n), products.new_product(n), jets.new_factor(), entries.new_terms(n)
    )


@jit
def run_square_step(
    work: Scratch, step: IntArray, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Run one step on the velocity kernel other than the emission."""
    operation, b, k, low, high = step[0], step[1], step[2], step[4], step[5]
    if operation == RESET:
        jets.reset(work.y, low, high)
    elif operation == MULTIPLY:
        jets.load_factor(work.factor, how.factors[k, b], x, t, z, u, b)
        jets.multiply(work.y, work.factor, b, low, high)
    elif operation == ADD:
        jets.add_velocity(work.y, how.velocities[k, b], x, t, z, u, b)


@jit
def run_entry_step(
    work: Scratch, step: IntArray, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Run one step on the product of squared factors; of an emission, prepare the terms."""
    operation, b, k, low, middle, high = step
    if operation == START:
        products.start(work.p, high)
    elif operation == EXTEND:
        jets.load_factor(work.factor, how.factors[k, b], x, t, z, u, b)
        products.square(work.factor)
        products.extend(work.p, work.factor, b, low, high)
    elif operation == EMIT:
        entries.prepare(work.terms, work.p, how.velocities[k], x, t, z, u, low, middle, high)


@jit
def run_potential_step(
    work: Scratch, b: int, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Extend the product by joint b."""
    jets.load_factor(work.factor, how.potential_factors[b], x, t, z, u, b)
    products.extend(work.p, work.factor, b, 0, b)


@jit
def torque_block(
    block: Array, work: Scratch, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Set block[i, j] to the torque covariances of x at t and z at u, u + 1, ..."""
    block[:] = 0.0
    for step in how.squares:
        if step[0] == SQUARE:
            jets.emit_square(block, work.y, how.kinetic_scales[step[3]], step[4], step[5])
        else:
            run_square_step(work, step, how, x, t, z, u)
    for step in how.entries:
        run_entry_step(work, step, how, x, t, z, u)
        if step[0] == EMIT:
            s, scale = how.velocities[step[2]], how.kinetic_scales[step[2]]
            entries.emit(block, work.terms, work.p, scale, step[3], step[4], step[5])
            entries.emit_diagonal(block, work.terms, s, scale, step[3], step[4], step[5])
    products.start(work.p, how.potential_scales.shape[0])
    for b in range(how.potential_scales.shape[0]):
        run_potential_step(work, b, how, x, t, z, u)
        if how.potential_scales[b] != 0.0:
            products.emit(block, work.p, how.potential_scales[b], b + 1)


@jit
def kinetic_rows(
    row: Array, work: Scratch, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Set row[j] to the covariances of T of x at t with torque j of z at u, u + 1, ..."""
    row[:] = 0.0
    for step in how.squares:
        if step[0] == SQUARE:
            jets.emit_energy_square(row, work.y, how.kinetic_scales[step[3]], step[4], step[5])
        else:
            run_square_step(work, step, how, x, t, z, u)
    for step in how.entries:
        run_entry_step(work, step, how, x, t, z, u)
        if step[0] == EMIT:
            scale = how.kinetic_scales[step[2]]
            entries.emit_energy(row, work.terms, work.p, scale, step[3], step[5])


@jit
def potential_rows(
    row: Array, work: Scratch, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Set row[j] to the covariances of V of x at t with torque j of z at u, u + 1, ..."""
    row[:] = 0.0
    products.start(work.p, how.potential_scales.shape[0])
    for b in range(how.potential_scales.shape[0]):
        run_potential_step(work, b, how, x, t, z, u)
        if how.potential_scales[b] != 0.0:
            products.emit_energy(row, work.p, how.potential_scales[b], b + 1)
