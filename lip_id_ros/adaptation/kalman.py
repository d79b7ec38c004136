"""A Kalman filter of numbers of which torques are linear, robust to torques that do not belong."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class Walk:
    """
    Ornstein-Uhlenbeck processes of the last K of p numbers; the others do not change.

    The numbers that walk return to what the others leave open of them: `slopes`, shape (K, p - K),
    of their expectation by the others, and `covariance`, shape (K, K), about it in the long run.
    `rate`: of the return [1/s].

    """

    slopes: Array
    covariance: Array
    rate: float

    def growth(self, seconds: Array) -> Array:
        """Return the share of `covariance` by which a walk grows in times of any shape [s]."""
        return np.asarray(-np.expm1(-2.0 * self.rate * np.maximum(seconds, 0.0)))

    def spread(self, covariance: Array, seconds: float) -> None:
        """Let what walks become less sure for a time [s]; `covariance`, (p, p): changed."""
        first = self.slopes.shape[1]
        covariance[first:, first:] += self.growth(np.array(seconds)) * self.covariance

    def go_back(self, mean: Array, covariance: Array, centre: Array, seconds: float) -> None:
        """
        Let numbers return for a time [s], without growth.

        `mean`, (p,), `covariance`, (p, p): changed. `centre`, (p,): of numbers that nothing shows.

        """
        kept, first = np.exp(-self.rate * max(seconds, 0.0)), self.slopes.shape[1]
        still, walking = slice(first), slice(first, None)
        usual = centre[walking] + self.slopes @ (mean[still] - centre[still])
        mean[walking] = usual + kept * (mean[walking] - usual)
        by_others = (1.0 - kept) * self.slopes
        mixed = kept * covariance[walking, still] @ by_others.T
        more = by_others @ covariance[still, still]
        covariance[walking, walking] *= kept**2
        covariance[walking, walking] += mixed + mixed.T + more @ by_others.T
        cross = kept * covariance[walking, still] + more
        covariance[walking, still], covariance[still, walking] = cross, cross.T


@jit
def follow(
    mean: Array,
    covariance: Array,
    lower: Array,
    upper: Array,
    steps: Array,
    walked: Array,
    growth: Array,
    torque: Array,
    slopes: Array,
    measured: Array,
    noise: Array,
    inflation: Array,
    gate: Array,
    hold: float,
    quiet: float,
    predicted: Array,
    variance: Array,
    outcome: Array,
) -> float:
    """
    Predict the torques of N samples one after the other, and learn from each after that.

    An innovation of z deviations, z > `CLIPPED`, has the noise of one of `CLIPPED`: it counts for
    less the larger it is. Nothing is learned from a sample with one beyond `gate` deviations, of
    shape (n,), nor for `hold` seconds after it. The return value is the time since then [s].

    `mean`, (p,), `covariance`, (p, p): changed. `lower`, `upper`, (p,): bounds of the numbers.
    `steps`, (N,): time since the sample before [s]. `walked`, (K, K), `growth`, (N,): of the last
    numbers, so large a share of this covariance comes before each sample.
    `torque`, (N, n), `slopes`, (N, n, p): torques are torque + slopes (mean - mean at the start).
    `measured`, (N, n); `noise`, (N, n): variances of measured torques, infinite where nothing is
    to be learned. `inflation`, (N,): of these where samples are learned from, since noise lasts.
    `quiet`: time since the last disturbance before these samples [s].
    `predicted`, `variance`, (N, n), `outcome`, (N,): set: torques expected before the sample was
    learned from, the variances of these expectations, and `LEARNED`, `DISTURBED`, or `HELD` soon
    after a disturbance.

    """
    count, n, size = slopes.shape
    spread, around, first = np.empty(size), mean.copy(), size - len(walked)
    for t in range(count):
        covariance[first:, first:] += growth[t] * walked
        quiet += steps[t]
        for i in range(n):
            _multiply(covariance, slopes[t, i], spread)
            predicted[t, i], variance[t, i] = torque[t, i], 0.0
            for k in range(size):
                predicted[t, i] += slopes[t, i, k] * (mean[k] - around[k])
                variance[t, i] += slopes[t, i, k] * spread[k]
            error = abs(measured[t, i] - predicted[t, i])
            if not error <= gate[i] * np.sqrt(variance[t, i] + noise[t, i]):
                quiet = 0.0
        outcome[t] = LEARNED if quiet >= hold else HELD if quiet > 0.0 else DISTURBED
        if quiet < hold:
            continue
        for i in range(n):
            if noise[t, i] < np.inf:
                error = abs(measured[t, i] - predicted[t, i])
                ratio = error / np.sqrt(variance[t, i] + noise[t, i]) / CLIPPED
                own = inflation[t] * noise[t, i] * max(1.0, ratio) ** 2
                target = measured[t, i] - torque[t, i]
                _learn(mean, covariance, slopes[t, i], target, around, own, spread)
        keep_within(mean, covariance, lower, upper)
    return quiet


@jit
def keep_within(mean: Array, covariance: Array, lower: Array, upper: Array) -> None:
    """
    Move numbers that are beyond a bound onto it, and the others with them.

    The projection in the metric of the covariance (Simon, IET Control Theory and Applications
    2010, section 2.2), bound by bound: a change that torques forbid is none.

    """
    for _ in range(PASSES):
        inside = True
        for k in range(len(mean)):
            bound = min(max(mean[k], lower[k]), upper[k])
            if bound != mean[k]:
                inside = False
                step = (bound - mean[k]) / covariance[k, k]
                for c in range(len(mean)):
                    mean[c] += step * covariance[k, c]
                mean[k] = bound
        if inside:
            return
    for k in range(len(mean)):
        mean[k] = min(max(mean[k], lower[k]), upper[k])


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
