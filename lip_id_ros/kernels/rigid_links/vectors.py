"""Vectors of three numbers for the compiled loops; the result goes into the last argument."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.lanes import compiled

Array = NDArray[np.float64]


@compiled
def cross(a: Array, b: Array, out: Array) -> None:
    """Take the vector product; `out` is neither of them."""
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled
def turn(rotation: Array, a: Array, out: Array) -> None:
    """Express in the parent what is expressed in the child; `out` is not `a`."""
    for k in range(3):
        out[k] = rotation[k, 0] * a[0] + rotation[k, 1] * a[1] + rotation[k, 2] * a[2]


@compiled
def turn_back(rotation: Array, a: Array, out: Array) -> None:
    """Express in the child what is expressed in the parent; `out` is not `a`."""
    for k in range(3):
        out[k] = rotation[0, k] * a[0] + rotation[1, k] * a[1] + rotation[2, k] * a[2]
