r"""
Torques of a contact, from the generalized momentum of the learned model.

With the momentum :math:`p = M \dot q`, the equations of motion read
:math:`\dot p = \tau + \tau_{ext} - g - f + C^T \dot q`, and :math:`C^T \dot q = \partial T /
\partial q` (because :math:`\dot M = C + C^T`). The learned model gives the Coriolis torques
:math:`c = \dot M \dot q - \partial T / \partial q` as a part of a prediction, so

.. math:: \dot p - \tau_{ext} = \tau + \dot M \dot q - (c + g + f)

where :math:`\dot M \dot q` is a central difference of the learned momentum along the motion.
No accelerations are needed (De Luca et al., IROS 2006).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.model import Prediction
from lip_id_ros.monitoring.observer import Observer

GAIN = 50.0
"""Of an observer [1/s]: 63 % of a sudden contact after 20 ms."""

AHEAD = 1e-4
"""Half the time [s] over which the momentum is differentiated along the motion."""


class Predicting(Protocol):
    """A model that answers many states, such as a `Predictor`."""

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        """Torques with their parts, and energies, of N states."""


def momentum_and_rate(model: Predicting, q: Array, dq: Array, tau: Array) -> tuple[Array, Array]:
    """
    Generalized momenta, and their rates where nothing touches the arm.

    Parameters
    ----------
    model : Predicting
    q, dq, tau : ndarray, shape (N, n)
        Measured positions, velocities, torques.

    Returns
    -------
    momentum, rate : ndarray, shape (N, n)
        [N m s or N s] and [N m or N].

    """
    still, shift = np.zeros_like(q), AHEAD * dq
    # One call: three momenta M(.) dq as inertial torques of the "acceleration" dq, then c + g + f.
    answer = model.predict(
        np.concatenate([q, q + shift, q - shift, q]),
        np.concatenate([still, still, still, dq]),
        np.concatenate([dq, dq, dq, still]),
    )
    momentum, after, before, _ = np.split(answer.inertial, 4)
    bias = np.split(answer.tau, 4)[3]
    return momentum, tau + (after - before) / (2 * AHEAD) - bias


class ContactObserver:
    """
    Estimate external torques while the arm moves.

    Parameters
    ----------
    model : Predicting
        Such as a `Predictor`.
    gain : float
        [1/s]; its inverse is the time constant of the estimate.

    """

    def __init__(self, model: Predicting, gain: float = GAIN) -> None:
        self._model = model
        self._observer = Observer(gain)

    def update(self, t: float, q: Array, dq: Array, tau: Array) -> Array:
        """
        Take one measured sample.

        Parameters
        ----------
        t : float
            [s].
        q, dq, tau : ndarray, shape (n,)

        Returns
        -------
        ndarray, shape (n,)
            External torques [N m or N].

        """
        momentum, rate = momentum_and_rate(self._model, q[None], dq[None], tau[None])
        return self._observer.update(t, momentum[0], rate[0])


def external_torques(
    model: Predicting, t: Array, q: Array, dq: Array, tau: Array, gain: float = GAIN
) -> Array:
    """
    Estimate external torques of a whole recording, as `ContactObserver` does sample by sample.

    Parameters
    ----------
    model : Predicting
    t : ndarray, shape (N,)
        [s], increasing.
    q, dq, tau : ndarray, shape (N, n)
    gain : float
        [1/s].

    Returns
    -------
    ndarray, shape (N, n)
        [N m or N].

    """
    observer = Observer(gain)
    terms = zip(t, *momentum_and_rate(model, q, dq, tau), strict=True)
    return np.array([observer.update(float(time), *each) for time, *each in terms])
