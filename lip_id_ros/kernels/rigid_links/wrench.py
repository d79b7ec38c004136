"""What moves a rigid link: a torque about its frame's origin, and a force."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.chain import Motion, Place
from lip_id_ros.kernels.rigid_links.triples import cross, inward, plus, times, Triple

Array = NDArray[np.float64]


class Wrench(NamedTuple):
    """
    A torque about the origin of a link's frame, and a force; or a change of them.

    Attributes
    ----------
    torque, force : triples

    """

    torque: Triple
    force: Triple


@compiled
def wrench(p: Array, i: int, motion: Motion) -> Wrench:
    """
    Return what moves link i, of parameters p (n, 11), by itself.

    With angular velocity w, its rate a, linear acceleration d, first moment h and inertia I: force
    m d + a x h + w x (w x h), torque I a + w x I w + h x d (Newton and Euler).

    """
    w, a, d = motion
    h = first_moment(p, i)
    gyroscopic = cross(w, inertia_times(p, i, w))
    return Wrench(
        plus(plus(inertia_times(p, i, a), gyroscopic), cross(h, d)),
        plus(plus(times(p[i, 0], d), cross(a, h)), cross(w, cross(w, h))),
    )


@compiled
def wrench_change(p: Array, i: int, motion: Motion, change: Motion) -> Wrench:
    """Return the change of link i's wrench that goes with a change of its motion."""
    w, (dw, da, dd) = motion.angular, change
    h = first_moment(p, i)
    spin, dspin = inertia_times(p, i, w), inertia_times(p, i, dw)
    gyroscopic = plus(cross(dw, spin), cross(w, dspin))
    centripetal = plus(cross(dw, cross(w, h)), cross(w, cross(dw, h)))
    return Wrench(
        plus(plus(inertia_times(p, i, da), gyroscopic), cross(h, dd)),
        plus(plus(times(p[i, 0], dd), cross(da, h)), centripetal),
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
def first_moment(p: Array, i: int) -> Triple:
    """Return mass times centre of mass of link i."""
    return p[i, 1], p[i, 2], p[i, 3]


@compiled
def inertia_times(p: Array, i: int, a: Triple) -> Triple:
    """Return the inertia of link i times a vector."""
    return (
        p[i, 4] * a[0] + p[i, 5] * a[1] + p[i, 6] * a[2],
        p[i, 5] * a[0] + p[i, 7] * a[1] + p[i, 8] * a[2],
        p[i, 6] * a[0] + p[i, 8] * a[1] + p[i, 9] * a[2],
    )
