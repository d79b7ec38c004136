r"""
Estimate external torques from positions and measured torques, by an extended state observer.

The state is q, dq and the external torque d; the learned model predicts it over a step,

.. math:: \ddot q = (M + h\, \partial f / \partial \dot q)^{-1} (\tau - c - g - f + d)

(implicit in the friction f, which is stiff near rest), and each measured position corrects it by
the gains of a fading-memory filter of second degree (Morrison, Introduction to Sequential
Smoothing and Prediction, 1969): all of its poles lie at one bandwidth. Reported velocities, often
differences over stamps that jitter, are not used.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.monitoring.observers import Predictor

BANDWIDTH = 50.0
"""Of the observer [1/s]."""

JITTER_SPEED = 2.0
"""Velocity from which stamps that jitter count more than positions [rad/s or m/s]."""

NEAR_REST = 0.01
"""Velocity in which friction is averaged, in half the range of the training data."""

SETTLED = 8.0
"""Time constants after which a hundredth of the error of the beginning is left."""

AVERAGED_S = 0.1
"""Time over which the terms of the deviation are averaged [s]."""

LEAST_EIGENVALUE = 0.01
"""
Of an inertia matrix in units of its largest diagonal entries so far: those of Gaussian processes
may be indefinite, and what is predicted with a tiny one is tossed about.
"""

N_TERMS = 4


class ExternalTorque(NamedTuple):
    """
    External torques (n,) [N m or N], and the terms of their variance, shape (4, n).

    `terms`: one, and recent mean squares of the measured torque, of the inertial torque of the
    joint alone, and of the friction that changes sign near rest. `settled`: whether the beginning
    is forgotten.
    """

    torque: Array
    terms: Array
    settled: bool


class _Prediction(NamedTuple):
    """Inertia matrix (n, n), torques without acceleration, friction near rest, its slope, (n,)."""

    inertia: Array
    bias: Array
    reversal: Array
    slope: Array


class ExternalTorqueObserver:
    """
    Estimate external torques while the arm moves; it begins with the first sample.

    `bandwidth`: of the observer [1/s]; a sudden contact shows by half after 2.7 / bandwidth.
    """

    def __init__(self, model: Predictor, bandwidth: float = BANDWIDTH) -> None:
        self._model, self._bandwidth = model, bandwidth
        low, high = model.training_range
        self._near_rest = NEAR_REST * 0.5 * (high[1] - low[1])
        n = low.shape[1]
        self._t, self._tau = np.nan, np.zeros(n)
        self._unsettled_s = SETTLED / bandwidth
        self._q, self._dq, self._ddq, self._external = np.zeros((4, n))
        self._terms = np.zeros((N_TERMS, n))
        self._largest = np.full(n, np.finfo(float).tiny)

    def update(self, t: float, q: Array, dq: Array, tau: Array) -> ExternalTorque:
        """Take one measured sample at t [s], arrays of shape (n,); `dq` is used at the first."""
        if np.isnan(self._t):
            self._t, self._tau, self._q, self._dq = t, tau, q.copy(), dq.copy()
        step = t - self._t
        known = self._predicted(q)
        mean = 0.5 * (tau + self._tau)
        ddq = self._advance(step, known, mean)
        self._correct(step, known.inertia, q)
        self._average(step, known, mean, ddq)
        self._t, self._tau = t, tau
        self._unsettled_s -= step
        settled = self._unsettled_s <= 0.0
        return ExternalTorque(self._external.copy(), self._terms.copy(), settled)

    def _predicted(self, q: Array) -> _Prediction:
        n = q.size
        at = np.broadcast_to(q, (n + 2, n))
        dq, ddq = np.zeros((2, n + 2, n))
        ddq[:n], ddq[n:] = np.eye(n), self._ddq  # friction may depend on the load
        dq[n], dq[n + 1] = self._dq + self._near_rest, self._dq - self._near_rest
        found = self._model.predict(at, dq, ddq)
        after, before = found.friction[n:]
        inertia = self._positive(0.5 * (found.inertial[:n] + found.inertial[:n].T))
        reversal = np.maximum(0.5 * (after - before), 0.0)
        slope = reversal / np.maximum(self._near_rest, np.finfo(float).tiny)
        bias = (found.tau - found.inertial)[n:].mean(axis=0)
        return _Prediction(inertia, bias, reversal, slope)

    def _positive(self, inertia: Array) -> Array:
        """Return an inertia matrix whose eigenvalues are not too small to divide by."""
        if not np.isfinite(inertia).all():
            return np.full_like(inertia, np.nan)
        self._largest = np.maximum(self._largest, np.abs(np.diag(inertia)))
        root = np.sqrt(self._largest)
        values, vectors = np.linalg.eigh(inertia / root[:, None] / root)
        if values[0] >= LEAST_EIGENVALUE:
            return inertia
        least = (vectors * np.maximum(values, LEAST_EIGENVALUE)) @ vectors.T
        return np.asarray(least * root[:, None] * root)

    def _advance(self, step: float, known: _Prediction, tau: Array) -> Array:
        """Predict the state over a step [s]; return the accelerations without external torque."""
        stiff = known.inertia + step * np.diag(known.slope)
        free = tau - known.bias
        alone, self._ddq = np.linalg.solve(
            stiff, np.stack([free, free + self._external], axis=1)
        ).T
        self._q = self._q + step * self._dq + 0.5 * step**2 * self._ddq
        self._dq = self._dq + step * self._ddq
        return np.asarray(alone)

    def _correct(self, step: float, inertia: Array, q: Array) -> None:
        if step <= 0.0:
            return
        speed = np.abs(self._dq).max() / JITTER_SPEED
        kept = np.exp(-self._bandwidth * step * (1.0 + speed**2) ** (-1 / 6))
        error = q - self._q
        self._q = self._q + (1.0 - kept**3) * error
        faster = 1.5 * (1.0 - kept) ** 2 * (1.0 + kept) / step * error
        self._dq, self._ddq = self._dq + faster, self._ddq + faster / step
        self._external = self._external + inertia @ error * ((1.0 - kept) ** 3 / step**2)

    def _average(self, step: float, known: _Prediction, tau: Array, ddq: Array) -> None:
        inertial = np.diag(known.inertia) * ddq
        squares = np.stack([np.ones_like(tau), tau**2, inertial**2, known.reversal**2])
        new = 1.0 if step <= 0.0 else -np.expm1(-step / AVERAGED_S)
        self._terms = self._terms + new * (squares - self._terms)


def external_torques(
    model: Predictor,
    t: Array,
    q: Array,
    dq: Array,
    tau: Array,
    bandwidth: float = BANDWIDTH,
) -> list[ExternalTorque]:
    """Estimate the external torques of a recording of N samples, as the monitor does."""
    observer = ExternalTorqueObserver(model, bandwidth)
    return [observer.update(float(t[row]), q[row], dq[row], tau[row]) for row in range(len(t))]
