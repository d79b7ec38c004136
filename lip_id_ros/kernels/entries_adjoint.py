"""The emission of `lip_id_ros.kernels.entries`, run backwards as in `jets_adjoint`."""

from __future__ import annotations

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.entries import (
    BY_DDQ,
    BY_DQ,
    D_BY_Q,
    D_BY_Z,
    D_P_W,
    D_P_W_Z,
    DDZ,
    DZ,
    P_W,
    P_W_Z,
    Terms,
)
from lip_id_ros.kernels.features import Samples
from lip_id_ros.kernels.products import Product
from lip_id_ros.numba_jit import Index, jit, LANES


@jit
def emit(
    adj: Product,
    out: Terms,
    block: Array,
    k: Terms,
    p: Product,
    scale: float,
    low: int,
    middle: int,
    high: int,
) -> None:
    """
    Go back through `entries.emit` contracted with block[i, j].

    Sets the vectors and w of `out` to their adjoints per unit of scale, and adds to those of p.

    """
    w, v, a = k.w, k.vectors, out.vectors
    a[:, low:high] = 0.0
    out.w[:] = 0.0
    for i in range(low, high):
        for j in range(low, high):
            for m in range(LANES):
                x = block[i, j, m]
                y = scale * x
                adj.h[i, j, m] += y * w[0, m]
                adj.c[j, m] -= y * v[D_P_W, i, m]
                adj.r[i, m] -= y * v[D_P_W_Z, j, m]
                out.w[0, m] += x * p.h[i, j, m]
                a[D_P_W, i, m] -= x * p.c[j, m]
                a[P_W, i, m] -= x * v[D_BY_Z, j, m]
                a[D_BY_Z, j, m] -= x * v[P_W, i, m]
                a[D_P_W_Z, j, m] -= x * p.r[i, m]
                a[D_BY_Q, i, m] -= x * v[P_W_Z, j, m]
                a[P_W_Z, j, m] -= x * v[D_BY_Q, i, m]
        for j in range(low, high if i < middle else middle):
            for m in range(LANES):
                x = block[i, j, m]
                a[DZ, i, m] += x * v[BY_DQ, j, m]
                a[DDZ, i, m] += x * v[BY_DDQ, j, m]
                a[BY_DQ, j, m] += x * v[DZ, i, m]
                a[BY_DDQ, j, m] += x * v[DDZ, i, m]


@jit
def prepare(
    by_s: Array,
    adj: Product,
    out: Terms,
    block: Array,
    k: Terms,
    s: Array,
    scale: float,
    x: Samples,
    t: Index,
    z: Samples,
    u: Index,
    low: int,
    middle: int,
    high: int,
) -> float:
    """
    Go back through `entries.prepare` and `entries.emit_diagonal`.

    Adds the derivatives by the velocity weights to by_s, and to the adjoint of p.

    Returns
    -------
    float
        The derivative by the scale.

    """
    total = _vectors(by_s, out, block, k, s, scale, x, t, z, u, low, middle, high)
    _sums(by_s, out, k, s, scale, x, t, z, u, low, middle, high)
    _rates(adj, out, scale, x, t, z, u, low, high)
    return total


@jit
def _vectors(
    by_s: Array,
    out: Terms,
    block: Array,
    k: Terms,
    s: Array,
    scale: float,
    x: Samples,
    t: Index,
    z: Samples,
    u: Index,
    low: int,
    middle: int,
    high: int,
) -> float:
    v, a, rates, by_rates = k.vectors, out.vectors, k.rates, out.rates
    by_rates[:] = 0.0
    out.slopes[:] = 0.0
    total = 0.0
    for m in range(LANES):
        total += k.w[0, m] * out.w[0, m]
    for i in range(low, high):
        part = 0 if i < middle else 1
        g, by_g = k.slopes[part], out.slopes[part]
        weight, dq, ddq = s[i], x.dq[i, t], x.ddq[i, t]
        dz, ddz = z.dq[i, u : u + LANES], z.ddq[i, u : u + LANES]
        by_weight = 0.0
        for m in range(LANES):
            e = block[i, i, m]
            diagonal = (
                g[0, m] * rates[3, m]
                + g[1, m] * rates[2, m]
                + g[2, m] * rates[1, m]
                + g[3, m] * rates[0, m]
            )
            by_near = a[DZ, i, m] + a[P_W, i, m] * g[0, m] + a[D_P_W, i, m] * g[1, m]
            by_dq = a[P_W_Z, i, m] * g[0, m] + a[D_P_W_Z, i, m] * g[2, m]
            by_dq += 2.0 * (a[BY_DQ, i, m] * rates[3, m] + a[BY_DDQ, i, m] * rates[1, m])
            by_ddq = 2.0 * (a[BY_DQ, i, m] * rates[2, m] + a[BY_DDQ, i, m] * rates[0, m])
            by_weight += e * diagonal + by_near * dz[m] + a[DDZ, i, m] * ddz[m]
            by_weight += by_dq * dq + by_ddq * ddq
            total += weight * e * diagonal
            total += a[DZ, i, m] * v[DZ, i, m] + a[DDZ, i, m] * v[DDZ, i, m]
            total += a[P_W, i, m] * v[P_W, i, m] + a[D_P_W, i, m] * v[D_P_W, i, m]
            total += a[P_W_Z, i, m] * v[P_W_Z, i, m] + a[D_P_W_Z, i, m] * v[D_P_W_Z, i, m]
            near = weight * dz[m]
            by_g[0, m] += weight * (e * rates[3, m] + a[P_W_Z, i, m] * dq) + a[P_W, i, m] * near
            by_g[1, m] += weight * e * rates[2, m] + a[D_P_W, i, m] * near
            by_g[2, m] += weight * (e * rates[1, m] + a[D_P_W_Z, i, m] * dq)
            by_g[3, m] += weight * e * rates[0, m]
            x1, x2 = 2.0 * weight * a[BY_DQ, i, m], 2.0 * weight * a[BY_DDQ, i, m]
            by_rates[0, m] += weight * e * g[3, m] + x2 * ddq
            by_rates[1, m] += weight * e * g[2, m] + x2 * dq
            by_rates[2, m] += weight * e * g[1, m] + x1 * ddq
            by_rates[3, m] += weight * e * g[0, m] + x1 * dq
        by_s[i] += scale * by_weight
    return total


@jit
def _sums(
    by_s: Array,
    out: Terms,
    k: Terms,
    s: Array,
    scale: float,
    x: Samples,
    t: Index,
    z: Samples,
    u: Index,
    low: int,
    middle: int,
    high: int,
) -> None:
    # From the slopes to the sums v and t, in place, then to the weights that these are made of.
    g, by_g = k.slopes, out.slopes
    for row in range(4):
        for m in range(LANES):
            near, far = by_g[0, row, m], by_g[1, row, m]
            by_g[0, row, m] = 2.0 * (near + far)
            by_g[1, row, m] = 2.0 * near
    for m in range(LANES):
        by_g[0, 0, m] += out.w[0, m] * g[0, 0, m]
        by_g[1, 0, m] += out.w[0, m] * g[1, 0, m]
    for j in range(low, high):
        part = by_g[0 if j < middle else 1]
        dq, ddq = x.dq[j, t], x.ddq[j, t]
        dz, ddz = z.dq[j, u : u + LANES], z.ddq[j, u : u + LANES]
        total = 0.0
        for m in range(LANES):
            total += (part[0, m] * dq + part[1, m] * ddq) * dz[m]
            total += (part[2, m] * dq + part[3, m] * ddq) * ddz[m]
        by_s[j] += scale * total


@jit
def _rates(
    adj: Product,
    out: Terms,
    scale: float,
    x: Samples,
    t: Index,
    z: Samples,
    u: Index,
    low: int,
    high: int,
) -> None:
    by_rates, a = out.rates, out.vectors
    for m in range(LANES):
        adj.p[0, m] += scale * by_rates[0, m]
    for i in range(low, high):
        dq, dz = scale * x.dq[i, t], z.dq[i, u : u + LANES]
        for m in range(LANES):
            adj.r[i, m] += dq * by_rates[1, m]
            adj.c[i, m] += scale * dz[m] * by_rates[2, m]
            # DD'P is the sum of dq_i D'd_iP.
            a[D_BY_Q, i, m] += x.dq[i, t] * by_rates[3, m]
    for i in range(low, high):
        dq = x.dq[i, t]
        for j in range(low, high):
            dz = z.dq[j, u : u + LANES]
            for m in range(LANES):
                adj.h[i, j, m] += scale * (dq * a[D_BY_Z, j, m] + dz[m] * a[D_BY_Q, i, m])
