"""Which answers reached a loop in time."""

from __future__ import annotations

from collections.abc import Iterator
import time

import numpy as np

from lip_id_ros.arrays import Array

AHEAD = (1, 2, 5)
"""How many ticks ahead a question may be asked."""


class Timeline:
    """
    Ticks of a wall clock, and when each was asked and answered.

    Parameters
    ----------
    n_ticks : int
    period : float
        Between two of them [s].

    """

    def __init__(self, n_ticks: int, period: float) -> None:
        self.n_ticks = n_ticks
        self._period = period
        self._due = np.full(n_ticks, np.nan)
        self._asked = np.full(n_ticks, np.nan)
        self._answered = np.full(n_ticks, np.nan)
        self._unsafe = 0

    def ticks(self) -> Iterator[int]:
        """Yield the number of each tick when it is due, or at once where that has passed."""
        begin = time.perf_counter() + self._period
        for number in range(self.n_ticks):
            self._due[number] = begin + number * self._period
            ahead = self._due[number] - time.perf_counter()
            if ahead > 0:
                time.sleep(ahead)
            yield number

    def asked(self, number: int) -> None:
        """Note that a tick asks for its torque now."""
        self._asked[number] = time.perf_counter()

    def answered(self, number: int, safe: bool) -> None:
        """Note an answer; those to no tick are of the time before."""
        if 0 <= number < self.n_ticks and not np.isnan(self._asked[number]):
            self._answered[number] = time.perf_counter()
            self._unsafe += not safe

    @property
    def n_lost(self) -> int:
        """Number of ticks without an answer."""
        return int(np.isnan(self._answered).sum())

    def figures(self) -> dict[str, float]:
        """
        Return what the loop saw.

        An answer is missed that comes later than a period after its question, or never, so that
        a robot that is late itself does not count against what answers it. Where references are
        sent ticks ahead, answers have so many periods.

        """
        times = self._answered - self._asked
        answered = times[~np.isnan(times)]
        intervals = np.diff(self._answered[~np.isnan(self._answered)])
        return {
            'ticks': self.n_ticks,
            'lost': int(np.isnan(times).sum()),
            **{f'missed_percent_{ticks}': self._missed(times, ticks) for ticks in AHEAD},
            'unsafe': self._unsafe,
            'answer_ms_median': 1e3 * float(np.median(answered)),
            'answer_ms_p99': 1e3 * float(np.quantile(answered, 0.99)),
            'answer_ms_max': 1e3 * float(answered.max()),
            'interval_ms_std': 1e3 * float(intervals.std()),
            'interval_ms_p99': 1e3 * float(np.quantile(intervals, 0.99)),
            'robot_late_percent': 100
            * float(np.mean(self._asked - self._due > 0.5 * self._period)),
        }

    def _missed(self, times: Array, ticks: int) -> float:
        return 100 * float(1 - (times <= ticks * self._period).sum() / self.n_ticks)
