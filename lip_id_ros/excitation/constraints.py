"""Limits beside those of the joints: what a motion is made smaller for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.series import FourierMotion

HALVINGS, SHRINK = 8, 0.97


class Constraint(Protocol):
    """A limit that a motion keeps or not."""

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture at which the limit cannot be kept, by a ConfigError that names it."""

    def is_kept(self, motion: FourierMotion, fine: bool) -> bool:
        """Whether a motion keeps it: at every time, or, if not `fine`, at some times."""

    def penalty(self, q: Array, dq: Array, ddq: Array) -> tuple[float, Array]:
        """Return what states beyond it cost, and the gradient of that, shape (3, N, n)."""


@dataclass(frozen=True)
class Constraints:
    """Some limits, all of which a motion keeps."""

    each: Sequence[Constraint] = ()

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture at which one of them cannot be kept, by a ConfigError."""
        for one in self.each:
            one.require_posture(posture)

    def held(self, motion: FourierMotion) -> FourierMotion:
        """Return the motion, or one around the same posture that goes less far."""
        if self._are_kept(motion, fine=True):
            return motion
        motion = self.nearly_held(motion)
        while not self._are_kept(motion, fine=True):
            motion = motion.scaled(SHRINK)
        return motion

    def nearly_held(self, motion: FourierMotion) -> FourierMotion:
        """Return what `held` does, as far as few samples show, in a fraction of the time."""
        if self._are_kept(motion, fine=False):
            return motion
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            kept = self._are_kept(motion.scaled(middle), fine=False)
            low, high = (middle, high) if kept else (low, middle)
        return motion.scaled(low)

    def _are_kept(self, motion: FourierMotion, fine: bool) -> bool:
        return all(one.is_kept(motion, fine) for one in self.each)
