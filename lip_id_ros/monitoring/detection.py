r"""
Detect contacts: external torques beyond the deviation of their estimate, which is learned.

Errors of a model grow with torque and acceleration. So the variance of an estimate in free motion
is taken as a sum of non-negative shares of mean squares (`ExternalTorque.terms`),

.. math:: \sigma^2 = a^2 + (b\, \tau)^2 + (c\, M_{jj} \ddot q_j)^2 + (e\, f_0)^2

with the friction f0 that changes sign near rest. A contact is found at `DEVIATIONS` of it, and not
below a fifth of the smallest contact of interest. Where so many deviations exceed that contact,
the monitor is blind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import nnls

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.errors import DataError
from lip_id_ros.monitoring.external_torque import ExternalTorque, N_TERMS

DEVIATIONS = 3.5
"""An estimate that exceeds so many of its deviations is a contact."""

LEAST_SHOWN = 0.2
"""Share of the smallest contact of interest below which nothing is one: deviations have tails."""

TORQUE_ERROR = 0.1
"""Relative error of torques from motor currents, which may change from day to day."""

LEAST_AT_REST = 0.5
"""Share of the friction near rest: an arm that stands may be held by any of it."""

LEAST_MOTION = 0.2
"""Share of the training data's range of velocities that calibration must see of every joint."""

SWEEPS, LEAST_VARIANCE = 10, 1e-9
"""Of the weighted least squares, and least variance of an estimate in the largest torque's."""


@dataclass(frozen=True)
class Deviation:
    """
    Deviations of external torques in free motion.

    `shares`, shape (4, n): of the terms, not negative: a constant [N m or N], and shares of the
    measured torque, of the inertial torque, of the friction near rest.
    """

    shares: Array

    @classmethod
    def fitted(
        cls, torque: Array, terms: Array, torque_error: ArrayLike = TORQUE_ERROR
    ) -> Deviation:
        """
        Fit the shares to a motion without contact, external torques (N, n), terms (N, 4, n).

        By least squares of the squared torques, weighted by their variance (a Gamma regression).
        `torque_error`, (n,) or one for all: least relative error of a measured torque.
        """
        columns = [_shares(torque[:, j], terms[:, :, j]) for j in range(torque.shape[1])]
        constant, measured, inertial, rest = np.stack(columns, axis=1)
        measured, rest = np.maximum(measured, torque_error), np.maximum(rest, LEAST_AT_REST)
        return cls(np.stack([constant, measured, inertial, rest]))

    def std(self, terms: Array) -> Array:
        """Return the deviations (..., n) [N m or N] for terms of shape (..., 4, n)."""
        return np.asarray(np.sqrt(np.einsum('kn,...kn->...n', self.shares**2, terms)))


def _shares(torque: Array, terms: Array) -> Array:
    """Return shares (4,) of the terms (N, 4) of one joint."""
    squares = torque**2
    least = LEAST_VARIANCE * max(float(squares.max()), float(terms[:, 1].max()))
    least = max(least, np.finfo(float).tiny)
    variance = np.full(len(torque), max(float(squares.mean()), least))
    found = np.zeros(N_TERMS)
    for _ in range(SWEEPS):
        try:
            found, _ = nnls(terms / variance[:, None], squares / variance)
        except RuntimeError:  # it did not converge: what the last sweep found holds
            break
        variance = np.maximum(terms @ found, least)
    return np.sqrt(found)


@dataclass(frozen=True)
class Contact:
    """
    Per joint, shape (n,): whether in contact, and whether blind.

    `std`, `threshold`: deviation, and torque beyond which there is a contact [N m or N].
    """

    std: Array
    threshold: Array
    touched: BoolArray
    blind: BoolArray


@dataclass(frozen=True)
class ContactDetector:
    """Judge external torques by their deviation; `smallest` contacts (n,) are of interest."""

    deviation: Deviation
    smallest: Array

    def judge(self, external: ExternalTorque) -> Contact:
        """Judge an estimate: a joint that is blind, as all are at first, detects nothing."""
        std = self.deviation.std(external.terms)
        sees = (DEVIATIONS * std <= self.smallest) & external.settled
        threshold = np.maximum(DEVIATIONS * std, LEAST_SHOWN * self.smallest)
        touched = sees & (np.abs(external.torque) > threshold)
        return Contact(std, threshold, np.asarray(touched), np.asarray(~sees))


@dataclass(frozen=True)
class Calibration:
    """
    What a motion without contact teaches.

    `least`, shape (n,): smallest contacts that show in half of the motion, in hundredths of a N m.
    """

    deviation: Deviation
    least: Array

    @classmethod
    def of(
        cls, free: Sequence[ExternalTorque], torque_error: ArrayLike = TORQUE_ERROR
    ) -> Calibration:
        """
        Learn deviations from estimates of a motion without contact.

        It must not be a motion that the model was fitted on: its errors are too small there.
        `torque_error`: least relative error of measured torques, 0.1 from motor currents, 0.02
        from torque sensors. DataError if the motion is too short.
        """
        settled = [each for each in free if each.settled]
        if not settled:
            raise DataError(
                f'the free motion must last longer than the observer takes to settle, but its '
                f'{len(free)} samples do not; record more of it.'
            )
        terms = np.array([each.terms for each in settled])
        deviation = Deviation.fitted(np.array([x.torque for x in settled]), terms, torque_error)
        shown = DEVIATIONS * deviation.std(terms)
        return cls(deviation, np.ceil(100.0 * np.median(shown, axis=0)) / 100.0)

    def detector(self, joint_names: Sequence[str], smallest: ArrayLike) -> ContactDetector:
        """Return what detects these contacts; DataError if one is hidden most of the time."""
        wanted = np.broadcast_to(np.asarray(smallest, dtype=np.float64), self.least.shape)
        hidden = ', '.join(
            f'{name} {bound:.3g}'
            for name, bound, least in zip(joint_names, wanted, self.least, strict=True)
            if not least <= bound
        )
        if hidden:
            raise DataError(
                f'contacts at {hidden} N m or N would not show in half of the free motion, but '
                f'{self.in_words(joint_names)} would; set smallest_contact to these or more, '
                'learn from more motion, or give a smaller error of torques.'
            )
        return ContactDetector(self.deviation, wanted)

    def in_words(self, joint_names: Sequence[str]) -> str:
        """Return the smallest contacts that show."""
        least = zip(joint_names, self.least, strict=True)
        return f'{", ".join(f"{name} {value:g}" for name, value in least)} N m or N'


class FreeMotion:
    """Estimates in so many seconds without contact."""

    def __init__(self, seconds: float, n_joints: int) -> None:
        self._remaining = seconds
        self._low, self._high = np.full((2, n_joints), [[np.inf], [-np.inf]])
        self._kept: list[ExternalTorque] = []

    def add(self, step: float, dq: Array, external: ExternalTorque) -> bool:
        """Take a sample, `step` [s] after the one before; return whether it is enough."""
        self._kept.append(external)
        self._low, self._high = np.minimum(self._low, dq), np.maximum(self._high, dq)
        self._remaining -= step
        return self._remaining <= 0.0

    def calibration(
        self, joint_names: Sequence[str], trained: Array, torque_error: Array
    ) -> Calibration:
        """
        Return what the motion teaches, as `Calibration.of`.

        DataError if a joint moved by less than `LEAST_MOTION` of the velocities (n,) of the
        training data: the motion does not show the errors of the model.
        """
        spanned, needed = self._high - self._low, LEAST_MOTION * trained
        for name, span, least in zip(joint_names, spanned, needed, strict=True):
            if span < least:
                raise DataError(
                    f'the velocity of {name} must span {least:.2g} rad/s or m/s, a fifth of the '
                    f'training data, but spanned {span:.2g}; call calibrate and move all joints.'
                )
        return Calibration.of(self._kept, torque_error)
