r"""
Balance of energy of an arm that moves.

The total energy E follows :math:`\dot E = m + P` with the power :math:`m = \dot q^T (\tau - f)`
that the drives supply. An observer of first order finds the power P that is not explained, without
differentiating the energy:

.. math:: r = K (E - E_0 - \int (m + r)\, dt), \qquad
          \dot r = K (\dot E - m - r)

The integral is taken by the trapezoidal rule in m and implicitly in r: stable for steps of any
length.
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
    """Compare the change of the learned energy with the power supplied; `gain`: K [1/s]."""

    def __init__(self, model: Predictor, gain: float = GAIN) -> None:
        self._model, self._gain = model, gain
        self._t, self._supplied, self._explained = np.nan, 0.0, 0.0

    def update(self, t: float, q: Array, dq: Array, tau: Array) -> EnergyBalance:
        """Take one measured sample at t [s], of states and torques (n,)."""
        predicted = self._model.predict(q[None], dq[None], np.zeros((1, len(q))))
        total = float(predicted.kinetic[0])
        if predicted.potential is not None:
            total += float(predicted.potential[0])
        supplied = float(dq @ (tau - predicted.friction[0]))
        if np.isnan(self._t):
            self._t, self._supplied, self._explained = t, supplied, total
        step = t - self._t
        explained = self._explained + step * 0.5 * (self._supplied + supplied)
        unexplained = self._gain * (total - explained) / (1.0 + self._gain * step)
        self._t, self._supplied, self._explained = t, supplied, explained + step * unexplained
        return EnergyBalance(total, supplied, unexplained)
