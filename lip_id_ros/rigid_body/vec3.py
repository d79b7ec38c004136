"""Vectors in space as tuples of three numbers, which compiled loops keep in registers."""

from __future__ import annotations

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit

Vec3 = tuple[float, float, float]
Mat3 = tuple[Vec3, Vec3, Vec3]
"""Three vectors: the columns of a rotation, the rows of an inertia tensor."""

ZERO: Vec3 = (0.0, 0.0, 0.0)


@jit
def dot(a: Vec3, b: Vec3) -> float:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit
def add(a: Vec3, b: Vec3) -> Vec3:
    """Return the sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@jit
def scale(factor: float, a: Vec3) -> Vec3:
    """Return the multiple."""
    return factor * a[0], factor * a[1], factor * a[2]


@jit
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def to_parent(rotation: Mat3, a: Vec3) -> Vec3:
    """Rotate a vector from the child's frame to the parent's: R a."""
    return add(add(scale(a[0], rotation[0]), scale(a[1], rotation[1])), scale(a[2], rotation[2]))


@jit
def to_child(rotation: Mat3, a: Vec3) -> Vec3:
    """Rotate a vector from the parent's frame to the child's: R^T a."""
    return dot(rotation[0], a), dot(rotation[1], a), dot(rotation[2], a)


@jit
def load(array: Array, i: int, k: int) -> Vec3:
    """Return vector k of row i of an array (n, m, 3)."""
    return array[i, k, 0], array[i, k, 1], array[i, k, 2]


@jit
def store(array: Array, i: int, k: int, a: Vec3) -> None:
    """Set vector k of row i of an array (n, m, 3)."""
    array[i, k, 0], array[i, k, 1], array[i, k, 2] = a
