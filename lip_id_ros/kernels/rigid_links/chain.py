"""
Motion of a chain of links from base to tip (docs/maths.md, section 10).

What belongs to a link is expressed in its own frame, and where it is in that of the link before.

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.triples import (
    Axes,
    cross,
    load,
    outward,
    plus,
    store,
    times,
    Triple,
)

PARAMETERS = 11
"""
Of every link: mass, three first moments, the inertias xx xy xz yy yz zz about the origin of its
frame [kg, kg m, kg m^2], and the inertia of the rotor, seen through the gear [kg m^2 or kg].
"""


class Chain(NamedTuple):
    """
    Where the joints of an arm are. The z axis of a link's frame is the axis of its joint.

    Attributes
    ----------
    rotations : array, shape (n, 3, 3)
        From each link's frame, at position zero, to that of the link before it.
    translations : array, shape (n, 3)
        Origin of each link's frame, at position zero, in that of the link before it [m].
    prismatic : bool array, shape (n,)
    gravity : array, shape (3,)
        In the frame of the base [m/s^2]; zero where the torques leave gravity out.

    """

    rotations: Array
    translations: Array
    prismatic: BoolArray
    gravity: Array


class Place(NamedTuple):
    """
    Where a link is in the link before it.

    Attributes
    ----------
    axes : three triples
    origin : triple

    """

    axes: Axes
    origin: Triple


class Motion(NamedTuple):
    """
    How a link moves, or a change of that.

    Attributes
    ----------
    angular, angular_rate : triples
        Angular velocity and acceleration.
    linear_rate : triple
        Acceleration of the frame's origin less gravity.

    """

    angular: Triple
    angular_rate: Triple
    linear_rate: Triple


@compiled
def upward(chain: Chain) -> Triple:
    """Return what gravity is taken for: an acceleration of the base."""
    return -chain.gravity[0], -chain.gravity[1], -chain.gravity[2]


@compiled
def place(chain: Chain, i: int, q: float) -> Place:
    """Return where link i is when its joint is at position q."""
    r, t = chain.rotations, chain.translations
    x = r[i, 0, 0], r[i, 1, 0], r[i, 2, 0]
    y = r[i, 0, 1], r[i, 1, 1], r[i, 2, 1]
    z = r[i, 0, 2], r[i, 1, 2], r[i, 2, 2]
    origin = t[i, 0], t[i, 1], t[i, 2]
    if chain.prismatic[i]:
        return Place((x, y, z), plus(origin, times(q, z)))
    c, s = np.cos(q), np.sin(q)
    return Place((plus(times(c, x), times(s, y)), plus(times(c, y), times(-s, x)), z), origin)


@compiled
def store_place(array: Array, i: int, at: Place) -> None:
    """Keep a place in the first four vectors of an array (n, m, 3)."""
    store(array, i, 0, at.axes[0])
    store(array, i, 1, at.axes[1])
    store(array, i, 2, at.axes[2])
    store(array, i, 3, at.origin)


@compiled
def load_place(array: Array, i: int) -> Place:
    """Return a place that was kept."""
    axes = load(array, i, 0), load(array, i, 1), load(array, i, 2)
    return Place(axes, load(array, i, 3))


@compiled
def carried(motion: Motion, at: Place) -> Motion:
    """Return the motion that a link has of the link before it."""
    w, a, d = motion
    centripetal = cross(w, cross(w, at.origin))
    return Motion(
        outward(at.axes, w),
        outward(at.axes, a),
        outward(at.axes, plus(plus(d, cross(a, at.origin)), centripetal)),
    )


@compiled
def velocity(before: Triple, w: Triple, at: Place, prismatic: bool, dq: float) -> Triple:
    """Return the velocity of a link's origin from that of the link before, which turns with w."""
    v = outward(at.axes, plus(before, cross(w, at.origin)))
    return plus(v, (0.0, 0.0, dq)) if prismatic else v


@compiled
def with_joint(motion: Motion, prismatic: bool, dq: float, ddq: float) -> Motion:
    """Return the motion with what the link's own joint adds to it."""
    w, a, d = motion
    x, y = w[1] * dq, -w[0] * dq  # w times the velocity of the joint
    if prismatic:
        return Motion(w, a, plus(d, (2.0 * x, 2.0 * y, ddq)))
    return Motion(plus(w, (0.0, 0.0, dq)), plus(a, (x, y, ddq)), d)
