"""
The potential energy kernel's running product and its derivatives, for `LANES` pairs at once.

The potential does not depend on velocities, so that of the Euler-Lagrange operators only -d/dq_i
remains (docs/maths.md, section 2).

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.jets import Factor
from lip_id_ros.kernels.lanes import compiled, LANES

Array = NDArray[np.float64]


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


@compiled
def new_product(n: int) -> Product:
    """Allocate a product for n joints."""
    return Product(
        np.zeros((1, LANES)), np.zeros((n, LANES)), np.zeros((n, LANES)), np.zeros((n, n, LANES))
    )


@compiled
def start(x: Product) -> None:
    """Set p = 1."""
    x.p[:] = 1.0
    x.r[:] = 0.0
    x.c[:] = 0.0
    x.h[:] = 0.0


@compiled
def extend(x: Product, factor: Factor, b: int) -> None:
    """Set p = a(q_b, q'_b) p, for a p that depends on the joints before b."""
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


@compiled
def emit(block: Array, x: Product, scale: float, high: int) -> None:
    """Add scale d2p/dq_i dq'_j, the covariance of the gravity torques, to block[i, j]."""
    for i in range(high):
        for j in range(high):
            for m in range(LANES):
                block[i, j, m] += scale * x.h[i, j, m]


@compiled
def emit_energy(row: Array, x: Product, scale: float, high: int) -> None:
    """Add scale dp/dq'_j, the covariance of the potential energy with torque j, to row[j]."""
    for j in range(high):
        for m in range(LANES):
            row[j, m] += scale * x.c[j, m]
