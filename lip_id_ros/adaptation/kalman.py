"""A Kalman filter of numbers of which torques are linear, robust to torques that do not belong."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit

CLIPPED = 3.0
"""Deviations beyond which an innovation counts for less (Huber 1964)."""

PASSES = 5
"""Over the bounds, before numbers are cut off."""

LEARNED, HELD, DISTURBED, RESTING, SETTLING, STUCK = range(6)
"""
What became of a sample; the filter knows the first three. `RESTING`: no joint moves. `SETTLING`: a
payload is being found. `STUCK`: the torque of a joint that moves stands still, and is left out.
"""


class Walk(NamedTuple):
    """
    An Ornstein-Uhlenbeck process of each number: it walks, and returns where nothing is seen.

    `centre`, `variance`, shape (p,): where the numbers return to, and their variances in the long
    run. `rate`, shape (p,): of the return [1/s]; 0 for numbers that do not change.
    `lower`, `upper`, shape (p,): bounds.

    """

    centre: Array
    variance: Array
    rate: Array
    lower: Array
    upper: Array


@jit
def follow(
    mean: Array,
    covariance: Array,
    walk: Walk,
    steps: Array,
    torque: Array,
    slopes: Array,
    measured: Array,
    noise: Array,
    gate: float,
    hold: float,
    quiet: float,
    predicted: Array,
    variance: Array,
    outcome: Array,
) -> float:
    """
    Predict the torques of N samples one after the other, and learn from each after that.

    An innovation of z deviations, z > `CLIPPED`, has the noise of one of `CLIPPED`: it counts for
    less the larger it is. Nothing is learned from a sample with one beyond `gate` deviations, nor
    for `hold` seconds after it. The return value is the time since the last of these [s].

    `mean`, (p,), `covariance`, (p, p): changed.
    `steps`, (N,): time since the sample before [s].
    `torque`, (N, n), `slopes`, (N, n, p): torques are torque + slopes (mean - mean at the start).
    `measured`, (N, n); `noise`, (N, n): variances of measured torques, infinite where nothing is
    to be learned.
    `quiet`: time since the last disturbance before these samples [s].
    `predicted`, `variance`, (N, n), `outcome`, (N,): set: torques expected before the sample was
    learned from, the variances of these expectations, and `LEARNED`, `DISTURBED`, or `HELD` soon
    after a disturbance.

    """
    count, n, size = slopes.shape
    spread, around = np.empty(size), mean.copy()
    for t in range(count):
        let_walk(mean, covariance, walk, steps[t])
        quiet += steps[t]
        for i in range(n):
            _multiply(covariance, slopes[t, i], spread)
            predicted[t, i], variance[t, i] = torque[t, i], 0.0
            for k in range(size):
                predicted[t, i] += slopes[t, i, k] * (mean[k] - around[k])
                variance[t, i] += slopes[t, i, k] * spread[k]
            error = abs(measured[t, i] - predicted[t, i])
            if not error <= gate * np.sqrt(variance[t, i] + noise[t, i]):
                quiet = 0.0
        outcome[t] = LEARNED if quiet >= hold else HELD if quiet > 0.0 else DISTURBED
        if quiet < hold:
            continue
        for i in range(n):
            if noise[t, i] < np.inf:
                error = abs(measured[t, i] - predicted[t, i])
                ratio = error / np.sqrt(variance[t, i] + noise[t, i]) / CLIPPED
                own = noise[t, i] * max(1.0, ratio) ** 2
                target = measured[t, i] - torque[t, i]
                _learn(mean, covariance, slopes[t, i], target, around, own, spread)
        keep_within(mean, covariance, walk)
    return quiet


@jit
def keep_within(mean: Array, covariance: Array, walk: Walk) -> None:
    """
    Move numbers that are beyond a bound onto it, and the others with them.

    The projection in the metric of the covariance (Simon, IET Control Theory and Applications
    2010, section 2.2), bound by bound: a change that torques forbid is none.

    """
    for _ in range(PASSES):
        inside = True
        for k in range(len(mean)):
            bound = min(max(mean[k], walk.lower[k]), walk.upper[k])
            if bound != mean[k]:
                inside = False
                step = (bound - mean[k]) / covariance[k, k]
                for c in range(len(mean)):
                    mean[c] += step * covariance[k, c]
                mean[k] = bound
        if inside:
            return
    for k in range(len(mean)):
        mean[k] = min(max(mean[k], walk.lower[k]), walk.upper[k])


@jit
def let_walk(mean: Array, covariance: Array, walk: Walk, step: float) -> None:
    """Let the numbers walk for a time [s]."""
    if step <= 0.0:
        return
    kept = np.exp(-walk.rate * step)
    for k in range(len(mean)):
        mean[k] = walk.centre[k] + kept[k] * (mean[k] - walk.centre[k])
        for c in range(len(mean)):
            covariance[k, c] *= kept[k] * kept[c]
        covariance[k, k] += walk.variance[k] * (1.0 - kept[k] ** 2)


@jit
def _multiply(covariance: Array, slope: Array, out: Array) -> None:
    """Set `out` to the covariance times a slope, of which many numbers are zero."""
    out[:] = 0.0
    for k in range(len(slope)):
        by = slope[k]
        if by != 0.0:
            for c in range(len(out)):
                out[c] += by * covariance[k, c]


@jit
def _learn(
    mean: Array,
    covariance: Array,
    slope: Array,
    target: float,
    around: Array,
    noise: float,
    spread: Array,
) -> None:
    """Take in one torque: target = slope (mean - around) with a variance of noise."""
    _multiply(covariance, slope, spread)
    variance, innovation = noise, target
    for k in range(len(slope)):
        variance += slope[k] * spread[k]
        innovation -= slope[k] * (mean[k] - around[k])
    for k in range(len(slope)):
        gain = spread[k] / variance
        mean[k] += gain * innovation
        for c in range(len(slope)):
            covariance[k, c] -= gain * spread[c]
