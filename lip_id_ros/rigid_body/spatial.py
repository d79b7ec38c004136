"""
Spatial algebra in the frames of links (Featherstone, Rigid Body Dynamics Algorithms, 2008).

Vectors are tuples of three numbers, which compiled loops keep in registers (maths.md, section 10).
"""

from __future__ import annotations

from typing import NamedTuple

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


class Transform(NamedTuple):
    """Pose of a link's frame in that of its parent: columns of R, and the link's origin [m]."""

    rotation: Mat3
    translation: Vec3


class SpatialMotion(NamedTuple):
    """
    Motion of a link in its own frame, or a derivative of that.

    The linear acceleration is the classical one of the frame's origin, minus gravity.
    """

    angular_velocity: Vec3
    angular_acceleration: Vec3
    linear_acceleration: Vec3


class Wrench(NamedTuple):
    """A torque about the origin of a link's frame and a force, or a derivative of them."""

    torque: Vec3
    force: Vec3


class SpatialInertia(NamedTuple):
    """Mass, mass times centre of mass, and inertia tensor about the origin of the link's frame."""

    mass: float
    first_moment: Vec3
    inertia: Mat3


@jit
def store_transform(array: Array, i: int, x: Transform) -> None:
    """Store a transform in the first four vectors of row i of an array (n, m, 3)."""
    store(array, i, 0, x.rotation[0])
    store(array, i, 1, x.rotation[1])
    store(array, i, 2, x.rotation[2])
    store(array, i, 3, x.translation)


@jit
def load_transform(array: Array, i: int) -> Transform:
    """Return the transform that `store_transform` stored."""
    rotation = load(array, i, 0), load(array, i, 1), load(array, i, 2)
    return Transform(rotation, load(array, i, 3))


@jit
def propagate_motion(motion: SpatialMotion, x: Transform) -> SpatialMotion:
    """Return the motion of a frame fixed to a link at a transform from it, in that frame."""
    w, a, d = motion
    centripetal = cross(w, cross(w, x.translation))
    return SpatialMotion(
        to_child(x.rotation, w),
        to_child(x.rotation, a),
        to_child(x.rotation, add(add(d, cross(a, x.translation)), centripetal)),
    )


@jit
def propagate_velocity(v: Vec3, w: Vec3, x: Transform) -> Vec3:
    """Return the linear velocity of a frame fixed to a link with velocity v that turns with w."""
    return to_child(x.rotation, add(v, cross(w, x.translation)))


@jit
def inertia_times(body: SpatialInertia, a: Vec3) -> Vec3:
    """Return the product of the inertia tensor with a vector."""
    return dot(body.inertia[0], a), dot(body.inertia[1], a), dot(body.inertia[2], a)


@jit
def newton_euler(body: SpatialInertia, motion: SpatialMotion) -> Wrench:
    """
    Return the wrench that gives a body its motion (equations of Newton and Euler).

    With angular velocity w, its rate a, linear acceleration d, first moment h and inertia I: force
    m d + a x h + w x (w x h), torque I a + w x I w + h x d.
    """
    w, a, d = motion
    h = body.first_moment
    gyroscopic = cross(w, inertia_times(body, w))
    return Wrench(
        add(add(inertia_times(body, a), gyroscopic), cross(h, d)),
        add(add(scale(body.mass, d), cross(a, h)), cross(w, cross(w, h))),
    )


@jit
def add_wrenches(a: Wrench, b: Wrench) -> Wrench:
    """Return the sum of two wrenches about one point."""
    return Wrench(add(a.torque, b.torque), add(a.force, b.force))


@jit
def transform_wrench(wrench: Wrench, x: Transform) -> Wrench:
    """Return a link's wrench in the frame of its parent, in which the link is at x."""
    force = to_parent(x.rotation, wrench.force)
    torque = add(to_parent(x.rotation, wrench.torque), cross(x.translation, force))
    return Wrench(torque, force)
