"""
Noise of torques.

Constant per joint, and more of it near rest (maths.md, section 12). While a joint sticks its
friction is anything between both Coulomb torques (Dahl 1968; Armstrong-Helouvry 1991, section 2);
such samples stay in the fit with that deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
import math

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import coulomb, saturating, WIDENINGS
from lip_id_ros.numba_jit import jit

RATIOS = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Standard deviations at rest that are tried, beside none, in those of motion."""

VELOCITIES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""Velocities up to which a joint is near rest that are tried, in root mean square velocities."""

MOST, THRESHOLD = 10.0, 4.0
"""Standard deviations at which residuals are clipped, and beyond which samples count for less."""

SATURATED = 2.0
"""Velocity at which a smooth sign is nearly one, in its widths."""

LEAST_GAIN = 0.02
"""Least increase of the log likelihood per sample for which noise near rest differs."""


@dataclass(frozen=True, eq=False)
class TorqueNoise:
    """
    Noise of torques, constant in motion and more near rest.

    Its variance is std^2 (1 + ratio^2 exp(-(dq / velocity)^2)) + stuck^2 exp(-(dq / width)^2).
    `stuck` [N m or N] and `width` [rad/s or m/s] of a joint that sticks have shape (n,) or (1,).
    """

    std: Array  # (n,), in motion [N m or N]
    ratio: Array  # (n,), of additional deviation at rest to that in motion
    velocity: Array  # (n,), up to which it is near rest [rad/s or m/s]
    stuck: Array = field(default_factory=lambda: np.zeros(1))
    width: Array = field(default_factory=lambda: np.ones(1))

    @classmethod
    def constant(cls, std: Array) -> TorqueNoise:
        """Return noise that is the same at every velocity."""
        return cls(std, np.zeros_like(std), np.ones_like(std))

    def std_at(self, dq: Array) -> Array:
        """Return the standard deviation at velocities (..., n), same shape [N m or N]."""
        stuck = self.stuck**2 * np.exp(-np.square(dq / self.width))
        return np.asarray(np.sqrt(self.std**2 / self.weights(dq) + stuck))

    def measured_std(self, std: Array, dq: Array) -> Array:
        """Return deviations (N, n) of measured torques from those of noiseless ones [N m or N]."""
        return np.asarray(_measured_std(std, np.ascontiguousarray(dq), self._numbers))

    @cached_property
    def _numbers(self) -> Array:
        shape = self.std.shape
        parts = self.std, self.ratio, self.velocity, self.stuck, self.width
        return np.array([np.broadcast_to(part, shape) for part in parts])

    def weights(self, dq: Array) -> Array:
        """Return the weights of samples in a fit, at most 1, shape of `dq`; without `stuck`."""
        near = np.exp(-np.square(dq / self.velocity))
        return np.asarray(1.0 / (1.0 + np.square(self.ratio) * near))


@jit
def _measured_std(std: Array, dq: Array, numbers: Array) -> Array:
    out = np.empty(std.shape)
    for t in range(len(std)):
        for j in range(std.shape[1]):
            noise, ratio, velocity, stuck, width = numbers[:, j]
            near, still = (dq[t, j] / velocity) ** 2, (dq[t, j] / width) ** 2
            square = noise**2 * (1.0 + ratio**2 * math.exp(-near)) + stuck**2 * math.exp(-still)
            out[t, j] = math.sqrt(std[t, j] ** 2 + square)
    return out


def estimate_noise(residuals: Array, dq: Array) -> TorqueNoise:
    """
    Choose the noise by its likelihood from residuals (N, n) of left-out samples [N m or N].

    These are clipped at `MOST` robust deviations.
    """
    scale = 1.4826 * np.median(np.abs(residuals), axis=0)
    bound = np.where(scale > 0.0, MOST * scale, np.inf)
    clipped = np.clip(residuals, -bound, bound)
    noise = _likeliest(clipped, dq)
    counts = outlier_weights(residuals, noise.std_at(dq))
    squares = np.sum(noise.weights(dq) * counts * residuals**2, axis=0) / np.sum(counts, axis=0)
    return replace(noise, std=np.sqrt(squares))


def outlier_weights(residuals: Array, std: Array) -> Array:
    """
    Weights (N, n) of a reweighted fit.

    1 up to `THRESHOLD` deviations. Huber 1964; beyond twice the threshold redescending.
    """
    ratio = THRESHOLD / np.maximum(np.abs(residuals) / np.maximum(std, 1e-300), THRESHOLD)
    return np.asarray(np.where(ratio < 0.5, 2.0 * ratio**2, ratio))


def sticking_noise(
    noise: TorqueNoise,
    friction: FrictionModel,
    q: Array,
    ddq: Array,
    load: Array,
    remembered: Array | float = 0.0,
) -> TorqueNoise:
    """
    Return noise that covers a joint that sticks, whether or not one did in the recording.

    At rest friction is anything between the two Coulomb torques: as if uniform, with the deviation
    of half their distance over the root of three. The narrowest sign of saturating viscous
    friction counts as Coulomb friction here: both hold a joint that sticks. Beyond the width of
    that sign, at a usual acceleration, a joint moves, however wide the velocities are at which the
    recording has more noise; and beyond these velocities the recording shows that friction is
    known. The part that is `remembered`, shape (n,), has a deviation of its own (`DahlFriction`).
    """
    width, narrowest = np.ones(friction.n_joints), np.ones(friction.n_joints)
    smoothing = friction.basis.rise_time * np.sqrt(np.mean(ddq**2, axis=0))
    for part in friction.basis.terms:
        for joint, _ in part.drive.efforts:
            if part.term.kind is coulomb:
                width[joint] = np.hypot(part.term.parameters['width'], smoothing[joint])
            elif part.term.kind is saturating:
                narrowest[joint] = WIDENINGS[0]
    moving = np.broadcast_to(SATURATED * narrowest * width, q.shape)
    steady = np.zeros_like(q)
    torques = [friction.torque(q, dq, steady, load) for dq in (moving, -moving)]
    dry = 0.5 * np.mean(np.maximum(torques[0] - torques[1], 0.0), axis=0)
    dry = np.maximum(dry - remembered, 0.0)
    known = np.square(noise.std * noise.ratio)
    stuck = np.sqrt(np.maximum(dry**2 / 3.0 - known, 0.0))
    seen = np.where(noise.ratio > 0.0, noise.velocity, np.inf)
    return replace(noise, stuck=stuck, width=np.minimum(width, seen))


def leverage_weights(features: Sequence[Array], threshold: float = 20.0) -> Array:
    """
    Weights (N, n) that all but leave out samples with absurd features (Mallows 1975).

    Residuals do not show such samples, which pull the fit towards themselves: beyond the threshold
    the influence of a row decays with the square of its size. The threshold is in medians of the
    largest of the features (N, p_i), each in units of its own median size.
    """
    weights = []
    for rows in features:
        size = np.abs(rows)
        median = np.median(size, axis=0)
        used = median > 0.0
        largest = np.max(size[:, used] / median[used], axis=1, initial=0.0)
        bound = threshold * max(float(np.median(largest)), 1e-300)
        weights.append((bound / np.maximum(largest, bound)) ** 4)
    return np.column_stack(weights)


def _likeliest(residuals: Array, dq: Array) -> TorqueNoise:
    speed = np.sqrt(np.mean(dq**2, axis=0))
    best = TorqueNoise.constant(np.sqrt(np.mean(residuals**2, axis=0)))
    best_value = _log_likelihood(best, residuals, dq) + LEAST_GAIN
    for ratio in RATIOS:
        for share in VELOCITIES:
            velocity = np.where(speed > 0.0, share * speed, 1.0)
            tried = TorqueNoise(best.std, np.full_like(speed, ratio), velocity)
            squares = np.mean(residuals**2 * tried.weights(dq), axis=0)
            tried = TorqueNoise(np.sqrt(squares), tried.ratio, velocity)
            value = _log_likelihood(tried, residuals, dq)
            better = value > best_value
            best = TorqueNoise(
                np.where(better, tried.std, best.std),
                np.where(better, tried.ratio, best.ratio),
                np.where(better, tried.velocity, best.velocity),
            )
            best_value = np.maximum(value, best_value)
    return best


def _log_likelihood(noise: TorqueNoise, residuals: Array, dq: Array) -> Array:
    """Return the mean log likelihood per sample, up to a constant, shape (n,)."""
    std = np.maximum(noise.std_at(dq), 1e-300)
    return np.asarray(-np.mean(np.log(std) + 0.5 * np.square(residuals / std), axis=0))
