"""Friction that remembers how a joint came to where it is (maths.md, section 12)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.primitives import Column
from lip_id_ros.friction.terms import DriveState, NOT_NEGATIVE, smooth_sign
from lip_id_ros.joint_history import DISPLACEMENTS


@dataclass(frozen=True)
class Dahl:
    """
    Dry friction whose state turns with the displacement, not with the sign of the velocity.

    Dahl 1968; Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 1994. An arm that stands
    is held by what is left of its last motion. The term is the difference to the smooth sign of
    the velocity, of Coulomb friction's width [rad/s or m/s]: nothing of single states.
    `displacement` is one of `DISPLACEMENTS` [rad or m].
    """

    width: float
    displacement: float
    name: ClassVar[str] = 'Dahl hysteresis'
    lower: ClassVar[tuple[float, ...]] = (NOT_NEGATIVE,)

    def __post_init__(self) -> None:
        """Check the displacement; ValueError where no states are kept for it."""
        if self.displacement not in DISPLACEMENTS:
            raise ValueError(f'a displacement of Dahl friction that is none of {DISPLACEMENTS}')

    def features(self, state: DriveState) -> Array:
        """Return the features, shape (N, 1)."""
        if state.dahl is None:
            return np.zeros((len(state.dq), 1))
        own = state.dahl[:, DISPLACEMENTS.index(self.displacement)]
        return (own - smooth_sign(state, self.width))[:, None]

    def unknown_std(self, state: DriveState, share: Array) -> Array:
        """
        Return the deviation (N,) of the feature where a share of the state is unknown.

        A joint that moves has friction of its sign; one that rests has any (`unknown_share`).
        """
        own = share[:, DISPLACEMENTS.index(self.displacement)]
        return np.asarray(
            own * np.sqrt(1.0 - np.minimum(smooth_sign(state, self.width) ** 2, 1.0))
        )

    def columns(self) -> tuple[Column, ...]:
        """Return the features of single states, which show nothing of the past."""
        return ((),)
