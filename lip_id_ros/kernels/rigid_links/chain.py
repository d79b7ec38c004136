"""
Motion of a chain of links from base to tip (docs/maths.md, section 10).

The motion of a link is three vectors in its own frame: angular velocity, angular acceleration, and
the acceleration of the frame's origin less gravity.

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.vectors import cross, turn_back

Array = NDArray[np.float64]

PARAMETERS = 11
"""
Of every link: mass, three first moments, the inertias xx xy xz yy yz zz about the origin of its
frame [kg, kg m, kg m^2], and the inertia of the rotor, seen through the gear [kg m^2 or kg].
"""

ANGULAR, ANGULAR_RATE, LINEAR_RATE = 0, 1, 2


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
    prismatic: NDArray[np.bool_]
    gravity: Array


@compiled
def place_joint(rotation: Array, offset: Array, chain: Chain, i: int, q: float) -> None:
    """Set a link's rotation (3, 3) and origin (3,) in the link before it, at position q."""
    at_zero = chain.rotations[i]
    if chain.prismatic[i]:
        for k in range(3):
            offset[k] = chain.translations[i, k] + at_zero[k, 2] * q
            rotation[k, 0], rotation[k, 1] = at_zero[k, 0], at_zero[k, 1]
            rotation[k, 2] = at_zero[k, 2]
    else:
        cos, sin = np.cos(q), np.sin(q)
        for k in range(3):
            offset[k] = chain.translations[i, k]
            rotation[k, 0] = at_zero[k, 0] * cos + at_zero[k, 1] * sin
            rotation[k, 1] = at_zero[k, 1] * cos - at_zero[k, 0] * sin
            rotation[k, 2] = at_zero[k, 2]


@compiled
def carry(motion: Array, parent: Array, rotation: Array, offset: Array, work: Array) -> None:
    """Set the motion (3, 3) that a link has of the link before it; `work` has shape (3, 3)."""
    cross(parent[ANGULAR], offset, work[0])
    cross(parent[ANGULAR], work[0], work[1])
    cross(parent[ANGULAR_RATE], offset, work[0])
    for k in range(3):
        work[1, k] += work[0, k] + parent[LINEAR_RATE, k]
    turn_back(rotation, parent[ANGULAR], motion[ANGULAR])
    turn_back(rotation, parent[ANGULAR_RATE], motion[ANGULAR_RATE])
    turn_back(rotation, work[1], motion[LINEAR_RATE])


@compiled
def add_joint(motion: Array, prismatic: bool, dq: float, ddq: float) -> None:
    """Add what the link's own joint adds to its motion."""
    x, y = motion[ANGULAR, 0], motion[ANGULAR, 1]
    if prismatic:
        motion[LINEAR_RATE, 0] += 2.0 * y * dq
        motion[LINEAR_RATE, 1] -= 2.0 * x * dq
        motion[LINEAR_RATE, 2] += ddq
    else:
        motion[ANGULAR, 2] += dq
        motion[ANGULAR_RATE, 0] += y * dq
        motion[ANGULAR_RATE, 1] -= x * dq
        motion[ANGULAR_RATE, 2] += ddq


class Links(NamedTuple):
    """
    Working memory: all links of a chain at one joint state.

    Attributes
    ----------
    rotations, offsets : arrays, shapes (n, 3, 3) and (n, 3)
        Of each link in the one before it.
    carried, motions : arrays, shape (n + 1, 3, 3)
        Motion without and with the link's own joint; row 0 is the base, row i + 1 link i.
    work : array, shape (3, 3)

    """

    rotations: Array
    offsets: Array
    carried: Array
    motions: Array
    work: Array


@compiled
def new_links(n_joints: int) -> Links:
    """Allocate working memory."""
    return Links(
        np.zeros((n_joints, 3, 3)),
        np.zeros((n_joints, 3)),
        np.zeros((n_joints + 1, 3, 3)),
        np.zeros((n_joints + 1, 3, 3)),
        np.zeros((3, 3)),
    )


@compiled
def move(links: Links, chain: Chain, q: Array, dq: Array, ddq: Array) -> None:
    """Set the motions of all links at a joint state of arrays (n,)."""
    for k in range(3):
        links.motions[0, LINEAR_RATE, k] = -chain.gravity[k]
    for i in range(chain.prismatic.shape[0]):
        place_joint(links.rotations[i], links.offsets[i], chain, i, q[i])
        carry(
            links.carried[i + 1],
            links.motions[i],
            links.rotations[i],
            links.offsets[i],
            links.work,
        )
        links.motions[i + 1] = links.carried[i + 1]
        add_joint(links.motions[i + 1], chain.prismatic[i], dq[i], ddq[i])
