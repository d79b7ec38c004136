"""
Terms of efforts that are those of coupled motors, not of joints (docs/maths.md, section 12).

They come with `Drive.transmitted`.

"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.primitives import Column, LOAD, Primitive, SIGN, VELOCITY
from lip_id_ros.friction.terms import DriveState, FREE


@dataclass(frozen=True)
class LoadTorque:
    """
    A share of the torque of another joint's links.

    Efforts are those of motors that turn more than one joint each, as in a coupled wrist: the
    coupling matrix times the torques of the joints.

    """

    name: ClassVar[str] = 'torque'
    lower: ClassVar[tuple[float, ...]] = (FREE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return state.load[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(LOAD)),),)


@dataclass(frozen=True)
class SharedFriction:
    """
    Shares of the viscous and Coulomb friction of another joint, of any sign (see `LoadTorque`).

    Such a share may drive the joint: it is part of the coupling, not friction of that joint.

    """

    width: float
    name: ClassVar[str] = 'friction'
    lower: ClassVar[tuple[float, ...]] = (FREE, FREE)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 2)."""
        return np.column_stack([state.dq, np.tanh(state.dq / self.width)])

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return ((1.0, Primitive(VELOCITY)),), ((1.0, Primitive(SIGN, self.width)),)
