r"""
Jets: y(x, x') and its derivatives for the Euler-Lagrange operators, for `LANES` pairs at once.

The left operators are 1, D = d/dt along (dq, ddq), the momenta \partial/\partial dq_i and the
Euler-Lagrange operators G_i = D \partial/\partial dq_i - \partial/\partial q_i; the right ones are
the same on x'. A jet holds every product of a left and a right operator applied to y. Because y is
linear in dq and in dq', multiplication by a factor a(q_b, q'_b) and addition of s dq_b dq'_b map
jets to jets in closed form, with no division: the product rule is

.. math:: D(ay) = a Dy + \dot a\, y, \qquad  G_i(ay) = a\, G_i y + \dot a\, \partial_{\dot q_i} y
          - [i = b]\, \partial_q a\; y.

Derivation and proof: maths.md, section 4. The tests compare with nested automatic
differentiation.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.features import PackedStates
from lip_id_ros.numba_jit import Index, jit, LANES


class Jet(NamedTuple):
    """
    Operators applied to y; the last index of every array is the pair.

    `s`, shape (4, LANES): y, Dy, D'y, DD'y.
    `r`, shape (4, n, LANES): rows: p_i y, D' p_i y, G_i y, D' G_i y with the momentum operator p_i
    = d/d dq_i.
    `c`, shape (4, n, LANES): columns: p'_j y, D p'_j y, G'_j y, D G'_j y.
    `pp`, shape (n, LANES): p_i p'_i y (zero off the diagonal).
    `pg`, `gp`, `gg`, shape (n, n, LANES): p_i G'_j y, G_i p'_j y, G_i G'_j y.
    """

    s: Array
    r: Array
    c: Array
    pp: Array
    pg: Array
    gp: Array
    gg: Array


class Factor(NamedTuple):
    """A joint factor a(q_b, q'_b) for `LANES` pairs."""

    a: Array  # (4, LANES): a, da/dq, da/dq', d2a/dq dq'
    rate: Array  # (5, LANES): da, D'a, DD'a, D(da/dq'), D'(da/dq)


@jit
def new_jets(count: int, n: int) -> Jet:
    """Allocate jets for n joints, stacked along a new first index."""
    return Jet(
        np.zeros((count, 4, LANES)),
        np.zeros((count, 4, n, LANES)),
        np.zeros((count, 4, n, LANES)),
        np.zeros((count, n, LANES)),
        np.zeros((count, n, n, LANES)),
        np.zeros((count, n, n, LANES)),
        np.zeros((count, n, n, LANES)),
    )


@jit
def jet_at(y: Jet, k: int) -> Jet:
    """View one of several jets."""
    return Jet(y.s[k], y.r[k], y.c[k], y.pp[k], y.pg[k], y.gp[k], y.gg[k])


@jit
def new_factor() -> Factor:
    """Allocate a factor."""
    return Factor(np.zeros((4, LANES)), np.zeros((5, LANES)))


@jit
def reset(y: Jet, high: int) -> None:
    """Set y = 0 for a y that will depend on joints 0..high-1 only; the rest is never read."""
    y.s[:] = 0.0
    y.r[:, :high] = 0.0
    y.c[:, :high] = 0.0
    y.pp[:high] = 0.0
    y.pg[:high, :high] = 0.0
    y.gp[:high, :high] = 0.0
    y.gg[:high, :high] = 0.0


@jit
def load_factor(
    out: Factor, w: Array, x: PackedStates, t: Index, z: PackedStates, u: Index, b: int
) -> None:
    """Evaluate the factor of joint b, of weights w, between x at t and z at u, u + 1, ..."""
    a, rate = out
    w0, w1, w2 = w[0], w[1], w[2]
    wf1, wf2 = w1 * x.f[0, b, t], w2 * x.f[1, b, t]
    wg1, wg2 = w1 * x.g[0, b, t], w2 * x.g[1, b, t]
    dq = x.dq[b, t]
    f1, f2 = z.f[0, b, u : u + LANES], z.f[1, b, u : u + LANES]
    g1, g2 = z.g[0, b, u : u + LANES], z.g[1, b, u : u + LANES]
    dz = z.dq[b, u : u + LANES]
    for m in range(LANES):
        a[0, m] = w0 + wf1 * f1[m] + wf2 * f2[m]
        a[1, m] = wg1 * f1[m] + wg2 * f2[m]
        a[2, m] = wf1 * g1[m] + wf2 * g2[m]
        a[3, m] = wg1 * g1[m] + wg2 * g2[m]
        rate[0, m] = dq * a[1, m]
        rate[1, m] = dz[m] * a[2, m]
        rate[3, m] = dq * a[3, m]
        rate[4, m] = dz[m] * a[3, m]
        rate[2, m] = dq * rate[4, m]


@jit
def multiply(y: Jet, factor: Factor, b: int, coupled: int, high: int) -> None:
    """Set y = a(q_b, q'_b) y; before, y depends on joints 0..high-1, afterwards on b too."""
    _multiply_matrices(y, factor, coupled, high)
    _couple_joint(y, factor, b, high)
    _multiply_vectors(y.r, factor, 0, 1, high)
    _multiply_vectors(y.c, factor, 1, 0, high)
    _multiply_scalars(y, factor, b)


@jit
def n_columns(i: int, coupled: int, high: int) -> int:
    """Return in how many columns row i of a jet's matrices may differ from zero."""
    return high if i < coupled else coupled + 1


@jit
def column(place: int, i: int, coupled: int) -> int:
    """Return one of these columns: the coupled ones, then the diagonal."""
    return i if min(i, place) >= coupled else place


@jit
def _multiply_matrices(y: Jet, factor: Factor, coupled: int, high: int) -> None:
    a, rate = factor
    for i in range(high):
        for place in range(n_columns(i, coupled, high)):
            j = column(place, i, coupled)
            for m in range(LANES):
                pg, gp = y.pg[i, j, m], y.gp[i, j, m]
                y.gg[i, j, m] = a[0, m] * y.gg[i, j, m] + rate[0, m] * pg + rate[1, m] * gp
                y.pg[i, j, m] = a[0, m] * pg
                y.gp[i, j, m] = a[0, m] * gp
        for m in range(LANES):
            pp = y.pp[i, m]
            y.gg[i, i, m] += rate[2, m] * pp
            y.pg[i, i, m] += rate[1, m] * pp
            y.gp[i, i, m] += rate[0, m] * pp
            y.pp[i, m] = a[0, m] * pp


@jit
def _couple_joint(y: Jet, factor: Factor, b: int, high: int) -> None:
    # Row b and column b: the operators of joint b that differentiate the factor itself.
    a, rate = factor
    for i in range(high):
        for m in range(LANES):
            y.gg[b, i, m] -= a[1, m] * y.c[2, i, m] + rate[4, m] * y.c[0, i, m]
            y.gp[b, i, m] -= a[1, m] * y.c[0, i, m]
            y.gg[i, b, m] -= a[2, m] * y.r[2, i, m] + rate[3, m] * y.r[0, i, m]
            y.pg[i, b, m] -= a[2, m] * y.r[0, i, m]
    for m in range(LANES):
        y.gg[b, b, m] += a[3, m] * y.s[0, m]


@jit
def _multiply_vectors(v: Array, factor: Factor, own: int, other: int, high: int) -> None:
    # Rows of a jet, or columns with the rates of the two sides exchanged.
    a, rate = factor
    for i in range(high):
        for m in range(LANES):
            p, dp, g, dg = v[0, i, m], v[1, i, m], v[2, i, m], v[3, i, m]
            v[0, i, m] = a[0, m] * p
            v[1, i, m] = a[0, m] * dp + rate[other, m] * p
            v[2, i, m] = a[0, m] * g + rate[own, m] * p
            v[3, i, m] = a[0, m] * dg + rate[other, m] * g + rate[own, m] * dp + rate[2, m] * p


@jit
def _multiply_scalars(y: Jet, factor: Factor, b: int) -> None:
    a, rate = factor
    s, r, c = y.s, y.r, y.c
    for m in range(LANES):
        y0, y1, y2, y3 = s[0, m], s[1, m], s[2, m], s[3, m]
        r[2, b, m] -= a[1, m] * y0
        r[3, b, m] -= a[1, m] * y2 + rate[4, m] * y0
        c[2, b, m] -= a[2, m] * y0
        c[3, b, m] -= a[2, m] * y1 + rate[3, m] * y0
        s[0, m] = a[0, m] * y0
        s[1, m] = a[0, m] * y1 + rate[0, m] * y0
        s[2, m] = a[0, m] * y2 + rate[1, m] * y0
        s[3, m] = a[0, m] * y3 + rate[0, m] * y2 + rate[1, m] * y1 + rate[2, m] * y0


@jit
def add_velocity(
    y: Jet, weight: float, x: PackedStates, t: Index, z: PackedStates, u: Index, b: int
) -> None:
    """Set y = y + weight dq_b dq'_b."""
    s, r, c, pp = y.s, y.r, y.c, y.pp
    v, dv = weight * x.dq[b, t], weight * x.ddq[b, t]
    dz, ddz = z.dq[b, u : u + LANES], z.ddq[b, u : u + LANES]
    for m in range(LANES):
        s[0, m] += v * dz[m]
        s[1, m] += dv * dz[m]
        s[2, m] += v * ddz[m]
        s[3, m] += dv * ddz[m]
        r[0, b, m] += weight * dz[m]
        r[1, b, m] += weight * ddz[m]
        c[0, b, m] += v
        c[1, b, m] += dv
        pp[b, m] += weight


@jit
def emit_square(block: Array, y: Jet, scale: float, high: int) -> None:
    """Add scale G_i G'_j (y^2) to block[i, j]."""
    s, r, c = y.s, y.r, y.c
    k = 2.0 * scale
    for i in range(high):
        for j in range(high):
            for m in range(LANES):
                block[i, j, m] += k * (
                    s[0, m] * y.gg[i, j, m]
                    + s[1, m] * y.pg[i, j, m]
                    + s[2, m] * y.gp[i, j, m]
                    + r[2, i, m] * c[2, j, m]
                    + r[3, i, m] * c[0, j, m]
                    + r[0, i, m] * c[3, j, m]
                    + r[1, i, m] * c[1, j, m]
                )
        for m in range(LANES):
            block[i, i, m] += k * s[3, m] * y.pp[i, m]


@jit
def emit_energy_square(row: Array, y: Jet, scale: float, high: int) -> None:
    """Add scale G'_j (y^2), the covariance of the kinetic energy with torque j, to row[j]."""
    s, c = y.s, y.c
    for j in range(high):
        for m in range(LANES):
            row[j, m] += 2.0 * scale * (s[0, m] * c[2, j, m] + s[2, m] * c[0, j, m])
