"""
Samples brought to a uniform grid of times.

Filters and derivatives need uniform steps, recordings have jitter and lost messages. Monotone
cubic interpolation (PCHIP) was chosen by measurement: where stamps jitter by 30 % of the step or a
tenth of the messages is lost, the error it adds to accelerations is 3 to 10 times smaller than
that of linear interpolation at 30 Hz; and it never overshoots, where a cubic spline turns bursts
of nearly equal stamps into accelerations wrong by 14 % at noise that others take for 2 to 3 %.

"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from lip_id_ros.arrays import Array

_ROUNDING = 1e-6


def uniform_times(t: Array, rate_hz: float) -> Array:
    """Return times at a rate, from the first of `t` and not beyond the last [s]."""
    steps = int((t[-1] - t[0]) * rate_hz + _ROUNDING)
    times: Array = np.minimum(t[0] + np.arange(steps + 1) / rate_hz, t[-1])
    return times


def resample(t: Array, values: Array, times: Array) -> Array:
    """
    Interpolate samples, monotone between each two of them.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Strictly increasing times [s], at least two.
    values : ndarray, shape (N, n)
        Samples at `t`.
    times : ndarray, shape (K,)
        Within `t` [s].

    Returns
    -------
    ndarray, shape (K, n)

    """
    interpolated: Array = PchipInterpolator(t, values, axis=0)(times)
    return interpolated
