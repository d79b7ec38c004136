"""Steps from the torque that a robot holds to another: a linear ramp, and a limit on the rate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError


class LimitsFrom(StrEnum):
    """Where limits of torques come from; the URDF of the robot is read by a node."""

    PARAMETERS = 'parameters'
    DESCRIPTION = 'robot_description'
    NONE = 'none'


DEFAULT_RATE = 20.0
"""Rate limit by torque limit [1/s], where none is given: a full swing takes 0.1 s at least."""

LONGEST_TORQUE_STEP_S = 0.05
"""Ramps and rate limits count no more time than this between two torques: after a pause, the next
torque is a step for the robot, however long the pause was."""


NOT_READ_YET = (0.0,)
"""In place of limits of a URDF that is still to be read: no torque but zero."""


def limits_in_force(limits: Sequence[float], source: str) -> Sequence[float]:
    """Return limits in force: none without limits, `NOT_READ_YET` before a URDF is read."""
    if source == LimitsFrom.NONE:
        return ()
    return limits or (NOT_READ_YET if source == LimitsFrom.DESCRIPTION else ())


def require_limits(name: str, limits: Sequence[float], source: str) -> None:
    """Refuse limits that are missing, or not read from a URDF yet, with ConfigError."""
    if limits or source == LimitsFrom.NONE:
        return
    if source == LimitsFrom.DESCRIPTION:
        raise ConfigError(
            f'{name}_from must not be {source} here, which is read only when torques begin; '
            'deactivate the node first.'
        )
    raise ConfigError(
        f'{name} must hold the largest of each joint or one for all, but is empty; for a '
        f'simulation without limits give {name}_from: {LimitsFrom.NONE}.'
    )


@dataclass(frozen=True, eq=False)
class Sent:
    """
    The torque that the robot holds.

    `tau`, shape (n,) [N m or N]. `at`: when it was sent [s], on any steady clock.
    """

    tau: Array
    at: float = -np.inf

    def step_toward(self, wanted: Array, now: float, rates: Array) -> Array:
        """Return the torque (n,) nearest to the wanted one that rates (n,) allow at a time."""
        elapsed = min(max(now - self.at, 1e-6), LONGEST_TORQUE_STEP_S)
        return toward(self.tau, wanted, elapsed * rates)

    @property
    def in_words(self) -> str:
        """The torque, in words."""
        largest = float(np.abs(self.tau).max(initial=0.0))
        return f'torques up to {largest:.3g} N m or N' if largest else 'zero torque'


class Ramp:
    """
    A linear blend from the torque that the robot holds to whatever is wanted.

    The share of the wanted torque grows with time at a slope of one over the present duration.
    Another duration changes the slope from here on, not the share. Between two torques
    no more than `LONGEST_TORQUE_STEP_S` counts.
    """

    def __init__(self) -> None:
        self._origin: Array | None = None
        self._share, self._at = 1.0, -np.inf

    def begin(self) -> None:
        """Start again at share 0 with the next torque, whenever it comes."""
        self._origin, self._share = None, 0.0

    def blend(self, held: Array, wanted: Array, now: float, duration_s: float) -> Array:
        """Return the torque at this time [s], for a ramp that takes `duration_s` in all."""
        if self._share >= 1.0:
            return wanted
        if self._origin is None:
            self._origin, self._at = held, now
        elapsed, self._at = min(max(now - self._at, 0.0), LONGEST_TORQUE_STEP_S), now
        self._share += elapsed / duration_s if duration_s > 0.0 else 1.0
        if self._share >= 1.0:
            return wanted
        return (1.0 - self._share) * self._origin + self._share * wanted


def toward(held: Array, wanted: Array, step: Array) -> Array:
    """Return the value nearest to the wanted one, at most a step from the one held."""
    return between(wanted, held - step, held + step)


def between(values: Array, low: Array, high: Array) -> Array:
    """Return the values, cut to a range."""
    # np.clip does the same, for a few numbers in five times the time
    return np.minimum(np.maximum(values, low), high)
