r"""
What a query and the training samples share in a contracted posterior mean.

With alpha fixed, a query carries only a few numbers per training sample t through the program:
a function y of both, D'y, and its derivatives by the training sample's momenta, positions or
velocities summed with alpha_t (docs/maths.md, section 6), with their time derivatives along the
query. The torques follow from one pass back (reverse differentiation of T by dq and q).

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.program import KernelArrays
from lip_id_ros.numba_jit import jit, LANES
from lip_id_ros.rigid_body.rnea import WORK_VECTORS


class TrainingSide(NamedTuple):
    """
    What the training samples contribute, sample last, padded with zeros to a multiple of `LANES`.

    Attributes
    ----------
    f, rate, turn : arrays, shape (2, n, P)
        Joint features, their time derivatives, and their derivatives along alpha.
    dq, ddq, alpha : arrays, shape (n, P)

    """

    f: Array
    rate: Array
    turn: Array
    dq: Array
    ddq: Array
    alpha: Array


class Scratch(NamedTuple):
    """
    Working memory of one query.

    Attributes
    ----------
    x, dx : arrays, shape (4, LANES)
        The numbers at hand and their time derivatives along the query.
    adj, dadj : arrays, shape (4, LANES)
        Adjoints of x and their time derivatives.
    tape, dtape : arrays, shape (n_steps, 4, LANES)
        x and dx before every step.
    a : array, shape (n_steps, 6, LANES)
        Of every factor: a, D'a, d'_alpha a, and their derivatives by the query's q_b.
    links : array, shape (n, WORK_VECTORS, 3)
        What `rnea` keeps for the way to the base.

    """

    x: Array
    dx: Array
    adj: Array
    dadj: Array
    tape: Array
    dtape: Array
    a: Array
    links: Array


@jit
def new_scratch(k: KernelArrays) -> Scratch:
    """Allocate working memory for a kernel."""
    n_steps = max(k.steps.shape[0], k.potential_scales.shape[0])
    return Scratch(
        np.zeros((4, LANES)),
        np.zeros((4, LANES)),
        np.zeros((4, LANES)),
        np.zeros((4, LANES)),
        np.zeros((n_steps, 4, LANES)),
        np.zeros((n_steps, 4, LANES)),
        np.zeros((n_steps, 6, LANES)),
        np.zeros((k.potential_scales.shape[0], WORK_VECTORS, 3)),
    )


@jit
def load_factor(
    a: Array, w: Array, f: Array, g: Array, side: TrainingSide, u: int, b: int
) -> None:
    """Evaluate the factor of joint b, of weights w, at a query's features f and slopes g."""
    w0 = w[0]
    wf1, wf2 = w[1] * f[0, b], w[2] * f[1, b]
    wg1, wg2 = w[1] * g[0, b], w[2] * g[1, b]
    f1, f2 = side.f[0, b, u : u + LANES], side.f[1, b, u : u + LANES]
    r1, r2 = side.rate[0, b, u : u + LANES], side.rate[1, b, u : u + LANES]
    t1, t2 = side.turn[0, b, u : u + LANES], side.turn[1, b, u : u + LANES]
    for m in range(LANES):
        a[0, m] = w0 + wf1 * f1[m] + wf2 * f2[m]
        a[1, m] = wf1 * r1[m] + wf2 * r2[m]
        a[2, m] = wf1 * t1[m] + wf2 * t2[m]
        a[3, m] = wg1 * f1[m] + wg2 * f2[m]
        a[4, m] = wg1 * r1[m] + wg2 * r2[m]
        a[5, m] = wg1 * t1[m] + wg2 * t2[m]
