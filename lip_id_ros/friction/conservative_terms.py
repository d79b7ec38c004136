"""Conservative torques that are elected like friction (maths.md, section 12)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.primitives import Column, COSINE, ONE, POSITION, Primitive, SINE
from lip_id_ros.friction.terms import DriveState, FREE


@dataclass(frozen=True)
class Ripple:
    """
    Torque that is periodic in the position, as of a counterweight, a gear or a cogging motor.

    Holtz and Springob, IEEE Trans. Industrial Electronics 1996; of strain wave gears: Ghorbel,
    Gandhi and Alpeter, J. Mechanical Design 2001. It is conservative, not friction.

    Parameters
    ----------
    harmonic : int
        Number of periods a turn.

    """

    harmonic: int
    lower: ClassVar[tuple[float, ...]] = (FREE, FREE)

    @property
    def name(self) -> str:
        """Return what the literature calls it."""
        return {1: 'periodic once a turn', 2: 'periodic twice a turn'}.get(
            self.harmonic, f'ripple {self.harmonic} times a turn'
        )

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 2)."""
        angle = self.harmonic * state.q
        return np.column_stack([np.cos(angle), np.sin(angle)])

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return tuple(
            ((1.0, Primitive(ONE, position=each, harmonic=float(self.harmonic))),)
            for each in (COSINE, SINE)
        )


@dataclass(frozen=True)
class Spring:
    """A linear spring of the joint, as a counterbalance has; its rest position is in `Offset`."""

    name: ClassVar[str] = 'joint spring'
    lower: ClassVar[tuple[float, ...]] = (FREE,)

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        return state.q[:, None]

    def columns(self) -> tuple[Column, ...]:
        """Return the same features as sums of primitives."""
        return (((1.0, Primitive(ONE, position=POSITION)),),)
