"""
A running product of joint factors and its derivatives, for `LANES` pairs at once.

The potential energy kernel is such a product, and does not depend on velocities, so that of the
Euler-Lagrange operators only -d/dq_i remains (docs/maths.md, section 2).

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.jets import Factor
from lip_id_ros.numba_jit import jit, LANES


class Product(NamedTuple):
    """
    A product of joint factors; the last index of every array is the pair.

    Attributes
    ----------
    p : array, shape (1, LANES)
    r, c : arrays, shape (n, LANES)
        dp/dq_i and dp/dq'_j.
    h : array, shape (n, n, LANES)
        d2p/dq_i dq'_j.

    """

    p: Array
    r: Array
    c: Array
    h: Array


@jit
def new_product(n: int) -> Product:
    """Allocate a product for n joints."""
    return Product(
        np.zeros((1, LANES)), np.zeros((n, LANES)), np.zeros((n, LANES)), np.zeros((n, n, LANES))
    )


@jit
def start(x: Product, high: int) -> None:
    """Set p = 1 for a p that will depend on joints 0..high-1 only; the rest is never read."""
    x.p[:] = 1.0
    x.r[:high] = 0.0
    x.c[:high] = 0.0
    x.h[:high, :high] = 0.0


@jit
def square(factor: Factor) -> None:
    """Set a(q_b, q'_b) to its square, without the rates."""
    a = factor.a
    for m in range(LANES):
        a0, a1, a2, a3 = a[0, m], a[1, m], a[2, m], a[3, m]
        a[0, m] = a0 * a0
        a[1, m] = 2.0 * a0 * a1
        a[2, m] = 2.0 * a0 * a2
        a[3, m] = 2.0 * (a1 * a2 + a0 * a3)


@jit
def extend(x: Product, factor: Factor, b: int, low: int, high: int) -> None:
    """Set p = a(q_b, q'_b) p; before, p depends on joints low..high-1, afterwards on b too."""
    p, r, c, h = x
    a = factor.a
    for i in range(low, high):
        for j in range(low, high):
            for m in range(LANES):
                h[i, j, m] *= a[0, m]
    for i in range(low, high):
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
