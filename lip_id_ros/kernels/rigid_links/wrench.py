"""What moves a rigid link: a torque about its frame's origin, and a force."""

from __future__ import annotations

from typing import NamedTuple

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.chain import Motion, Place
from lip_id_ros.kernels.rigid_links.triples import (
    Axes,
    cross,
    dot,
    inward,
    plus,
    times,
    Triple,
)


class Wrench(NamedTuple):
    """
    A torque about the origin of a link's frame, and a force; or a change of them.

    Attributes
    ----------
    torque, force : triples

    """

    torque: Triple
    force: Triple


class Body(NamedTuple):
    """
    A rigid body in the frame of its link.

    Attributes
    ----------
    mass : float
    moment : triple
        Mass times centre of mass.
    inertia : three triples
        About the origin of the frame.

    """

    mass: float
    moment: Triple
    inertia: Axes


@compiled
def body(p: Array, i: int) -> Body:
    """Return link i of parameters p (n, 11)."""
    xx, xy, xz, yy, yz, zz = p[i, 4], p[i, 5], p[i, 6], p[i, 7], p[i, 8], p[i, 9]
    inertia = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
    return Body(p[i, 0], (p[i, 1], p[i, 2], p[i, 3]), inertia)


@compiled
def inertia_times(own: Body, a: Triple) -> Triple:
    """Return the inertia of a body times a vector."""
    return dot(own.inertia[0], a), dot(own.inertia[1], a), dot(own.inertia[2], a)


@compiled
def wrench(own: Body, motion: Motion) -> Wrench:
    """
    Return what moves a body by itself.

    With angular velocity w, its rate a, linear acceleration d, first moment h and inertia I: force
    m d + a x h + w x (w x h), torque I a + w x I w + h x d (Newton and Euler).

    """
    w, a, d = motion
    h = own.moment
    gyroscopic = cross(w, inertia_times(own, w))
    return Wrench(
        plus(plus(inertia_times(own, a), gyroscopic), cross(h, d)),
        plus(plus(times(own.mass, d), cross(a, h)), cross(w, cross(w, h))),
    )


@compiled
def wrench_change(own: Body, motion: Motion, change: Motion) -> Wrench:
    """Return the change of a body's wrench that goes with a change of its motion."""
    w, (dw, da, dd) = motion.angular, change
    h = own.moment
    gyroscopic = plus(cross(dw, inertia_times(own, w)), cross(w, inertia_times(own, dw)))
    centripetal = plus(cross(dw, cross(w, h)), cross(w, cross(dw, h)))
    return Wrench(
        plus(plus(inertia_times(own, da), gyroscopic), cross(h, dd)),
        plus(plus(times(own.mass, dd), cross(da, h)), centripetal),
    )


@compiled
def both(one: Wrench, other: Wrench) -> Wrench:
    """Return the sum."""
    return Wrench(plus(one.torque, other.torque), plus(one.force, other.force))


@compiled
def shifted(wrench: Wrench, at: Place) -> Wrench:
    """Return the same wrench for the link before, in which its own link is at a place."""
    force = inward(at.axes, wrench.force)
    return Wrench(plus(inward(at.axes, wrench.torque), cross(at.origin, force)), force)


@compiled
def along_joint(wrench: Wrench, prismatic: bool) -> float:
    """Return what of a wrench the link's own joint gives."""
    return wrench.force[2] if prismatic else wrench.torque[2]


@compiled
def row_along_joint(prismatic: bool) -> int:
    """Return where that is among the six numbers of a wrench."""
    return 5 if prismatic else 2
