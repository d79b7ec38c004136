"""The steps of `lip_id_ros.kernels.products`, run backwards as in `jets_adjoint`."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.jets import Factor
from lip_id_ros.kernels.products import Product
from lip_id_ros.numba_jit import jit, LANES


@jit
def new_tape(length: int, n: int) -> Product:
    """Allocate `length` products for n joints, stacked along a new first index."""
    return Product(
        np.zeros((length, 1, LANES)),
        np.zeros((length, n, LANES)),
        np.zeros((length, n, LANES)),
        np.zeros((length, n, n, LANES)),
    )


@jit
def tape_entry(tape: Product, k: int) -> Product:
    """View product k of a tape."""
    return Product(tape.p[k], tape.r[k], tape.c[k], tape.h[k])


@jit
def copy_product(out: Product, x: Product, high: int) -> None:
    """Copy the part of a product that belongs to joints 0..high-1."""
    out.p[:] = x.p
    out.r[:high] = x.r[:high]
    out.c[:high] = x.c[:high]
    out.h[:high, :high] = x.h[:high, :high]


@jit
def clear(x: Product, high: int) -> None:
    """Set the part of an adjoint that belongs to joints 0..high-1 to zero."""
    x.p[:] = 0.0
    x.r[:high] = 0.0
    x.c[:high] = 0.0
    x.h[:high, :high] = 0.0


@jit
def emit(adj: Product, w: Array, x: Product, scale: float, high: int) -> float:
    """Go back through the emission contracted with w[i, j]; return the derivative by the scale."""
    total = 0.0
    for i in range(high):
        for j in range(high):
            for m in range(LANES):
                adj.h[i, j, m] += scale * w[i, j, m]
                total += w[i, j, m] * x.h[i, j, m]
    return total


@jit
def extend(
    adj: Product, out: Factor, x: Product, factor: Factor, b: int, low: int, high: int
) -> None:
    """Go back through p = a p; `x` is the product before it, on joints low..high-1."""
    a, grad = factor.a, out.a
    for i in range(low, high):
        for j in range(low, high):
            for m in range(LANES):
                grad[0, m] += adj.h[i, j, m] * x.h[i, j, m]
                adj.h[i, j, m] *= a[0, m]
    for i in range(low, high):
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


@jit
def square(out: Factor, factor: Factor) -> None:
    """Go back through a = a^2; `factor` is that before it."""
    a, grad = factor.a, out.a
    for m in range(LANES):
        a0, a1, a2, a3 = a[0, m], a[1, m], a[2, m], a[3, m]
        g0, g1, g2, g3 = grad[0, m], grad[1, m], grad[2, m], grad[3, m]
        grad[0, m] = 2.0 * (a0 * g0 + a1 * g1 + a2 * g2 + a3 * g3)
        grad[1, m] = 2.0 * (a0 * g1 + a2 * g3)
        grad[2, m] = 2.0 * (a0 * g2 + a1 * g3)
        grad[3, m] = 2.0 * a0 * g3
