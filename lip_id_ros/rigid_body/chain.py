"""
Kinematic chains: where the joints of an arm are, and how reported positions move them.

What belongs to a link is expressed in its own frame (maths.md, section 10).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.numba_jit import jit_inlined
from lip_id_ros.rigid_body.spatial import SpatialInertia, Vec3

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


@jit_inlined
def serial_value(chain: Chain, i: int, x: Array) -> float:
    """Return how far, how fast, ... joint i moves, from what is reported, shape (n,)."""
    value: float = x[i]
    for k in range(len(chain.couplings)):
        if chain.couplings[k, 0] == i:
            value += chain.couplings[k, 2] * x[int(chain.couplings[k, 1])]
    return value


@jit_inlined
def add_torque(tau: Array, chain: Chain, i: int, torque: float) -> None:
    """Add the torque of joint i to those of reported positions, (n,), which do its work."""
    tau[i] += torque
    for k in range(len(chain.couplings)):
        if chain.couplings[k, 0] == i:
            tau[int(chain.couplings[k, 1])] += chain.couplings[k, 2] * torque


@jit_inlined
def add_coupled_rows(rows: Array, chain: Chain) -> None:
    """Add rows of torques of joints, shape (n, m), to those of reported positions, in place."""
    if len(chain.couplings) > 0:
        own = rows.copy()
        for k in range(len(chain.couplings)):
            joint, other = int(chain.couplings[k, 0]), int(chain.couplings[k, 1])
            for c in range(rows.shape[1]):  # whole rows take four times as long to compile
                rows[other, c] += chain.couplings[k, 2] * own[joint, c]


@jit_inlined
def base_acceleration(chain: Chain) -> Vec3:
    """Return minus gravity: an acceleration of the base that has the same effect."""
    return -chain.gravity[0], -chain.gravity[1], -chain.gravity[2]


@jit_inlined
def link_inertia(parameters: Array, i: int) -> SpatialInertia:
    """Return the inertia of link i in its own frame from parameters, shape (n, 11)."""
    p = parameters[i]
    inertia = (p[4], p[5], p[6]), (p[5], p[7], p[8]), (p[6], p[8], p[9])
    return SpatialInertia(p[0], (p[1], p[2], p[3]), inertia)
