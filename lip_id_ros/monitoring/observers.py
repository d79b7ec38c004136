r"""
Observers of external torques (momentum observer) and of the balance of energy.

With the momentum :math:`p = M \dot q`, the equations of motion read
:math:`\dot p = \tau + \tau_{ext} - g - f + C^T \dot q`, and :math:`C^T \dot q = \partial T /
\partial q` (because :math:`\dot M = C + C^T`). The learned model gives the Coriolis torques
:math:`c = \dot M \dot q - \partial T / \partial q` as a part of a prediction, so

.. math:: \dot p - \tau_{ext} = \tau + \dot M \dot q - (c + g + f)

where :math:`\dot M \dot q` is a central difference of the learned momentum along the motion.
No accelerations are needed (De Luca et al., IROS 2006).

The total energy follows :math:`\frac{d}{dt}(T + V) = \dot q^T (\tau - f) + P_{ext}`, by the same
observer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.model import DynamicsModel

GAIN = 50.0
"""Of an observer [1/s]: 63 % of a sudden contact after 20 ms."""

AHEAD = 1e-4
"""Half the time [s] over which the momentum is differentiated along the motion."""


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


def momentum_and_rate(
    model: DynamicsModel, q: Array, dq: Array, tau: Array
) -> tuple[Array, Array]:
    """Compute generalised momenta, and their rates without contact, each (N, n) [N m s, N m]."""
    still, shift = np.zeros_like(q), AHEAD * dq
    # One call: three momenta M(.) dq as inertial torques of the "acceleration" dq, then c + g + f.
    predicted = model.predict(
        np.concatenate([q, q + shift, q - shift, q]),
        np.concatenate([still, still, still, dq]),
        np.concatenate([dq, dq, dq, still]),
    )
    momentum, after, before, _ = np.split(predicted.inertial, 4)
    bias = np.split(predicted.tau, 4)[3]
    return momentum, tau + (after - before) / (2 * AHEAD) - bias


class ContactObserver:
    """Estimate external torques while the arm moves; 1 / gain is the time constant [s]."""

    def __init__(self, model: DynamicsModel, gain: float = GAIN) -> None:
        self._model = model
        self._observer = DisturbanceObserver(gain)

    def update(self, t: float, q: Array, dq: Array, tau: Array) -> Array:
        """Return the external torques (n,) [N m or N] at a sample."""
        momentum, rate = momentum_and_rate(self._model, q[None], dq[None], tau[None])
        return self._observer.update(t, momentum[0], rate[0])


def external_torques(
    model: DynamicsModel, t: Array, q: Array, dq: Array, tau: Array, gain: float = GAIN
) -> Array:
    """Estimate the external torques (N, n) of a recording as `ContactObserver` does."""
    observer = DisturbanceObserver(gain)
    terms = zip(t, *momentum_and_rate(model, q, dq, tau), strict=True)
    return np.array([observer.update(float(time), *each) for time, *each in terms])


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

    def __init__(self, model: DynamicsModel, gain: float = GAIN) -> None:
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
