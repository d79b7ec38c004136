"""Vectors as tuples of three numbers, which compiled loops keep in registers."""

from __future__ import annotations

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.lanes import compiled

Triple = tuple[float, float, float]
Axes = tuple[Triple, Triple, Triple]
"""The axes of a child's frame, expressed in the parent: the columns of a rotation."""

NOTHING: Triple = (0.0, 0.0, 0.0)


@compiled
def dot(a: Triple, b: Triple) -> float:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def plus(a: Triple, b: Triple) -> Triple:
    """Return the sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@compiled
def times(factor: float, a: Triple) -> Triple:
    """Return the multiple."""
    return factor * a[0], factor * a[1], factor * a[2]


@compiled
def cross(a: Triple, b: Triple) -> Triple:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def inward(axes: Axes, a: Triple) -> Triple:
    """Express in the parent what is expressed in the child."""
    return plus(plus(times(a[0], axes[0]), times(a[1], axes[1])), times(a[2], axes[2]))


@compiled
def outward(axes: Axes, a: Triple) -> Triple:
    """Express in the child what is expressed in the parent."""
    return dot(axes[0], a), dot(axes[1], a), dot(axes[2], a)


@compiled
def load(array: Array, i: int, k: int) -> Triple:
    """Return a vector of an array (n, m, 3)."""
    return array[i, k, 0], array[i, k, 1], array[i, k, 2]


@compiled
def store(array: Array, i: int, k: int, a: Triple) -> None:
    """Set a vector of an array (n, m, 3)."""
    array[i, k, 0], array[i, k, 1], array[i, k, 2] = a
