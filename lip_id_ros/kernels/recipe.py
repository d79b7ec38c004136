"""An energy kernel together with its weights, laid out for the compiled loops."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.program import EnergyKernel, RESET
from lip_id_ros.kernels.weights import step_scales, Weights

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


class Recipe(NamedTuple):
    """
    What to do to a running velocity kernel and a running product, and with which numbers.

    Attributes
    ----------
    steps : int array, shape (n_steps, 6)
        Columns as in `lip_id_ros.kernels.program.COLUMNS`.
    bounds : int array
        Where each run that begins with a reset starts, and the end.
    scales : array
        Signed weight of every square.
    factors, velocities, potential_factors : arrays
        As in `Weights`.
    potential_scales : array, shape (n,)
        Weight with which the product up to each joint is emitted; 0 where it is not.

    """

    steps: Integers
    bounds: Integers
    scales: Array
    factors: Array
    velocities: Array
    potential_factors: Array
    potential_scales: Array


def recipe(kernel: EnergyKernel, weights: Weights) -> Recipe:
    """Lay a kernel and its weights out."""
    resets = np.flatnonzero(kernel.kinetic[:, 0] == RESET)
    potential_scales = np.zeros(kernel.n_joints)
    potential_scales[kernel.potential_links] = weights.potential_scales
    return Recipe(
        steps=kernel.kinetic,
        bounds=np.append(resets, len(kernel.kinetic)),
        scales=step_scales(kernel, weights),
        factors=weights.factors,
        velocities=weights.velocities,
        potential_factors=weights.potential_factors,
        potential_scales=potential_scales,
    )
