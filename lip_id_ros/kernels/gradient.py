"""Derivatives of a contracted torque Gram matrix by every weight, in one pass over pairs."""

from __future__ import annotations

import numba
import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.pairs import new_scratch
from lip_id_ros.kernels.pairs_adjoint import (
    go_back_entries,
    go_back_potential,
    go_back_squares,
    new_tapes,
)
from lip_id_ros.kernels.program import EnergyKernel
from lip_id_ros.kernels.recipe import Recipe, recipe
from lip_id_ros.kernels.weights import Weights
from lip_id_ros.numba_jit import Index, jit, jit_parallel, LANES


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
    parts = Recipe(*how[:4], *(np.zeros((tasks, *part.shape)) for part in how[4:]))
    longest = (_longest(how.square_bounds), _longest(how.entry_bounds))
    _all_pairs(parts, contraction, how, x, *longest)
    return Weights(
        factors=parts.factors.sum(axis=0),
        velocities=parts.velocities.sum(axis=0),
        kinetic_scales=parts.kinetic_scales.sum(axis=0),
        potential_factors=parts.potential_factors.sum(axis=0),
        potential_scales=parts.potential_scales.sum(axis=0)[kernel.potential_links],
    )


def _longest(bounds: IntArray) -> int:
    return int(np.diff(bounds).max(initial=0))


@jit
def _part(parts: Recipe, k: Index) -> Recipe:
    return Recipe(
        parts.squares,
        parts.entries,
        parts.square_bounds,
        parts.entry_bounds,
        parts.factors[k],
        parts.velocities[k],
        parts.kinetic_scales[k],
        parts.potential_factors[k],
        parts.potential_scales[k],
    )


@jit_parallel
def _all_pairs(
    parts: Recipe, contraction: Array, how: Recipe, x: Samples, n_squares: int, n_entries: int
) -> None:
    n, n_samples = x.dq.shape[0], x.dq.shape[1] - LANES
    for index in numba.prange((n_samples + 1) // 2):
        work, tapes = new_scratch(n), new_tapes(n_squares, n_entries, n)
        block = np.empty((n, n, LANES))
        short = np.int64(index)
        grad = _part(parts, short)
        long = n_samples - 1 - short
        for half in range(2 if long > short else 1):
            t = long if half else short
            for u in range(0, t + 1, LANES):
                _load_contraction(block, contraction, t, u)
                for k in range(len(how.square_bounds) - 1):
                    steps = how.squares[how.square_bounds[k] : how.square_bounds[k + 1]]
                    go_back_squares(grad, block, work, tapes, steps, how, x, t, u)
                for k in range(len(how.entry_bounds) - 1):
                    steps = how.entries[how.entry_bounds[k] : how.entry_bounds[k + 1]]
                    go_back_entries(grad, block, work, tapes, steps, how, x, t, u)
                go_back_potential(grad, block, work, tapes, how, x, t, u)


@jit
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
