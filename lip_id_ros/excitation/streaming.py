"""A motion state by state: from where the arm is, and to rest along its path when it is halted."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.trajectory_file import Trajectory

CLOSING_S = 1.0
"""From where the arm is to the motion: at 0.02 rad with 0.04 rad/s and 0.12 rad/s^2 at most."""

State = tuple[Array, Array, Array]
"""q, dq and ddq, each (n,)."""


class StreamedMotion:
    """
    The states of a motion over time.

    In its first second, `closing`, the way from `position`, where the arm is, shape (n,), to the
    motion is closed by a polynomial whose velocity and acceleration are zero at both ends. From
    `halt` on the motion slows down along its path, and rests after `ramp` seconds.
    """

    def __init__(self, planned: Trajectory, position: Array, ramp: float) -> None:
        self._end, self._ramp = float(planned.t[-1]), ramp
        self.closing = min(CLOSING_S, self._end)
        path = CubicHermiteSpline(planned.t, planned.q, planned.dq)
        speed = CubicHermiteSpline(planned.t, planned.dq, planned.ddq)
        self._path = path, speed, speed.derivative()
        self._away = position - planned.q[0]
        self._halted_at = np.inf

    def halt(self, t: float) -> None:
        """Slow down from a time after the start [s] on."""
        self._halted_at = min(self._halted_at, t)

    def is_over(self, t: float) -> bool:
        """Whether the arm should be at rest, at a time after the start [s]."""
        return t >= min(self._end, self._halted_at + self._ramp)

    def state(self, t: float) -> State:
        """Return the state at a time after the start [s], each (n,)."""
        along, rate, slowing = self._time_law(t)
        q, dq, ddq = (of(along) for of in self._path)
        share, by_t, by_tt = _closing(along / self.closing)
        q = q + share * self._away
        dq = dq + by_t / self.closing * self._away
        ddq = ddq + by_tt / self.closing**2 * self._away
        return q, rate * dq, rate**2 * ddq + slowing * dq

    def _time_law(self, t: float) -> tuple[float, float, float]:
        """Return the time along the path, and its first two derivatives by time."""
        rests_at = self._halted_at + self._ramp
        since = min(t, rests_at) - self._halted_at
        if since > 0.0:
            along = self._halted_at + since - 0.5 * since**2 / self._ramp
            rate, slowing = 1.0 - since / self._ramp, -1.0 / self._ramp
        else:
            along, rate, slowing = t, 1.0, 0.0
        if t >= rests_at or along >= self._end:
            return min(along, self._end), 0.0, 0.0
        return along, rate, slowing


def _closing(x: float) -> tuple[float, float, float]:
    """Return 1 - 10 x^3 + 15 x^4 - 6 x^5 and its first two derivatives; zero from x = 1 on."""
    if x >= 1.0:
        return 0.0, 0.0, 0.0
    return (
        1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x**2),
        -30.0 * (x * (1.0 - x)) ** 2,
        -60.0 * x * (1.0 - x) * (1.0 - 2.0 * x),
    )
