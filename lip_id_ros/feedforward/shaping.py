"""The last steps before a torque leaves: scale, limits, ramp, rate, limits (ADR 8)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.feedforward.rules import Rules
from lip_id_ros.signals.joints import Refusal, RefusedError

LONGEST_STEP_S = 0.05
"""A rate limit counts no more time than this between two torques: what comes after a pause is a
step for the robot, however long the pause was."""


@dataclass(frozen=True, eq=False)
class Sent:
    """
    What the robot was told last.

    Attributes
    ----------
    tau : ndarray, shape (n,)
        [N m or N].
    at : float
        When [s], on any steady clock.

    """

    tau: Array
    at: float = -np.inf


class Shaper:
    """
    Bring torques into the form in which they may leave.

    Parameters
    ----------
    rules : Rules
    sent : Sent
        What the robot holds.
    counts : Counter
        Gets `limited` and `rate_limited`: samples and points of plans that were cut.

    Attributes
    ----------
    rules : Rules
        May be replaced by others of the same joints.
    sent : Sent

    """

    def __init__(self, rules: Rules, sent: Sent, counts: Counter[str]) -> None:
        self.rules = rules
        self.sent = sent
        self._counts = counts
        self._from = Sent(sent.tau)

    def begin(self, now: float) -> None:
        """Ramp in from what the robot holds."""
        self._from = Sent(self.sent.tau, now)

    def sample(self, tau: Array, now: float) -> Array:
        """
        Shape one torque of a stream.

        Parameters
        ----------
        tau : ndarray, shape (n,)
            [N m or N].
        now : float
            [s].

        Returns
        -------
        ndarray, shape (n,)
            Finite, within the limits, no further from the one before than the rates allow.

        Raises
        ------
        RefusedError
            If a torque is not finite.

        """
        wanted, limited = self._scaled(tau)
        share = self._share(now)
        ramped = wanted if share >= 1.0 else (1.0 - share) * self._from.tau + share * wanted
        elapsed = min(max(now - self.sent.at, 1e-6), LONGEST_STEP_S)
        rated = _toward(self.sent.tau, ramped, elapsed * self.rules.rates)
        # again, since the limits may have become narrower than what was sent last
        safe = _between(rated, -self.rules.limits, self.rules.limits)
        self._counts['limited'] += int(limited.any())
        self._counts['rate_limited'] += int((rated != ramped).any())
        self.sent = Sent(safe, now)
        return safe

    def plan(self, tau: Array, t: Array) -> Array:
        """
        Shape the torques of a plan; a ramp is for streams, a plan begins where it says.

        Parameters
        ----------
        tau : ndarray, shape (N, n)
            [N m or N].
        t : ndarray, shape (N,)
            Times from start [s].

        Raises
        ------
        RefusedError
            If a torque is not finite.

        """
        safe, limited = self._scaled(tau)
        self._counts['limited'] += int(np.count_nonzero(limited.any(axis=-1)))
        if np.isfinite(self.rules.rates).any():
            self._counts['rate_limited'] += _slow_down(safe, t, self.rules.rates)
        return safe

    def _scaled(self, tau: Array) -> tuple[Array, BoolArray]:
        scaled = self.rules.scale * tau
        if not np.isfinite(scaled).all():
            raise RefusedError(Refusal.NOT_FINITE_TORQUE)
        safe = _between(scaled, -self.rules.limits, self.rules.limits)
        return safe, safe != scaled

    def _share(self, now: float) -> float:
        """How much of the ramp is done, from 0 to 1."""
        elapsed = now - self._from.at
        return 1.0 if elapsed >= self.rules.ramp_s else max(elapsed, 0.0) / self.rules.ramp_s


def _toward(held: Array, wanted: Array, step: Array) -> Array:
    return _between(wanted, held - step, held + step)


def _between(values: Array, low: Array, high: Array) -> Array:
    # np.clip does the same, for a few numbers in five times the time
    return np.minimum(np.maximum(values, low), high)


def _slow_down(tau: Array, t: Array, rates: Array) -> int:
    """Hold the slopes between the points of a plan within the rates; return how many were cut."""
    cut = 0
    elapsed = np.maximum(np.diff(t), 1e-6)
    for row, seconds in enumerate(elapsed, start=1):
        slower = _toward(tau[row - 1], tau[row], seconds * rates)
        cut += int((slower != tau[row]).any())
        tau[row] = slower
    return cut
