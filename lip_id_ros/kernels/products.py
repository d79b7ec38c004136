"""
A running product of joint factors, its derivatives and their adjoints, for `LANES` pairs at once.

The potential energy kernel is such a product. It does not depend on velocities, so that of the
Euler-Lagrange operators only -d/dq_i remains (maths.md, section 2).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.jets import Factor
from lip_id_ros.numba_jit import jit, LANES


class Product(NamedTuple):
    """A product of joint factors; the last index of every array is the pair."""

    p: Array  # (1, LANES)
    r: Array  # (n, LANES): dp/dq_i
    c: Array  # (n, LANES): dp/dq'_j
    h: Array  # (n, n, LANES): d2p/dq_i dq'_j


@jit
def new_products(count: int, n: int) -> Product:
    """Allocate products for n joints, stacked along a new first index."""
    return Product(
        np.zeros((count, 1, LANES)),
        np.zeros((count, n, LANES)),
        np.zeros((count, n, LANES)),
        np.zeros((count, n, n, LANES)),
    )


@jit
def product_at(x: Product, k: int) -> Product:
    """View one of several products."""
    return Product(x.p[k], x.r[k], x.c[k], x.h[k])


@jit
def fill(x: Product, value: float, high: int) -> None:
    """Set p to a number, for a p that will depend on joints 0..high-1 only."""
    x.p[:] = value
    x.r[:high] = 0.0
    x.c[:high] = 0.0
    x.h[:high, :high] = 0.0


@jit
def extend(x: Product, factor: Factor, b: int) -> None:
    """Set p = a(q_b, q'_b) p; before, p depends on joints 0..b-1, afterwards on b too."""
    p, r, c, h = x
    a = factor.a
    for i in range(b):
        for j in range(b):
            for m in range(LANES):
                h[i, j, m] *= a[0, m]
    for i in range(b):
        for m in range(LANES):
            h[b, i, m] = a[1, m] * c[i, m]
            h[i, b, m] = a[2, m] * r[i, m]
            r[i, m] *= a[0, m]
            c[i, m] *= a[0, m]
    for m in range(LANES):
        h[b, b, m] = a[3, m] * p[0, m]
        r[b, m] = a[1, m] * p[0, m]
        c[b, m] = a[2, m] * p[0, m]
        p[0, m] *= a[0, m]


@jit
def emit(block: Array, x: Product, scale: float, high: int) -> None:
    """Add scale d2p/dq_i dq'_j, the covariance of the gravity torques, to block[i, j]."""
    for i in range(high):
        for j in range(high):
            for m in range(LANES):
                block[i, j, m] += scale * x.h[i, j, m]


@jit
def emit_energy(row: Array, x: Product, scale: float, high: int) -> None:
    """Add scale dp/dq'_j, the covariance of the potential energy with torque j, to row[j]."""
    for j in range(high):
        for m in range(LANES):
            row[j, m] += scale * x.c[j, m]


@jit
def copy_product(out: Product, x: Product, high: int) -> None:
    """Copy the part of a product that belongs to joints 0..high-1."""
    out.p[:] = x.p
    out.r[:high] = x.r[:high]
    out.c[:high] = x.c[:high]
    out.h[:high, :high] = x.h[:high, :high]


@jit
def emit_adjoint(adj: Product, w: Array, x: Product, scale: float, high: int) -> float:
    """Transpose `emit`, contracted with w[i, j]; return the derivative by the scale."""
    total = 0.0
    for i in range(high):
        for j in range(high):
            for m in range(LANES):
                adj.h[i, j, m] += scale * w[i, j, m]
                total += w[i, j, m] * x.h[i, j, m]
    return total


@jit
def extend_adjoint(adj: Product, out: Factor, x: Product, factor: Factor, b: int) -> None:
    """Transpose `extend`; `x` is the product before it, on joints 0..b-1."""
    a, grad = factor.a, out.a
    for i in range(b):
        for j in range(b):
            for m in range(LANES):
                grad[0, m] += adj.h[i, j, m] * x.h[i, j, m]
                adj.h[i, j, m] *= a[0, m]
    for i in range(b):
        for m in range(LANES):
            row, column = adj.h[b, i, m], adj.h[i, b, m]
            grad[0, m] += adj.r[i, m] * x.r[i, m] + adj.c[i, m] * x.c[i, m]
            grad[1, m] += row * x.c[i, m]
            grad[2, m] += column * x.r[i, m]
            adj.r[i, m] = a[0, m] * adj.r[i, m] + a[2, m] * column
            adj.c[i, m] = a[0, m] * adj.c[i, m] + a[1, m] * row
    for m in range(LANES):
        p, corner = x.p[0, m], adj.h[b, b, m]
        grad[0, m] += adj.p[0, m] * p
        grad[1, m] += adj.r[b, m] * p
        grad[2, m] += adj.c[b, m] * p
        grad[3, m] += corner * p
        adj.p[0, m] = (
            a[0, m] * adj.p[0, m]
            + a[1, m] * adj.r[b, m]
            + a[2, m] * adj.c[b, m]
            + a[3, m] * corner
        )
