"""
Noise of torques: constant per joint, and more of it near rest (docs/maths.md, section 12).

While a joint sticks, its friction is anything between the two Coulomb torques and depends on how
the joint came to rest (Dahl 1968; Armstrong-Helouvry 1991, section 2), which no function of the
present state predicts. Such samples stay in the fit, with the deviation that they have.

"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array

RATIOS = (1.0, 2.0, 4.0, 8.0, 16.0)
"""Standard deviations at rest that are tried, beside none, in those of motion."""

VELOCITIES = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""Velocities up to which a joint is near rest that are tried, in root mean square velocities."""

LEAST_GAIN = 0.02
"""Least increase of the log likelihood per sample for which noise near rest differs."""


@dataclass(frozen=True, eq=False)
class TorqueNoise:
    """
    Standard deviation of the noise, std * sqrt(1 + ratio^2 exp(-(dq / velocity)^2)) per joint.

    Attributes
    ----------
    std : array, shape (n,)
        In motion [N m or N].
    ratio : array, shape (n,)
        Of the additional deviation at rest to that in motion.
    velocity : array, shape (n,)
        Up to which the joint is near rest [rad/s or m/s].

    """

    std: Array
    ratio: Array
    velocity: Array

    @classmethod
    def constant(cls, std: Array) -> TorqueNoise:
        """Return noise that is the same at every velocity."""
        return cls(std, np.zeros_like(std), np.ones_like(std))

    def std_at(self, dq: Array) -> Array:
        """Return the standard deviation at velocities (..., n), same shape [N m or N]."""
        return np.asarray(self.std / np.sqrt(self.weights(dq)))

    def weights(self, dq: Array) -> Array:
        """Return the weights of samples in a fit, between 0 and 1, shape of `dq`."""
        near = np.exp(-np.square(dq / self.velocity))
        return np.asarray(1.0 / (1.0 + np.square(self.ratio) * near))


def estimate_noise(residuals: Array, dq: Array) -> TorqueNoise:
    """
    Choose the noise by its likelihood.

    Parameters
    ----------
    residuals : array, shape (N, n)
        Of left-out samples [N m or N].
    dq : array, shape (N, n)
        [rad/s or m/s].

    """
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
