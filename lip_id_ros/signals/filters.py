"""A causal low-pass of measured signals, with its derivative."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array

LONGEST_GAP_S = 0.2
SETTLED = 10.0
"""Time constants after which a two-thousandth of the beginning is left."""


class LowPass:
    """
    Two equal first-order low-passes in a row.

    Signals are delayed by 2 / (2 pi cutoff). Its output is smooth enough for the difference of two
    samples to be its derivative, half way between them: so signals are given there too, or at low
    rates inertial torques would look like friction.
    """

    def __init__(self, cutoff_hz: float) -> None:
        self._time_constant = 1.0 / (2.0 * np.pi * cutoff_hz)
        self._t = np.nan
        self._began = np.nan
        self._first: Array | None = None
        self._second: Array | None = None

    def add(self, t: float, signals: Array) -> tuple[Array, Array] | None:
        """
        Take one sample.

        Return filtered signals and derivatives, None until the beginning is forgotten. A step that
        is not forward, or is too long, begins anew.
        """
        dt = t - self._t
        self._t = t
        if self._first is None or self._second is None or not 0.0 < dt <= LONGEST_GAP_S:
            self._first = self._second = signals.copy()
            self._began = t
            return None
        gain = -np.expm1(-dt / self._time_constant)
        self._first = self._first + gain * (signals - self._first)
        before = self._second
        self._second = before + gain * (self._first - before)
        if t - self._began < SETTLED * self._time_constant:
            return None
        return 0.5 * (before + self._second), (self._second - before) / dt
