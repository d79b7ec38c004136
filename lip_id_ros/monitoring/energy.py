r"""
Balance of the learned total energy with the power that drives supply.

.. math:: \frac{d}{dt}(T + V) = \dot q^T (\tau - f) + P_{ext}

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.monitoring.contact import GAIN, Predicting
from lip_id_ros.monitoring.observer import Observer


@dataclass(frozen=True)
class EnergyBalance:
    """
    Energy at one time.

    Attributes
    ----------
    total : float
        Kinetic and potential energy [J]. Kinetic only, where the torques leave gravity out.
    supplied : float
        Power of the measured torques, less the learned friction's [W].
    unexplained : float
        Power [W] that enters beside it: of a contact, or of the model's errors.

    """

    total: float
    supplied: float
    unexplained: float


class EnergyMonitor:
    """
    Compare the change of the learned energy with the power supplied.

    Parameters
    ----------
    model : Predicting
        Such as a `Predictor`.
    gain : float
        [1/s]; its inverse is the time constant of the unexplained power.

    """

    def __init__(self, model: Predicting, gain: float = GAIN) -> None:
        self._model = model
        self._observer = Observer(gain)

    def update(self, t: float, q: Array, dq: Array, tau: Array) -> EnergyBalance:
        """
        Take one measured sample.

        Parameters
        ----------
        t : float
            [s].
        q, dq, tau : ndarray, shape (n,)

        """
        answer = self._model.predict(q[None], dq[None], np.zeros((1, len(q))))
        total = answer.kinetic[0]
        if answer.potential is not None:
            total = total + answer.potential[0]
        supplied = dq @ (tau - answer.friction[0])
        unexplained = self._observer.update(t, np.asarray(total), np.asarray(supplied))
        return EnergyBalance(float(total), float(supplied), float(unexplained))
