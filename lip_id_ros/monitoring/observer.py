"""The part of a quantity's change that a model does not explain."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array


class Observer:
    r"""
    First-order observer of what changes a quantity :math:`p` beside a known rate :math:`m`.

    .. math:: r = K (p - p_0 - \int (m + r)\, dt), \qquad
              \dot r = K (\dot p - m - r)

    So r follows :math:`\dot p - m` like a low-pass of time constant 1 / K, and p is never
    differentiated. The integral is taken by the trapezoidal rule in m and implicitly in r: stable
    for steps of any length.

    Parameters
    ----------
    gain : float
        K [1/s].

    """

    def __init__(self, gain: float) -> None:
        self._gain = gain
        self._t = np.nan
        self._rate: Array = np.zeros(0)
        self._explained: Array = np.zeros(0)

    def update(self, t: float, quantity: Array, rate: Array) -> Array:
        """
        Take one sample.

        Parameters
        ----------
        t : float
            [s]; after the sample before.
        quantity : ndarray
            p; the observer starts from the first one.
        rate : ndarray, of the same shape
            m: its change per second as far as it is known.

        Returns
        -------
        ndarray
            r.

        """
        if np.isnan(self._t):
            self._t, self._rate, self._explained = t, rate, np.array(quantity, dtype=np.float64)
        step = t - self._t
        explained = self._explained + step * 0.5 * (self._rate + rate)
        residual: Array = self._gain * (quantity - explained) / (1.0 + self._gain * step)
        self._t, self._rate, self._explained = t, rate, explained + step * residual
        return residual
