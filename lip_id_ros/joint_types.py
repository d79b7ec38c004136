"""The two types of joints with their units, and what is known of the past of joints."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray

REVOLUTE, PRISMATIC = 'revolute', 'prismatic'
JOINT_TYPES = (REVOLUTE, PRISMATIC)
POSITION_UNITS = {REVOLUTE: 'rad', PRISMATIC: 'm'}
TORQUE_UNITS = {REVOLUTE: 'N m', PRISMATIC: 'N'}


def is_prismatic(joint_types: Iterable[str]) -> BoolArray:
    """Return which joints are prismatic, shape (n,)."""
    return np.array([kind == PRISMATIC for kind in joint_types], dtype=np.bool_)


DISPLACEMENTS = (3e-4, 1e-3, 3e-3, 0.01, 0.03)
"""Displacements within which friction turns, of the states that are kept [rad or m]."""


class JointHistory(NamedTuple):
    """History of N samples of n joints; None for what is not known."""

    sign: Array | None = None  # (N, n), of velocities after the low-pass of the torques
    dahl: Array | None = None  # (N, n, D), states of Dahl's friction by `DISPLACEMENTS`


UNKNOWN = JointHistory()
"""The history of single states."""
