"""An energy kernel together with its weights, laid out for the compiled loops."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels.program import EnergyKernel, RESET, START
from lip_id_ros.kernels.weights import Weights


class Recipe(NamedTuple):
    """
    What to do to a running velocity kernel and to running products, and with which numbers.

    Attributes
    ----------
    squares, entries : int arrays, shape (n_steps, 6)
        Steps as in `lip_id_ros.kernels.program.EnergyKernel`.
    square_bounds, entry_bounds : int arrays
        Where each run that begins with a reset or a start begins, and the end.
    factors, velocities, kinetic_scales, potential_factors : arrays
        As in `Weights`.
    potential_scales : array, shape (n,)
        Weight with which the product up to each joint is emitted; 0 where it is not.

    """

    squares: IntArray
    entries: IntArray
    square_bounds: IntArray
    entry_bounds: IntArray
    factors: Array
    velocities: Array
    kinetic_scales: Array
    potential_factors: Array
    potential_scales: Array


def recipe(kernel: EnergyKernel, weights: Weights) -> Recipe:
    """Lay a kernel and its weights out."""
    potential_scales = np.zeros(kernel.n_joints)
    potential_scales[kernel.potential_links] = weights.potential_scales
    return Recipe(
        squares=kernel.squares,
        entries=kernel.entries,
        square_bounds=_bounds(kernel.squares, RESET),
        entry_bounds=_bounds(kernel.entries, START),
        factors=weights.factors,
        velocities=weights.velocities,
        kinetic_scales=weights.kinetic_scales,
        potential_factors=weights.potential_factors,
        potential_scales=potential_scales,
    )


def _bounds(steps: IntArray, first: int) -> IntArray:
    return np.append(np.flatnonzero(steps[:, 0] == first), len(steps))
