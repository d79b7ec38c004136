"""Where joint states say that an arm is, and why no motion may begin there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from lip_id_ros.arrays import Array

MOST_KINDS = 100
"""Messages with so many different sets of joints are told apart."""


class Measured:
    """The last positions of joints by name [rad or m], and the times [s] at which they came."""

    def __init__(self, stale_s: float) -> None:
        self._stale_s = stale_s
        self.positions: dict[str, float] = {}
        self._heard_at: dict[str, float] = {}
        self._together: dict[frozenset[str], float] = {}

    def take(self, names: Sequence[str], positions: Iterable[float], now: float) -> None:
        """Take a joint state."""
        self.positions.update(zip(names, positions, strict=True))
        self._heard_at.update(dict.fromkeys(names, now))
        joints = frozenset(names)
        self._together.pop(joints, None)  # the oldest one is the first
        self._together[joints] = now
        while len(self._together) > MOST_KINDS:
            del self._together[next(iter(self._together))]

    def now_at(self, names: Sequence[str], now: float) -> Array | None:
        """Return the positions of joints, shape (n,); None where one is not known now."""
        if any(self._silence(name, now) > self._stale_s for name in names):
            return None
        return np.array([self.positions[name] for name in names])

    def reason_to_wait(
        self, names: Sequence[str], posture: Array, tolerance: Array, now: float
    ) -> str | None:
        """Return why no motion of joints may begin at a posture (n,), or None."""
        return self.reason_not_to_watch(names, now) or self._not_there(names, posture, tolerance)

    def reason_not_to_watch(self, names: Sequence[str], now: float) -> str | None:
        """Return why nobody could watch a motion of joints, or None."""
        for name in names:
            if (silence := self._silence(name, now)) > self._stale_s:
                return f'no joint state of {name} for {silence:.3g} s; start the driver'
        recent = [each for each, at in self._together.items() if now - at <= self._stale_s]
        if any(each.issuperset(names) for each in recent):
            return None
        first = max(recent, key=lambda each: len(each.intersection(names)), default=frozenset())
        lacking = [name for name in names if name not in first]
        return (
            f'no message of joint_states has all joints of the motion: {", ".join(lacking)} and '
            f'{", ".join(name for name in names if name in first)} come in different ones; have '
            'one publisher send all of them, such as one joint_state_broadcaster'
        )

    def _not_there(self, names: Sequence[str], posture: Array, tolerance: Array) -> str | None:
        for name, planned, most in zip(names, posture, tolerance, strict=True):
            away = abs(self.positions.get(name, np.nan) - planned)
            if not away <= most:
                return (
                    f'{name} must be at {planned:.4g} for the motion, within start_tolerance, but '
                    f'is {away:.3g} away; move the arm there'
                )
        return None

    def _silence(self, name: str, now: float) -> float:
        return now - self._heard_at.get(name, -np.inf)
