"""Smoothers of quantised positions: splines, and a Kalman filter with its backward pass."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math

import numpy as np
from scipy.interpolate import CubicSpline, make_splrep
from scipy.optimize import minimize_scalar

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit
from lip_id_ros.preprocessing.cleaning import quantum
from lip_id_ros.preprocessing.stamps import roughness

MOST_HZ = 200.0
"""Positions at higher rates are averaged in groups first."""

ORDER = 4
"""Of the Kalman filter: position, velocity, acceleration and jerk, which is a random walk."""

UNKNOWN = 1e10
"""Variance of the first state, in those of a measurement."""

DECADES = (-16.0, 4.0)
"""Of the random walk's variance per step, in those of a measurement."""

Smoother = Callable[[Array, Array, float, Array], tuple[Array, Array, Array]]
"""
From times (N,), positions (N,), the variance of their errors and times (K,) to positions,
velocities and accelerations, (K,) each.
"""


def grouped(t: Array, position: Array) -> tuple[Array, Array, float]:
    """Return times and positions at 200 Hz or less, and the variance of their errors."""
    size = max(1, round((t.size - 1) / (t[-1] - t[0]) / MOST_HZ))
    count = t.size // size
    step = quantum(position)
    noise = roughness(t, position[:, None]) / math.sqrt(2.0 / math.pi * 35.0 / 18.0)
    variance = step**2 / 12.0 if step > 0.0 else max(noise, 1e-12) ** 2
    means = [each[: count * size].reshape(count, size).mean(axis=1) for each in (t, position)]
    return means[0], means[1], variance / size


def fitted_spline(
    t: Array, position: Array, variance: float, times: Array
) -> tuple[Array, Array, Array]:
    """Evaluate a quintic spline with as few knots as the variance of the errors asks for."""
    spline = make_splrep(t, position, k=5, s=t.size * variance)
    return spline(times), spline.derivative(1)(times), spline.derivative(2)(times)


def rauch_tung_striebel(
    t: Array, position: Array, variance: float, times: Array
) -> tuple[Array, Array, Array]:
    """
    Evaluate the posterior mean of a motion whose jerk is a random walk.

    The variance of the walk is that of the largest marginal likelihood (Rauch, Tung and Striebel,
    Maximum likelihood estimates of linear dynamic systems, AIAA Journal 3, 1965).

    """
    unit = float(np.median(np.diff(t)))
    steps, values = np.diff(t, prepend=t[0]) / unit, (position - position[0]) / math.sqrt(variance)
    found = minimize_scalar(
        lambda decade: -_filter(steps, values, 10.0**decade)[0], bounds=DECADES, method='bounded'
    )
    state = _smooth(steps, *_filter(steps, values, 10.0 ** float(found.x))[1:])
    spline = CubicSpline(t, state[:, :3] * math.sqrt(variance) / unit ** np.arange(3))
    q, dq, ddq = spline(times).T
    return q + position[0], dq, ddq


SMOOTHERS: Mapping[str, Smoother] = {
    'quintic spline, by quantisation': fitted_spline,
    'Rauch-Tung-Striebel': rauch_tung_striebel,
}


@jit
def _transition(step: float, walk: float) -> tuple[Array, Array]:
    """Return the matrix of a step and the covariance that it adds."""
    move, noise = np.zeros((ORDER, ORDER)), np.zeros((ORDER, ORDER))
    factorial = np.array([1.0, 1.0, 2.0, 6.0])
    for i in range(ORDER):
        for j in range(ORDER):
            if j >= i:
                move[i, j] = step ** (j - i) / factorial[j - i]
            power = 2 * ORDER - 1 - i - j
            below = factorial[ORDER - 1 - i] * factorial[ORDER - 1 - j]
            noise[i, j] = walk * step**power / (below * power)
    return move, noise


@jit
def _filter(steps: Array, values: Array, walk: float) -> tuple[float, Array, Array, float]:
    """Return the logarithm of the marginal likelihood, filtered states and covariances."""
    count = len(values)
    states, covariances = np.zeros((count, ORDER)), np.zeros((count, ORDER, ORDER))
    state, covariance, likelihood = np.zeros(ORDER), UNKNOWN * np.eye(ORDER), 0.0
    for row in range(count):
        if row > 0:
            move, noise = _transition(steps[row], walk)
            state = move @ state
            covariance = move @ covariance @ move.T + noise
        variance = covariance[0, 0] + 1.0
        gain, error = covariance[:, 0] / variance, values[row] - state[0]
        state = state + gain * error
        left = np.eye(ORDER)
        left[:, 0] -= gain
        covariance = left @ covariance @ left.T + np.outer(gain, gain)  # Joseph's form
        likelihood -= 0.5 * (error * error / variance + np.log(variance))
        states[row], covariances[row] = state, covariance
    return likelihood, states, covariances, walk


@jit
def _smooth(steps: Array, states: Array, covariances: Array, walk: float) -> Array:
    """Return the states given all values."""
    smooth = states.copy()
    for row in range(len(states) - 2, -1, -1):
        move, noise = _transition(steps[row + 1], walk)
        ahead = move @ covariances[row] @ move.T + noise
        gain = np.linalg.solve(ahead, move @ covariances[row]).T
        smooth[row] = states[row] + gain @ (smooth[row + 1] - move @ states[row])
    return smooth
