"""
Link frames that are near each other, of the many with which an arm has the same torques.

Frames may be turned about the axes of their joints and lie anywhere along them, the base may be
turned about the vertical, and the arm may be its mirror image.
"""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body.chain import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.denavit_hartenberg import (
    chain_of,
    handedness,
    mirrored,
    PARALLEL,
    Pose,
    poses,
    up_of,
)

TURNED = -0.5
"""Cosine of the angle between two axes from which on the second is taken for one turned over."""

HORIZONTAL = 0.5
"""Horizontal part of an axis to which the base is turned; half of the largest, if that is less."""

VERTICAL = 1e-6
"""The same from which on an axis has a direction."""

TURN_OVER = np.diag([1.0, -1.0, -1.0])


def with_near_frames(chain: Chain) -> Chain:
    """
    Return the same arm, or its mirror image, in frames that are as near as they can be.

    Each origin is the point of the axis that is nearest to the origin before, and each frame is
    turned as little as can be against the one before: two chains of the same torques become one.
    Unlike the common normals of Denavit and Hartenberg, these are nowhere far from the arm.
    """
    links = np.zeros((len(chain.prismatic), LINK_PARAMETERS))
    near = _near(chain)
    image = _near(mirrored(near, links)[0])
    return near if handedness(near, image) > 0.0 else image


def _near(chain: Chain) -> Chain:
    """Return the arm, as it is, in frames that are near each other."""
    old = poses(chain)
    base = _base(chain, old)
    axes, origins = np.empty_like(old.axes), np.empty_like(old.origin)
    before, at = base, _first_origin(chain, old)
    for i, z in enumerate(old.axes[:, :, 2]):
        if i > 0 and not chain.prismatic[i]:
            at = old.origin[i] + z * (z @ (at - old.origin[i]))
        before = before @ _least_turn(before.T @ z)
        axes[i], origins[i] = before, at
    return chain_of(chain, Pose(base, origins[0]), Pose(axes, origins))


def _first_origin(chain: Chain, old: Pose) -> Array:
    """Return the point of the first axis that is nearest to the next one at an angle to it."""
    first = old.axes[0, :, 2]
    for origin, z, slides in zip(old.origin, old.axes[:, :, 2], chain.prismatic, strict=True):
        cosine = first @ z
        if not slides and 1.0 - cosine**2 > PARALLEL**2:
            apart = origin - old.origin[0]
            along = (apart @ first - cosine * (apart @ z)) / (1.0 - cosine**2)
            return np.asarray(old.origin[0] + along * first)
    return np.asarray(old.origin[0])


def _base(chain: Chain, old: Pose) -> Array:
    """Return the axes of a base whose z axis is up, turned to the first horizontal axis."""
    up = up_of(chain, old)
    level = old.axes[:, :, 2] - np.outer(old.axes[:, :, 2] @ up, up)
    lengths = np.linalg.norm(level, axis=1)
    first = int(np.argmax(lengths > min(HORIZONTAL, 0.5 * lengths.max())))
    if lengths[first] < VERTICAL:
        return _least_turn(up)
    x = level[first] / lengths[first]
    return np.column_stack([x, np.cross(up, x), up])


def _least_turn(z: Array) -> Array:
    """Return the rotation that turns the z axis to another one by least, (3, 3)."""
    up = np.array([0.0, 0.0, 1.0])
    return _from(-up, z) @ TURN_OVER if z[2] < TURNED else _from(up, z)


def _from(a: Array, b: Array) -> Array:
    """Return the least rotation of one direction to another that is not opposite (Rodrigues)."""
    x, y, z = np.cross(a, b)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1.0 + a @ b))
