r"""
Contacts among the errors of a model: what is sudden, and larger than free motion ever showed.

A model's error changes with the state of the arm, over the time of a movement; a contact sets in
within milliseconds. So the estimated external torque is judged without its slow part:

.. math:: y = r - \bar r, \qquad \dot{\bar r} = \omega (r - \bar r)

Thresholds lie between the largest y of a free motion and the y of the smallest contact that is to
be told: two thirds of the way, in logarithms, since one motion does not show the largest of the
next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import DataError
from lip_id_ros.monitoring.contact import ContactObserver, GAIN, Predicting

CUTOFF_HZ = 4.0
"""What changes more slowly than this is taken for an error of the model."""

NEARER = 2 / 3
"""Where a threshold lies between free motion (0) and contact (1), in logarithms."""


class SuddenPart:
    """
    High-pass of first order.

    Parameters
    ----------
    cutoff_hz : float
        [Hz].

    """

    def __init__(self, cutoff_hz: float = CUTOFF_HZ) -> None:
        self._rate = 2.0 * np.pi * cutoff_hz
        self._t = np.nan
        self._slow: Array = np.zeros(0)

    def update(self, t: float, values: Array) -> Array:
        """
        Take one sample.

        Parameters
        ----------
        t : float
            [s]; after the sample before.
        values : ndarray
            The slow part starts from the first ones.

        Returns
        -------
        ndarray
            Without their slow part.

        """
        if np.isnan(self._t):
            self._t, self._slow = t, np.array(values, dtype=np.float64)
        sudden: Array = values - self._slow
        self._slow = self._slow - np.expm1(-self._rate * (t - self._t)) * sudden
        self._t = t
        return sudden


def sudden_part(t: Array, values: Array, cutoff_hz: float = CUTOFF_HZ) -> Array:
    """Take the sudden part of a whole recording, (N,) times and (N, n) values."""
    part = SuddenPart(cutoff_hz)
    return np.array([part.update(float(time), each) for time, each in zip(t, values, strict=True)])


def shown_of_a_step(gain: float = GAIN, cutoff_hz: float = CUTOFF_HZ) -> float:
    """
    Return the largest sudden part that a contact of 1 N m which sets in at once shows.

    Parameters
    ----------
    gain : float
        Of the observer [1/s].
    cutoff_hz : float
        [Hz].

    """
    ratio = 2.0 * np.pi * cutoff_hz / gain
    # the peak of (exp(-ratio x) - exp(-x)) / (1 - ratio), at x = log(ratio) / (ratio - 1)
    return float(np.exp(-1.0)) if ratio == 1.0 else float(ratio ** (ratio / (1.0 - ratio)))


@dataclass(frozen=True)
class Thresholds:
    """
    What is no longer taken for an error of the model.

    Attributes
    ----------
    torque : ndarray, shape (n,)
        Largest sudden parts of the external torque that are no contact [N m or N].

    """

    torque: Array

    @classmethod
    def between(
        cls,
        free: Array,
        contact: ArrayLike,
        gain: float = GAIN,
        cutoff_hz: float = CUTOFF_HZ,
    ) -> Thresholds:
        """
        Put thresholds between a motion without contact and the smallest contact of interest.

        Parameters
        ----------
        free : ndarray, shape (N, n)
            Sudden parts of the external torques of a motion that the model was not fitted on: on
            the one that it was, they are too small.
        contact : float, or ndarray of shape (n,)
            The smallest contact that is to be told [N m or N].
        gain, cutoff_hz : float
            As the sudden parts were computed.

        Raises
        ------
        DataError
            If a joint shows as much in free motion as with such a contact.

        """
        largest = np.abs(free).max(axis=0)
        shown = shown_of_a_step(gain, cutoff_hz) * np.broadcast_to(contact, largest.shape)
        if np.any(largest >= shown):
            joint = int(np.argmax(largest / shown))
            raise DataError(
                f'a contact of {np.broadcast_to(contact, largest.shape)[joint]:.3g} N m at joint '
                f'{joint + 1} shows as {shown[joint]:.3g} N m, but the free motion went up to '
                f'{largest[joint]:.3g}; ask for a larger contact, or learn from more motion.'
            )
        return cls(largest ** (1 - NEARER) * shown**NEARER)

    def exceeded(self, sudden: Array) -> BoolArray:
        """Which joints are touched, of the shape of `sudden`: (n,) or (N, n)."""
        return np.asarray(np.abs(sudden) > self.torque)


@dataclass(frozen=True)
class Touch:
    """
    What one sample says of contacts, each of shape (n,).

    Attributes
    ----------
    torque : ndarray
        External torques as estimated, errors of the model among them [N m or N].
    sudden : ndarray
        The same without their slow part.

    """

    torque: Array
    sudden: Array


class ContactMonitor:
    """
    Estimate external torques and their sudden part while the arm moves.

    Parameters
    ----------
    model : Predicting
        Such as a `Predictor`.
    gain : float
        Of the observer [1/s].
    cutoff_hz : float
        [Hz].

    """

    def __init__(
        self, model: Predicting, gain: float = GAIN, cutoff_hz: float = CUTOFF_HZ
    ) -> None:
        self._observer = ContactObserver(model, gain)
        self._sudden = SuddenPart(cutoff_hz)

    def update(self, t: float, q: Array, dq: Array, tau: Array) -> Touch:
        """Take one measured sample at t [s], arrays of shape (n,)."""
        torque = self._observer.update(t, q, dq, tau)
        return Touch(torque, self._sudden.update(t, torque))
