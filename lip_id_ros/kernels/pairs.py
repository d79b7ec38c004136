"""One sample against `LANES` others: a recipe run forwards, and what it emits."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels import jets, products
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.jets import Factor, Jet
from lip_id_ros.kernels.lanes import compiled, Index
from lip_id_ros.kernels.products import Product
from lip_id_ros.kernels.program import ADD, MULTIPLY, RESET, SQUARE
from lip_id_ros.kernels.recipe import Recipe

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


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

    """

    y: Jet
    p: Product
    factor: Factor


@compiled
def new_scratch(n: int) -> Scratch:
    """Allocate working memory for n joints."""
    return Scratch(jets.new_jet(n), products.new_product(n), jets.new_factor())


@compiled
def run_kinetic_step(
    y: Jet, factor: Factor, step: Integers, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Run one step of a program other than the emission."""
    operation, b, k, low, high = step[0], step[1], step[2], step[4], step[5]
    if operation == RESET:
        jets.reset(y, low, high)
    elif operation == MULTIPLY:
        jets.load_factor(factor, how.factors[k, b], x, t, z, u, b)
        jets.multiply(y, factor, b, low, high)
    elif operation == ADD:
        jets.add_velocity(y, how.velocities[k, b], x, t, z, u, b)


@compiled
def run_potential_step(
    p: Product, factor: Factor, b: int, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Extend the product by joint b."""
    jets.load_factor(factor, how.potential_factors[b], x, t, z, u, b)
    products.extend(p, factor, b)


@compiled
def torque_block(
    block: Array, work: Scratch, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Set block[i, j] to the torque covariances of x at t and z at u, u + 1, ..."""
    y, p, factor = work
    block[:] = 0.0
    for k in range(how.steps.shape[0]):
        step = how.steps[k]
        if step[0] == SQUARE:
            jets.emit_square(block, y, how.scales[step[3]], step[4], step[5])
        else:
            run_kinetic_step(y, factor, step, how, x, t, z, u)
    products.start(p)
    for b in range(how.potential_scales.shape[0]):
        run_potential_step(p, factor, b, how, x, t, z, u)
        if how.potential_scales[b] != 0.0:
            products.emit(block, p, how.potential_scales[b], b + 1)


@compiled
def kinetic_rows(
    row: Array, work: Scratch, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Set row[j] to the covariances of T of x at t with torque j of z at u, u + 1, ..."""
    row[:] = 0.0
    for k in range(how.steps.shape[0]):
        step = how.steps[k]
        if step[0] == SQUARE:
            jets.emit_energy_square(row, work.y, how.scales[step[3]], step[4], step[5])
        else:
            run_kinetic_step(work.y, work.factor, step, how, x, t, z, u)


@compiled
def potential_rows(
    row: Array, work: Scratch, how: Recipe, x: Samples, t: Index, z: Samples, u: Index
) -> None:
    """Set row[j] to the covariances of V of x at t with torque j of z at u, u + 1, ..."""
    row[:] = 0.0
    products.start(work.p)
    for b in range(how.potential_scales.shape[0]):
        run_potential_step(work.p, work.factor, b, how, x, t, z, u)
        if how.potential_scales[b] != 0.0:
            products.emit_energy(row, work.p, how.potential_scales[b], b + 1)
