"""How far, how fast and how hard a simulated arm moves."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError, ShapeError


@dataclass(frozen=True)
class MotionLimits:
    """
    Bounds that a trajectory respects, one per joint.

    Attributes
    ----------
    q_min, q_max : ndarray, shape (n,)
        Positions [rad or m].
    dq_max, ddq_max : ndarray, shape (n,)
        Largest absolute velocities and accelerations [rad/s or m/s, rad/s^2 or m/s^2].

    Raises
    ------
    ShapeError
        If the four bounds differ in length.
    DataError
        If a range is empty.

    """

    q_min: Array
    q_max: Array
    dq_max: Array
    ddq_max: Array

    def __post_init__(self) -> None:
        for field in fields(self):
            object.__setattr__(self, field.name, _frozen(getattr(self, field.name)))
        shapes = {getattr(self, field.name).shape for field in fields(self)}
        if len(shapes) != 1 or len(next(iter(shapes))) != 1:
            raise ShapeError(
                f'motion limits must have one number per joint each, not shapes {sorted(shapes)}.'
            )
        empty = (self.q_min >= self.q_max) | (self.dq_max <= 0) | (self.ddq_max <= 0)
        if np.any(empty):
            raise DataError(
                f'motion limits leave joint {int(np.argmax(empty)) + 1} no room to move; '
                'widen its range of position, velocity or acceleration.'
            )

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.q_min)

    @property
    def centre(self) -> Array:
        """Middle of the position range [rad or m], shape (n,)."""
        return (self.q_min + self.q_max) / 2

    def first(self, n_joints: int) -> MotionLimits:
        """Keep the limits of the first `n_joints` joints."""
        return MotionLimits(*(getattr(self, field.name)[:n_joints] for field in fields(self)))


def _frozen(values: ArrayLike) -> Array:
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array
