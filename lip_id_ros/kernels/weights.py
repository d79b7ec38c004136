"""The hyperparameters of an energy kernel, as arrays for the fused loops."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.program import EnergyKernel


class Weights(NamedTuple):
    """
    Positive hyperparameters of an energy kernel.

    Attributes
    ----------
    factors : array, shape (n_factor_sets, n, 3)
        w_0, w_1, w_2 of the kinetic energy's joint factors.
    velocities : array, shape (n_factor_sets, n)
        Weights s of the velocities.
    kinetic_scales : array, shape (n,)
        lambda of every link's kinetic energy [J^2 up to the units of s].
    potential_factors : array, shape (n, 3)
        w_0, w_1, w_2 of the potential energy's joint factors.
    potential_scales : array, shape (n_potential_links,)
        [J^2].

    """

    factors: Array
    velocities: Array
    kinetic_scales: Array
    potential_factors: Array
    potential_scales: Array


def shapes(kernel: EnergyKernel) -> Weights:
    """Return an array of ones of the right shape for every hyperparameter."""
    n, sets = kernel.n_joints, kernel.n_factor_sets
    return Weights(
        factors=np.ones((sets, n, 3)),
        velocities=np.ones((sets, n)),
        kinetic_scales=np.ones(n),
        potential_factors=np.ones((n, 3)),
        potential_scales=np.ones(len(kernel.potential_links)),
    )
