r"""
Detect contacts in residual torques: sudden, and larger than in free motion.

A model's error changes with the state of the arm, over the time of a movement; a contact sets in
within milliseconds. So the estimated external torque goes through a high-pass before it is judged:

.. math:: y = r - \bar r, \qquad \dot{\bar r} = \omega (r - \bar r)

Thresholds lie between the largest y of a free motion and the y of the smallest contact that is to
be detected: two thirds of the way, in logarithms, since one motion does not show the largest of
the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import DataError
from lip_id_ros.model import DynamicsModel
from lip_id_ros.monitoring.observers import ContactObserver, GAIN
from lip_id_ros.signals.filters import HighPass

CUTOFF_HZ = 4.0
"""What changes more slowly than this is taken for an error of the model."""

NEARER = 2 / 3
"""Where a threshold lies between free motion (0) and contact (1), in logarithms."""

UNSETTLED = 0.01
"""Share of an offset that an observer may still lack when its estimate is judged."""

LEAST_MOTION = 0.2
"""Share of the training data's range of velocities that calibration must see of every joint."""


def step_response_peak(gain: float = GAIN, cutoff_hz: float = CUTOFF_HZ) -> float:
    """Return the peak of the high-pass [Hz] for a contact of 1 N m; the gain is in 1/s."""
    ratio = 2.0 * np.pi * cutoff_hz / gain
    # the peak of (exp(-ratio x) - exp(-x)) / (1 - ratio), at x = log(ratio) / (ratio - 1)
    return float(np.exp(-1.0)) if ratio == 1.0 else float(ratio ** (ratio / (1.0 - ratio)))


@dataclass(frozen=True)
class Thresholds:
    """Largest high-pass (n,) of the external torque that is no contact [N m or N]."""

    torque: Array

    @classmethod
    def between(
        cls,
        joint_names: Sequence[str],
        free: Array,
        contact: ArrayLike,
        gain: float = GAIN,
        cutoff_hz: float = CUTOFF_HZ,
    ) -> Thresholds:
        """
        Put thresholds between a motion without contact and the smallest contact of interest, (n,).

        `free`, shape (N, n): high-pass, by `gain` and `cutoff_hz`, of the external torques of a
        motion that the model was not fitted on: on the one that it was, they are too small.
        DataError if a joint shows as much in it as with such a contact.
        """
        largest = np.abs(free).max(axis=0)
        smallest = np.broadcast_to(contact, largest.shape)
        shown = step_response_peak(gain, cutoff_hz) * smallest
        for name, least, most, bound in zip(joint_names, smallest, shown, largest, strict=True):
            if not bound < most:
                raise DataError(
                    f'a contact of {least:.3g} N m or N at {name} shows as {most:.3g}, but the '
                    f'free motion went up to {bound:.3g}; ask for a larger contact, or learn from '
                    'more motion.'
                )
        return cls(largest ** (1 - NEARER) * shown**NEARER)

    def exceeded(self, fast: Array) -> BoolArray:
        """Return which joints are in contact, by a high-pass of shape (n,) or (N, n)."""
        return np.asarray(np.abs(fast) > self.torque)


@dataclass(frozen=True)
class ContactEstimate:
    """External torques (n,), errors of the model among them, and their high-pass."""

    torque: Array
    high_pass: Array


class ContactMonitor:
    """
    Estimate external torques and their high-pass [Hz] while the arm moves, by a gain [1/s].

    The high-pass is zero until the observer has settled: it rises to a lasting error of the model
    as fast as to a contact.
    """

    def __init__(
        self, model: DynamicsModel, gain: float = GAIN, cutoff_hz: float = CUTOFF_HZ
    ) -> None:
        self._observer = ContactObserver(model, gain)
        self._gain, self._cutoff_hz = gain, cutoff_hz
        self._high_pass = HighPass(cutoff_hz)
        self._t, self._unsettled = np.nan, 1.0

    def update(self, t: float, q: Array, dq: Array, tau: Array) -> ContactEstimate:
        """Take one measured sample at t [s], arrays of shape (n,)."""
        torque = self._observer.update(t, q, dq, tau)
        if self._unsettled > UNSETTLED:
            self._high_pass = HighPass(self._cutoff_hz)
            if not np.isnan(self._t):
                self._unsettled /= 1.0 + self._gain * (t - self._t)
            self._t = t
        return ContactEstimate(torque, self._high_pass.update(t, torque))


class FreeMotion:
    """The largest high-pass (n,) of the external torques in so many seconds without contact."""

    def __init__(self, seconds: float, n_joints: int) -> None:
        self._remaining = seconds
        self._low, self._high = np.full((2, n_joints), [[np.inf], [-np.inf]])
        self.largest = np.zeros(n_joints)

    def add(self, step: float, dq: Array, high_pass: Array) -> bool:
        """Take a sample, `step` [s] after the one before; return whether it is enough."""
        self.largest = np.maximum(self.largest, np.abs(high_pass))
        self._low, self._high = np.minimum(self._low, dq), np.maximum(self._high, dq)
        self._remaining -= step
        return self._remaining <= 0.0

    def require_motion(self, joint_names: tuple[str, ...], trained: Array) -> None:
        """
        Refuse a motion that does not show the errors of the model.

        DataError if a joint moved by less than `LEAST_MOTION` of the velocities (n,) of the
        training data.
        """
        spanned, needed = self._high - self._low, LEAST_MOTION * trained
        for name, span, least in zip(joint_names, spanned, needed, strict=True):
            if span < least:
                raise DataError(
                    f'the velocity of {name} must span {least:.2g} rad/s or m/s, a fifth of the '
                    f'training data, but spanned {span:.2g}; call calibrate and move all joints.'
                )
