"""Angles and distances between neighbouring joint axes, as a data sheet gives them."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body.chain import Chain

PARALLEL = np.sin(np.radians(3.0))
"""
Sine of the angle below which two axes count as parallel: torques identify a small angle poorly,
and do not identify where such axes cross.
"""


def angles_between(chain: Chain) -> Array:
    """Return the angle of each axis to that of the joint before it, shape (n - 1,) [rad]."""
    along = chain.rotations[1:, 2, 2]
    across = np.hypot(chain.rotations[1:, 0, 2], chain.rotations[1:, 1, 2])
    return np.arctan2(across, along)


def distances_between(chain: Chain) -> Array:
    """
    Return the shortest distance of each joint's axis to that of the joint before it.

    Returns
    -------
    array, shape (n - 1,)
        [m]; not a number where one of the two is prismatic, whose axis is but a direction, and
        where there is no gravity, without which torques identify lengths up to a factor.

    """
    axes, origins = chain.rotations[1:, :, 2], chain.translations[1:]
    normals = np.cross((0.0, 0.0, 1.0), axes)
    sines = np.linalg.norm(normals, axis=1)
    skew = np.abs((origins * normals).sum(axis=1)) / np.where(sines > 0.0, sines, 1.0)
    side_by_side = np.hypot(origins[:, 0], origins[:, 1])
    distances = np.where(sines > PARALLEL, skew, side_by_side)
    unknown = chain.prismatic[1:] | chain.prismatic[:-1] | ~chain.gravity.any()
    return np.where(unknown, np.nan, distances)
