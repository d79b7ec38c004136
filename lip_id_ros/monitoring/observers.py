r"""
Balance of energy of an arm that moves.

The total energy follows :math:`\frac{d}{dt}(T + V) = \dot q^T (\tau - f) + P_{ext}`: an observer
of first order finds the power that is not explained, without differentiating the energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.model import Prediction

GAIN = 50.0
"""Of the observer [1/s]: 63 % of a sudden power after 20 ms."""


class Predictor(Protocol):
    """What the observers ask of a model."""

    @property
    def training_range(self) -> tuple[Array, Array]:
        """Lowest and highest q, dq and ddq of the training data, each of shape (3, n)."""

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        """Torques with their parts and energies at N joint states, of shape (N, n)."""


class DisturbanceObserver:
    r"""
    First-order observer of the rate of a quantity :math:`p` beyond a known rate :math:`m`.

    .. math:: r = K (p - p_0 - \int (m + r)\, dt), \qquad
              \dot r = K (\dot p - m - r)

    So r follows :math:`\dot p - m` like a low-pass of time constant 1 / K, and p is never
    differentiated. The integral is taken by the trapezoidal rule in m and implicitly in r: stable
    for steps of any length.

    `gain`: K [1/s].
    """

    def __init__(self, gain: float) -> None:
        self._gain = gain
        self._t = np.nan
        self._rate: Array = np.zeros(0)
        self._explained: Array = np.zeros(0)

    def update(self, t: float, quantity: Array, rate: Array) -> Array:
        """Take the quantity p and its known rate m at a time t [s] after the last; return r."""
        if np.isnan(self._t):
            self._t, self._rate, self._explained = t, rate, np.array(quantity, dtype=np.float64)
        step = t - self._t
        explained = self._explained + step * 0.5 * (self._rate + rate)
        residual: Array = self._gain * (quantity - explained) / (1.0 + self._gain * step)
        self._t, self._rate, self._explained = t, rate, explained + step * residual
        return residual


@dataclass(frozen=True)
class EnergyBalance:
    """
    Energy at one time.

    `total`: kinetic and potential [J]; kinetic only, where the torques leave gravity out.
    `supplied`: power of the measured torques, less the learned friction's [W]. `unexplained`:
    power that enters beside it: of a contact, or of the model's errors.
    """

    total: float
    supplied: float
    unexplained: float


class EnergyMonitor:
    """Compare the change of the learned energy with the power supplied in 1 / gain [s]."""

    def __init__(self, model: Predictor, gain: float = GAIN) -> None:
        self._model = model
        self._observer = DisturbanceObserver(gain)

    def update(self, t: float, q: Array, dq: Array, tau: Array) -> EnergyBalance:
        """Take one measured sample at t [s], of states and torques (n,)."""
        predicted = self._model.predict(q[None], dq[None], np.zeros((1, len(q))))
        total = predicted.kinetic[0]
        if predicted.potential is not None:
            total = total + predicted.potential[0]
        supplied = dq @ (tau - predicted.friction[0])
        unexplained = self._observer.update(t, np.asarray(total), np.asarray(supplied))
        return EnergyBalance(float(total), float(supplied), float(unexplained))
