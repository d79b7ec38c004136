"""
Delays of efforts, elected by the prediction of left-out blocks.

A drive measures or transmits its effort late by a constant time, and all drives of a bus may do so
alike: a common delay is elected first, then those of single joints around it.

"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.loading.left_out_torques import LAGS_S, LeftOutTorques, Smoothed

COMMON_S = np.linspace(-0.16, 0.16, 17)
OWN_S = np.linspace(-0.02, 0.02, 9)
"""Delays of all efforts, and of single joints around it; what lags more is no drive's delay."""

REACH_S = float(COMMON_S[-1] + OWN_S[-1] + max(map(abs, LAGS_S)))
"""How far from an effort motions are looked at."""

LEAST_DELAY_S = 0.0005
SWEEPS = 2

LEAST_ERRORS = 3.0
"""Least gain in standard errors over the left-out blocks."""

LEAST_GAIN = 0.01
"""Least relative decrease of mean squared errors, in the mean over joints."""

Squares = Array
"""Mean squared errors of left-out blocks and joints, shape (blocks, n)."""


def convincing(now: Squares, other: Squares, errors: float) -> bool:
    """Whether errors decrease by more than chance may do, over blocks and in total."""
    gain = np.log(now / other).mean(axis=1)
    error = float(gain.std(ddof=1) / np.sqrt(gain.size))
    total = float(np.log(now.mean(axis=0) / other.mean(axis=0)).mean())
    return float(gain.mean()) > max(errors * error, LEAST_GAIN) and total > LEAST_GAIN


class DelayElection:
    """
    Delays of efforts behind motions.

    Parameters
    ----------
    judge : LeftOutTorques
    smoothed : Smoothed

    """

    def __init__(self, judge: LeftOutTorques, smoothed: Smoothed) -> None:
        self._judge, self._smoothed = judge, smoothed
        self._n = len(judge.noise_std)
        self._known: dict[float, Array] = {}
        self._reduced: dict[float, Array] = {}

    def elected(self) -> tuple[Array, dict[str, Any]]:
        """Return the delay of each joint, 0 where none is sure [s], and figures."""
        none = np.zeros(self._n)
        common = np.full(self._n, self._common())
        start = common if self._is_sure(none, common) else none
        found = self._own(start)
        delays = found.copy()
        for joint in range(self._n):
            without = delays.copy()
            without[joint] = start[joint]
            if not self._is_sure(without, delays, joint):
                delays = without
        squares = [self._judge.squares(self._grams(each)) for each in (none, delays)]
        before, after = (self._judge.percent(each) for each in squares)
        return delays, {
            'most_likely_delay_s': found.tolist(),
            'unexplained_without_delays_percent': before,
            'unexplained_with_delays_percent': after,
        }

    def _common(self) -> float:
        costs = [self._cost(np.full(self._n, delay)) for delay in COMMON_S]
        delay, step = float(COMMON_S[int(np.argmin(costs))]), OWN_S[1] - OWN_S[0]
        return delay + self._correction(
            [self._cost(np.full(self._n, delay + k * step)) for k in (-1, 0, 1)], step
        )

    def _own(self, start: Array) -> Array:
        """Descend along the delay of one joint after the other."""
        index = np.full(self._n, OWN_S.size // 2)
        for _ in range(SWEEPS):
            for joint in range(self._n):
                costs = self._costs(start, index, joint)
                index[joint] = np.clip(np.argmin(costs), 1, OWN_S.size - 2)
        delays: Array = start + OWN_S[index]
        step = OWN_S[1] - OWN_S[0]
        for joint in range(self._n):
            costs = self._costs(start, index, joint)
            inner = costs[index[joint] - 1 : index[joint] + 2]
            if inner[1] > min(inner):  # at the end of what is tried: no delay of a drive
                delays[joint] = start[joint]
            else:
                delays[joint] += self._correction(inner, step)
        return delays

    def _costs(self, start: Array, index: Array, joint: int) -> list[float]:
        trials = []
        for own in OWN_S:
            delays = start + OWN_S[index]
            delays[joint] = start[joint] + own
            trials.append(self._cost(delays))
        return trials

    @staticmethod
    def _correction(costs: Sequence[float], step: float) -> float:
        """Return where a parabola through three costs is lowest, from the middle one."""
        curvature = costs[0] - 2.0 * costs[1] + costs[2]
        if curvature <= 0.0:
            return 0.0
        return float(np.clip(0.5 * (costs[0] - costs[2]) / curvature, -1.0, 1.0) * step)

    def _is_sure(self, without: Array, delays: Array, joint: int | None = None) -> bool:
        if np.abs(delays - without).max() < LEAST_DELAY_S:
            return False
        now, other = (self._judge.squares(self._grams(each)) for each in (without, delays))
        if joint is not None:
            now, other = now[:, [joint]], other[:, [joint]]
        return convincing(now, other, LEAST_ERRORS)

    def _cost(self, delays: Array) -> float:
        reduced = [self._reduced_at(delay)[joint] for joint, delay in enumerate(delays.tolist())]
        return self._judge.least_squares(np.sum(reduced, axis=0))[1]

    def _reduced_at(self, delay: float) -> Array:
        key = round(delay, 7)
        if key not in self._reduced:
            gram = self._at(delay).sum(axis=0)
            self._reduced[key], _ = self._judge.without_friction(gram)
        return self._reduced[key]

    def _grams(self, delays: Array) -> Array:
        grams = [self._at(delay)[:, joint] for joint, delay in enumerate(delays.tolist())]
        return np.stack(grams, axis=1)

    def _at(self, delay: float) -> Array:
        key = round(delay, 7)
        if key not in self._known:
            self._known[key] = self._judge.grams(self._smoothed, delay)
        return self._known[key]
