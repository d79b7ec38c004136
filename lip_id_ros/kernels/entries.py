r"""
Inertia entries that share their product of factors, for `LANES` pairs at once.

The entries (j, k) with low <= min(j, k) < middle and max(j, k) < high have together the covariance

.. math:: w(\dot q, \dot q')\, P(q, q'), \qquad w = v\,(v + 2 t), \qquad
          v = \sum_{low}^{middle - 1} s_j \dot q_j \dot q'_j, \qquad
          t = \sum_{middle}^{high - 1} s_j \dot q_j \dot q'_j.

Velocities are in w alone and positions in P alone, so that the Euler-Lagrange operators need no
more than the slopes of w and the derivatives of P that `lip_id_ros.kernels.products` carries
(docs/maths.md, section 4). With p_i = d/d dq_i,

.. math:: G_i G'_j (wP) = w\, \partial_i \partial'_j P
          - (D p_i w)\, \partial'_j P - (p_i w)\, D \partial'_j P
          - \partial_i P\, (D' p'_j w) - D' \partial_i P\, (p'_j w)
          + \text{terms of } p_i p'_j w.

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.products import Product
from lip_id_ros.numba_jit import Index, jit, LANES

# Rows of `Terms.vectors`: what the emission multiplies with each other, joint by joint.
P_W, D_P_W, P_W_Z, D_P_W_Z, D_BY_Z, D_BY_Q, DZ, DDZ, BY_DQ, BY_DDQ = range(10)


class Terms(NamedTuple):
    """
    What a block of entries is made of; the last index of every array is the pair.

    Attributes
    ----------
    rates : array, shape (4, LANES)
        P, DP, D'P, DD'P.
    slopes : array, shape (2, 4, LANES)
        g = dw/dv and dw/dt, each followed by Dg, D'g, DD'g.
    w : array, shape (1, LANES)
    vectors : array, shape (10, n, LANES)
        p_i w, D p_i w, p'_j w, D' p'_j w, D d'_j P, D' d_i P; then s_i dq'_i, s_i ddq'_i and
        what they are multiplied with in p_i p'_j w.

    """

    rates: Array
    slopes: Array
    w: Array
    vectors: Array


@jit
def new_terms(n: int) -> Terms:
    """Allocate terms for n joints."""
    return Terms(
        np.zeros((4, LANES)),
        np.zeros((2, 4, LANES)),
        np.zeros((1, LANES)),
        np.zeros((10, n, LANES)),
    )


@jit
def prepare(
    out: Terms,
    p: Product,
    s: Array,
    x: Samples,
    t: Index,
    z: Samples,
    u: Index,
    low: int,
    middle: int,
    high: int,
) -> None:
    """Work out the terms of x at t and z at u, u + 1, ... with velocity weights s."""
    _slopes(out, s, x, t, z, u, low, middle, high)
    _rates(out, p, x, t, z, u, low, high)
    rates, slopes, _, vectors = out
    for i in range(low, high):
        g = slopes[0 if i < middle else 1]
        weight, dq, ddq = s[i], s[i] * x.dq[i, t], s[i] * x.ddq[i, t]
        dz, ddz = z.dq[i, u : u + LANES], z.ddq[i, u : u + LANES]
        for m in range(LANES):
            near, far = weight * dz[m], weight * ddz[m]
            vectors[DZ, i, m] = near
            vectors[DDZ, i, m] = far
            vectors[P_W, i, m] = near * g[0, m]
            vectors[D_P_W, i, m] = near * g[1, m]
            vectors[P_W_Z, i, m] = dq * g[0, m]
            vectors[D_P_W_Z, i, m] = dq * g[2, m]
            vectors[BY_DQ, i, m] = 2.0 * (dq * rates[3, m] + ddq * rates[2, m])
            vectors[BY_DDQ, i, m] = 2.0 * (dq * rates[1, m] + ddq * rates[0, m])


@jit
def _slopes(
    out: Terms,
    s: Array,
    x: Samples,
    t: Index,
    z: Samples,
    u: Index,
    low: int,
    middle: int,
    high: int,
) -> None:
    # First v and t with their rates, in place of the slopes by them.
    g = out.slopes
    g[:] = 0.0
    for j in range(low, high):
        part = g[0 if j < middle else 1]
        dq, ddq = s[j] * x.dq[j, t], s[j] * x.ddq[j, t]
        dz, ddz = z.dq[j, u : u + LANES], z.ddq[j, u : u + LANES]
        for m in range(LANES):
            part[0, m] += dq * dz[m]
            part[1, m] += ddq * dz[m]
            part[2, m] += dq * ddz[m]
            part[3, m] += ddq * ddz[m]
    for m in range(LANES):
        out.w[0, m] = g[0, 0, m] * (g[0, 0, m] + 2.0 * g[1, 0, m])
    for k in range(4):
        for m in range(LANES):
            near, far = g[0, k, m], g[1, k, m]
            g[0, k, m] = 2.0 * (near + far)
            g[1, k, m] = 2.0 * near


@jit
def _rates(
    out: Terms, p: Product, x: Samples, t: Index, z: Samples, u: Index, low: int, high: int
) -> None:
    rates, by_q, by_z = out.rates, out.vectors[D_BY_Q], out.vectors[D_BY_Z]
    rates[:] = 0.0
    rates[0] = p.p[0]
    by_z[low:high] = 0.0
    for i in range(low, high):
        dq, dz = x.dq[i, t], z.dq[i, u : u + LANES]
        by_q[i] = 0.0
        for j in range(low, high):
            dzj = z.dq[j, u : u + LANES]
            for m in range(LANES):
                by_z[j, m] += dq * p.h[i, j, m]
                by_q[i, m] += dzj[m] * p.h[i, j, m]
        for m in range(LANES):
            rates[1, m] += dq * p.r[i, m]
            rates[2, m] += dz[m] * p.c[i, m]
            rates[3, m] += dq * by_q[i, m]


@jit
def emit(
    block: Array, k: Terms, p: Product, scale: float, low: int, middle: int, high: int
) -> None:
    """Add scale G_i G'_j (wP) to block[i, j]."""
    w, v = k.w, k.vectors
    for i in range(low, high):
        for j in range(low, high):
            for m in range(LANES):
                block[i, j, m] += scale * (
                    w[0, m] * p.h[i, j, m]
                    - v[D_P_W, i, m] * p.c[j, m]
                    - v[P_W, i, m] * v[D_BY_Z, j, m]
                    - p.r[i, m] * v[D_P_W_Z, j, m]
                    - v[D_BY_Q, i, m] * v[P_W_Z, j, m]
                )
        for j in range(low, high if i < middle else middle):
            for m in range(LANES):
                block[i, j, m] += scale * (
                    v[DZ, i, m] * v[BY_DQ, j, m] + v[DDZ, i, m] * v[BY_DDQ, j, m]
                )


@jit
def emit_diagonal(
    block: Array, k: Terms, s: Array, scale: float, low: int, middle: int, high: int
) -> None:
    """Add what p_i p'_j w has on the diagonal only."""
    g, rates = k.slopes, k.rates
    for i in range(low, high):
        part, weight = g[0 if i < middle else 1], scale * s[i]
        for m in range(LANES):
            block[i, i, m] += weight * (
                part[0, m] * rates[3, m]
                + part[1, m] * rates[2, m]
                + part[2, m] * rates[1, m]
                + part[3, m] * rates[0, m]
            )


@jit
def emit_energy(row: Array, k: Terms, p: Product, scale: float, low: int, high: int) -> None:
    """Add scale G'_j (wP), the covariance of the kinetic energy with torque j, to row[j]."""
    w, v, rates = k.w, k.vectors, k.rates
    for j in range(low, high):
        for m in range(LANES):
            row[j, m] += scale * (
                v[D_P_W_Z, j, m] * rates[0, m] + v[P_W_Z, j, m] * rates[2, m] - w[0, m] * p.c[j, m]
            )
