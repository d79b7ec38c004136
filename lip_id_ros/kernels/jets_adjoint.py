"""
Adjoints of the steps of `lip_id_ros.kernels.jets` (reverse-mode differentiation).

Each function here is the transpose of its namesake: it takes the adjoint of a jet after the step
to the adjoint before it and adds to the adjoint of the step's own numbers (factor, velocity
weight, scale). The forward jets that it needs were kept on a tape (maths.md, section 5).
"""

from __future__ import annotations

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.features import PackedStates
from lip_id_ros.kernels.jets import column, Factor, Jet, n_columns
from lip_id_ros.numba_jit import Index, jit, LANES


@jit
def copy_jet(out: Jet, y: Jet, coupled: int, high: int) -> None:
    """Copy the part of a jet that a step reads."""
    out.s[:] = y.s
    out.r[:, :high] = y.r[:, :high]
    out.c[:, :high] = y.c[:, :high]
    out.pp[:high] = y.pp[:high]
    for i in range(high):
        for place in range(n_columns(i, coupled, high)):
            j = column(place, i, coupled)
            for m in range(LANES):
                out.pg[i, j, m] = y.pg[i, j, m]
                out.gp[i, j, m] = y.gp[i, j, m]
                out.gg[i, j, m] = y.gg[i, j, m]


@jit
def clear_factor(factor: Factor) -> None:
    """Set a factor's adjoint to zero."""
    factor.a[:] = 0.0
    factor.rate[:] = 0.0


@jit
def emit_square(adj: Jet, work: Array, w: Array, y: Jet, scale: float, high: int) -> float:
    """
    Transpose the emission of scale y^2, contracted with w[i, j].

    Returns the sum over pairs and entries of w times the emitted block, per unit of scale.
    """
    s, r, c = y.s, y.r, y.c
    k = 2.0 * scale
    total = 0.0
    work[4:8] = 0.0
    for i in range(high):
        work[0:4] = 0.0
        for j in range(high):
            for m in range(LANES):
                x = w[i, j, m]
                work[0, m] += x * c[3, j, m]
                work[1, m] += x * c[1, j, m]
                work[2, m] += x * c[2, j, m]
                work[3, m] += x * c[0, j, m]
                work[4, m] += x * y.gg[i, j, m]
                work[5, m] += x * y.pg[i, j, m]
                work[6, m] += x * y.gp[i, j, m]
            for m in range(LANES):
                x = k * w[i, j, m]
                adj.gg[i, j, m] += x * s[0, m]
                adj.pg[i, j, m] += x * s[1, m]
                adj.gp[i, j, m] += x * s[2, m]
                adj.c[0, j, m] += x * r[3, i, m]
                adj.c[1, j, m] += x * r[1, i, m]
                adj.c[2, j, m] += x * r[2, i, m]
                adj.c[3, j, m] += x * r[0, i, m]
        for m in range(LANES):
            x = w[i, i, m]
            work[7, m] += x * y.pp[i, m]
            adj.pp[i, m] += k * x * s[3, m]
            for row in range(4):
                adj.r[row, i, m] += k * work[row, m]
                total += r[row, i, m] * work[row, m]
    for m in range(LANES):
        for row in range(4):
            adj.s[row, m] += k * work[4 + row, m]
            total += s[row, m] * work[4 + row, m]
    return 2.0 * total


@jit
def multiply(
    adj: Jet, out: Factor, y: Jet, factor: Factor, b: int, coupled: int, high: int
) -> None:
    """Transpose y = a y; `y` is the jet before it, add the factor's adjoint to `out`."""
    _scalars(adj, out, y, factor, b)
    _vectors(adj.r, y.r, out, factor, 0, 1, high)
    _vectors(adj.c, y.c, out, factor, 1, 0, high)
    _couplings(adj, out, y, factor, b, high)
    _matrices(adj, out, y, factor, coupled, high)


@jit
def _scalars(adj: Jet, out: Factor, y: Jet, factor: Factor, b: int) -> None:
    a, rate = factor
    s, r, c = adj.s, adj.r, adj.c
    for m in range(LANES):
        s0, s1, s2, s3 = s[0, m], s[1, m], s[2, m], s[3, m]
        y0, y1, y2, y3 = y.s[0, m], y.s[1, m], y.s[2, m], y.s[3, m]
        r2, r3, c2, c3 = r[2, b, m], r[3, b, m], c[2, b, m], c[3, b, m]
        corner = adj.gg[b, b, m]
        out.a[0, m] += s0 * y0 + s1 * y1 + s2 * y2 + s3 * y3
        out.a[1, m] -= r2 * y0 + r3 * y2
        out.a[2, m] -= c2 * y0 + c3 * y1
        out.a[3, m] += corner * y0
        out.rate[0, m] += s1 * y0 + s3 * y2
        out.rate[1, m] += s2 * y0 + s3 * y1
        out.rate[2, m] += s3 * y0
        out.rate[3, m] -= c3 * y0
        out.rate[4, m] -= r3 * y0
        s[0, m] = (
            a[0, m] * s0 + rate[0, m] * s1 + rate[1, m] * s2 + rate[2, m] * s3
            - a[1, m] * r2 - rate[4, m] * r3 - a[2, m] * c2 - rate[3, m] * c3
            + a[3, m] * corner
        )  # fmt: skip
        s[1, m] = a[0, m] * s1 + rate[1, m] * s3 - a[2, m] * c3
        s[2, m] = a[0, m] * s2 + rate[0, m] * s3 - a[1, m] * r3
        s[3, m] = a[0, m] * s3


@jit
def _vectors(
    v: Array, y: Array, out: Factor, factor: Factor, own: int, other: int, high: int
) -> None:
    # Rows of a jet, or columns with the rates of the two sides exchanged.
    a, rate = factor
    for i in range(high):
        for m in range(LANES):
            p, dp, g, dg = y[0, i, m], y[1, i, m], y[2, i, m], y[3, i, m]
            v0, v1, v2, v3 = v[0, i, m], v[1, i, m], v[2, i, m], v[3, i, m]
            out.a[0, m] += v0 * p + v1 * dp + v2 * g + v3 * dg
            out.rate[own, m] += v2 * p + v3 * dp
            out.rate[other, m] += v1 * p + v3 * g
            out.rate[2, m] += v3 * p
            v[0, i, m] = a[0, m] * v0 + rate[other, m] * v1 + rate[own, m] * v2 + rate[2, m] * v3
            v[1, i, m] = a[0, m] * v1 + rate[own, m] * v3
            v[2, i, m] = a[0, m] * v2 + rate[other, m] * v3
            v[3, i, m] = a[0, m] * v3


@jit
def _couplings(adj: Jet, out: Factor, y: Jet, factor: Factor, b: int, high: int) -> None:
    a, rate = factor
    for i in range(high):
        for m in range(LANES):
            row_gg, row_gp = adj.gg[b, i, m], adj.gp[b, i, m]
            column_gg, column_pg = adj.gg[i, b, m], adj.pg[i, b, m]
            out.a[1, m] -= row_gg * y.c[2, i, m] + row_gp * y.c[0, i, m]
            out.rate[4, m] -= row_gg * y.c[0, i, m]
            out.a[2, m] -= column_gg * y.r[2, i, m] + column_pg * y.r[0, i, m]
            out.rate[3, m] -= column_gg * y.r[0, i, m]
            adj.c[2, i, m] -= a[1, m] * row_gg
            adj.c[0, i, m] -= rate[4, m] * row_gg + a[1, m] * row_gp
            adj.r[2, i, m] -= a[2, m] * column_gg
            adj.r[0, i, m] -= rate[3, m] * column_gg + a[2, m] * column_pg


@jit
def _matrices(adj: Jet, out: Factor, y: Jet, factor: Factor, coupled: int, high: int) -> None:
    a, rate = factor
    for i in range(high):
        for m in range(LANES):
            gg, pg, gp, pp = adj.gg[i, i, m], adj.pg[i, i, m], adj.gp[i, i, m], adj.pp[i, m]
            x = y.pp[i, m]
            out.a[0, m] += pp * x
            out.rate[0, m] += gp * x
            out.rate[1, m] += pg * x
            out.rate[2, m] += gg * x
            adj.pp[i, m] = a[0, m] * pp + rate[0, m] * gp + rate[1, m] * pg + rate[2, m] * gg
        for place in range(n_columns(i, coupled, high)):
            j = column(place, i, coupled)
            for m in range(LANES):
                gg, pg, gp = adj.gg[i, j, m], adj.pg[i, j, m], adj.gp[i, j, m]
                y_pg, y_gp = y.pg[i, j, m], y.gp[i, j, m]
                out.a[0, m] += gg * y.gg[i, j, m] + pg * y_pg + gp * y_gp
                out.rate[0, m] += gg * y_pg
                out.rate[1, m] += gg * y_gp
                adj.gg[i, j, m] = a[0, m] * gg
                adj.pg[i, j, m] = a[0, m] * pg + rate[0, m] * gg
                adj.gp[i, j, m] = a[0, m] * gp + rate[1, m] * gg


@jit
def add_velocity(adj: Jet, x: PackedStates, t: Index, z: PackedStates, u: Index, b: int) -> float:
    """Transpose y = y + weight dq_b dq'_b; return the derivative by the weight."""
    s, r, c = adj.s, adj.r, adj.c
    dq, ddq = x.dq[b, t], x.ddq[b, t]
    dz, ddz = z.dq[b, u : u + LANES], z.ddq[b, u : u + LANES]
    total = 0.0
    for m in range(LANES):
        total += (s[0, m] * dq + s[1, m] * ddq + r[0, b, m]) * dz[m]
        total += (s[2, m] * dq + s[3, m] * ddq + r[1, b, m]) * ddz[m]
        total += c[0, b, m] * dq + c[1, b, m] * ddq + adj.pp[b, m]
    return total


@jit
def load_factor(
    grad: Array, out: Factor, x: PackedStates, t: Index, z: PackedStates, u: Index, b: int
) -> None:
    """Transpose the evaluation of a factor: add the derivatives by w_0, w_1, w_2 to grad."""
    f1, f2, g1, g2 = x.f[0, b, t], x.f[1, b, t], x.g[0, b, t], x.g[1, b, t]
    dq = x.dq[b, t]
    first, second, third = 0.0, 0.0, 0.0
    for m in range(LANES):
        dz = z.dq[b, u + m]
        a0 = out.a[0, m]
        a1 = out.a[1, m] + dq * out.rate[0, m]
        a2 = out.a[2, m] + dz * out.rate[1, m]
        a3 = out.a[3, m] + dq * out.rate[3, m] + dz * (out.rate[4, m] + dq * out.rate[2, m])
        first += a0
        second += (a0 * f1 + a1 * g1) * z.f[0, b, u + m] + (a2 * f1 + a3 * g1) * z.g[0, b, u + m]
        third += (a0 * f2 + a1 * g2) * z.f[1, b, u + m] + (a2 * f2 + a3 * g2) * z.g[1, b, u + m]
    grad[0] += first
    grad[1] += second
    grad[2] += third
