"""The two types of joints and the units of their positions and torques."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lip_id_ros.arrays import BoolArray

REVOLUTE, PRISMATIC = 'revolute', 'prismatic'
JOINT_TYPES = (REVOLUTE, PRISMATIC)
POSITION_UNITS = {REVOLUTE: 'rad', PRISMATIC: 'm'}
TORQUE_UNITS = {REVOLUTE: 'N m', PRISMATIC: 'N'}


def is_prismatic(joint_types: Iterable[str]) -> BoolArray:
    """Return which joints are prismatic, shape (n,)."""
    return np.array([kind == PRISMATIC for kind in joint_types], dtype=np.bool_)
