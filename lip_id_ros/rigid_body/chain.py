"""
Kinematic chains: where the joints of an arm are, and how they move its links.

What belongs to a link is expressed in its own frame (maths.md, section 10).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.numba_jit import jit
from lip_id_ros.rigid_body.spatial import (
    add,
    scale,
    SpatialInertia,
    SpatialMotion,
    Transform,
    Vec3,
    Wrench,
)

STANDARD_GRAVITY = 9.80665
"""[m/s^2]"""

LINK_PARAMETERS = 11
"""
Of every link: mass, three first moments, the inertias xx xy xz yy yz zz about the origin of its
frame [kg, kg m, kg m^2], and the inertia of the rotor, seen through the gear [kg m^2 or kg].
"""

ROTOR = LINK_PARAMETERS - 1

NO_COUPLINGS = np.zeros((0, 3))


class Chain(NamedTuple):
    """
    Placements of the joints of an arm.

    The z axis of a link's frame is the axis of its joint. Frames are at position zero in those of
    the parent. A coupled joint moves by its reported position plus the ratio times that of the
    other joint.
    """

    rotations: Array  # (n, 3, 3)
    translations: Array  # (n, 3) [m]
    prismatic: BoolArray  # (n,)
    gravity: Array  # (3,), in the base [m/s^2]; 0 where torques leave it out
    couplings: Array = NO_COUPLINGS  # (k, 3): joint, other joint, ratio


@jit
def serial_motion(chain: Chain, x: Array) -> Array:
    """Return how far, how fast, ... the joints move, from what is reported, both (N, n)."""
    out = x.copy()
    for k in range(len(chain.couplings)):
        joint, other = int(chain.couplings[k, 0]), int(chain.couplings[k, 1])
        for t in range(len(x)):
            out[t, joint] += chain.couplings[k, 2] * x[t, other]
    return out


@jit
def serial_value(chain: Chain, i: int, x: Array) -> float:
    """Return how far, how fast, ... joint i moves, from what is reported, shape (n,)."""
    value: float = x[i]
    for k in range(len(chain.couplings)):
        if chain.couplings[k, 0] == i:
            value += chain.couplings[k, 2] * x[int(chain.couplings[k, 1])]
    return value


@jit
def add_torque(tau: Array, chain: Chain, i: int, torque: float) -> None:
    """Add the torque of joint i to those of reported positions, (n,), which do its work."""
    tau[i] += torque
    for k in range(len(chain.couplings)):
        if chain.couplings[k, 0] == i:
            tau[int(chain.couplings[k, 1])] += chain.couplings[k, 2] * torque


@jit
def add_coupled_rows(rows: Array, chain: Chain) -> None:
    """Add rows of torques of joints, shape (n, m), to those of reported positions, in place."""
    if len(chain.couplings) > 0:
        own = rows.copy()
        for k in range(len(chain.couplings)):
            joint, other = int(chain.couplings[k, 0]), int(chain.couplings[k, 1])
            for c in range(rows.shape[1]):  # whole rows take four times as long to compile
                rows[other, c] += chain.couplings[k, 2] * own[joint, c]


@jit
def base_acceleration(chain: Chain) -> Vec3:
    """Return minus gravity: an acceleration of the base that has the same effect."""
    return -chain.gravity[0], -chain.gravity[1], -chain.gravity[2]


@jit
def joint_transform(chain: Chain, i: int, q: float) -> Transform:
    """Return the transform of link i in its parent when its joint is at position q."""
    r, t = chain.rotations, chain.translations
    x = r[i, 0, 0], r[i, 1, 0], r[i, 2, 0]
    y = r[i, 0, 1], r[i, 1, 1], r[i, 2, 1]
    z = r[i, 0, 2], r[i, 1, 2], r[i, 2, 2]
    origin = t[i, 0], t[i, 1], t[i, 2]
    if chain.prismatic[i]:
        return Transform((x, y, z), add(origin, scale(q, z)))
    c, s = np.cos(q), np.sin(q)
    rotation = add(scale(c, x), scale(s, y)), add(scale(c, y), scale(-s, x)), z
    return Transform(rotation, origin)


@jit
def add_joint_motion(
    motion: SpatialMotion, prismatic: bool, dq: float, ddq: float
) -> SpatialMotion:
    """Return a link's motion from that of a frame fixed to its parent, by its joint's motion."""
    w, a, d = motion
    x, y = w[1] * dq, -w[0] * dq  # w times the velocity of the joint
    if prismatic:
        return SpatialMotion(w, a, add(d, (2.0 * x, 2.0 * y, ddq)))
    return SpatialMotion(add(w, (0.0, 0.0, dq)), add(a, (x, y, ddq)), d)


@jit
def link_inertia(p: Array, i: int) -> SpatialInertia:
    """Return the inertia of link i from parameters p, shape (n, 11)."""
    xx, xy, xz, yy, yz, zz = p[i, 4], p[i, 5], p[i, 6], p[i, 7], p[i, 8], p[i, 9]
    inertia = (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)
    return SpatialInertia(p[i, 0], (p[i, 1], p[i, 2], p[i, 3]), inertia)


@jit
def joint_component(wrench: Wrench, prismatic: bool) -> float:
    """Return the component of a link's wrench along its own joint."""
    return wrench.force[2] if prismatic else wrench.torque[2]


@jit
def joint_row(prismatic: bool) -> int:
    """Return the index of that component among the six of a wrench, torque before force."""
    return 5 if prismatic else 2
