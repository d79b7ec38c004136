"""
Spatial algebra in one frame (Featherstone, Rigid Body Dynamics Algorithms, 2008, chapter 2).

Vectors are tuples of three numbers, which compiled loops keep in registers. A twist and a wrench
are two of these, both about the origin of the frame (maths.md, section 10).
"""

from __future__ import annotations

from typing import NamedTuple

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit_inlined

Vec3 = tuple[float, float, float]
Mat3 = tuple[Vec3, Vec3, Vec3]
"""Three vectors: the columns of a rotation, the rows of an inertia tensor."""

ZERO: Vec3 = (0.0, 0.0, 0.0)


class Transform(NamedTuple):
    """Pose of a frame: columns of its rotation, and its origin [m]."""

    rotation: Mat3
    translation: Vec3


class Twist(NamedTuple):
    """Velocity of a body, or its derivative: of its turning, and of its point at the origin."""

    angular: Vec3
    linear: Vec3


class Wrench(NamedTuple):
    """A torque about the origin and a force, or an angular and a linear momentum."""

    torque: Vec3
    force: Vec3


class SpatialInertia(NamedTuple):
    """Mass, mass times centre of mass, and inertia tensor about the origin."""

    mass: float
    first_moment: Vec3
    inertia: Mat3


@jit_inlined
def dot(a: Vec3, b: Vec3) -> float:
    """Return the inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit_inlined
def add(a: Vec3, b: Vec3) -> Vec3:
    """Return the sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@jit_inlined
def scale(factor: float, a: Vec3) -> Vec3:
    """Return the multiple."""
    return factor * a[0], factor * a[1], factor * a[2]


@jit_inlined
def cross(a: Vec3, b: Vec3) -> Vec3:
    """Return the vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit_inlined
def outwards(matrix: Mat3, a: Vec3) -> Vec3:
    """Return the sum of the columns times the entries of a vector: R a, out of a frame."""
    return add(add(scale(a[0], matrix[0]), scale(a[1], matrix[1])), scale(a[2], matrix[2]))


@jit_inlined
def inwards(matrix: Mat3, a: Vec3) -> Vec3:
    """Return the products of the columns with a vector: R^T a, into a frame."""
    return dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)


@jit_inlined
def add_matrices(a: Mat3, b: Mat3) -> Mat3:
    """Return the sum."""
    return add(a[0], b[0]), add(a[1], b[1]), add(a[2], b[2])


@jit_inlined
def outer(a: Vec3, b: Vec3) -> Mat3:
    """Return the columns of a b^T."""
    return scale(b[0], a), scale(b[1], a), scale(b[2], a)


@jit_inlined
def diagonal(a: float) -> Mat3:
    """Return a times the identity."""
    return (a, 0.0, 0.0), (0.0, a, 0.0), (0.0, 0.0, a)


@jit_inlined
def trace(a: Mat3) -> float:
    """Return the sum of the diagonal."""
    return a[0][0] + a[1][1] + a[2][2]


@jit_inlined
def add_twists(a: Twist, factor: float, b: Twist) -> Twist:
    """Return a + factor b."""
    return Twist(add(a.angular, scale(factor, b.angular)), add(a.linear, scale(factor, b.linear)))


@jit_inlined
def add_wrenches(a: Wrench, b: Wrench) -> Wrench:
    """Return the sum."""
    return Wrench(add(a.torque, b.torque), add(a.force, b.force))


@jit_inlined
def power(twist: Twist, wrench: Wrench) -> float:
    """Return the work per time of a wrench on a body with a twist."""
    return dot(twist.angular, wrench.torque) + dot(twist.linear, wrench.force)


@jit_inlined
def cross_twists(v: Twist, x: Twist) -> Twist:
    """Return v x x: the rate of a twist that is fixed to a body with twist v."""
    linear = add(cross(v.angular, x.linear), cross(v.linear, x.angular))
    return Twist(cross(v.angular, x.angular), linear)


@jit_inlined
def cross_wrench(v: Twist, f: Wrench) -> Wrench:
    """Return v x* f: the rate of a wrench that is fixed to a body with twist v."""
    torque = add(cross(v.angular, f.torque), cross(v.linear, f.force))
    return Wrench(torque, cross(v.angular, f.force))


@jit_inlined
def twist_into(frame: Transform, twist: Twist) -> Twist:
    """Return a twist in a frame, about its origin."""
    linear = add(twist.linear, cross(twist.angular, frame.translation))
    return Twist(inwards(frame.rotation, twist.angular), inwards(frame.rotation, linear))


@jit_inlined
def wrench_out_of(frame: Transform, wrench: Wrench) -> Wrench:
    """Return a wrench that is given in a frame, about its origin."""
    force = outwards(frame.rotation, wrench.force)
    torque = outwards(frame.rotation, wrench.torque)
    return Wrench(add(torque, cross(frame.translation, force)), force)


@jit_inlined
def inertia_times(body: SpatialInertia, v: Twist) -> Wrench:
    """Return the momentum of a body with twist v: torque I w + h x v, force m v + w x h."""
    w, h = v.angular, body.first_moment
    return Wrench(
        add(inwards(body.inertia, w), cross(h, v.linear)),
        add(scale(body.mass, v.linear), cross(w, h)),
    )


@jit_inlined
def moment_in_base(body: SpatialInertia, frame: Transform) -> Vec3:
    """Return the first moment about the origin of the base: R h + m p."""
    return add(outwards(frame.rotation, body.first_moment), scale(body.mass, frame.translation))


@jit_inlined
def load(array: Array, i: int, k: int) -> Vec3:
    """Return vector k of row i of an array (n, m, 3)."""
    return array[i, k, 0], array[i, k, 1], array[i, k, 2]


@jit_inlined
def store(array: Array, i: int, k: int, a: Vec3) -> None:
    """Set vector k of row i of an array (n, m, 3)."""
    array[i, k, 0], array[i, k, 1], array[i, k, 2] = a


@jit_inlined
def load_twist(array: Array, i: int, k: int) -> Twist:
    """Return the twist that `store_twist` stored."""
    return Twist(load(array, i, k), load(array, i, k + 1))


@jit_inlined
def store_twist(array: Array, i: int, k: int, twist: Twist) -> None:
    """Set vectors k and k + 1 of row i of an array (n, m, 3)."""
    store(array, i, k, twist.angular)
    store(array, i, k + 1, twist.linear)
