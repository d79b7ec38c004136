"""Recorded velocities against those that the positions say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.lags import peak, shifted
from lip_id_ros.health.motion import Motion

LONGEST_LAG_S = 0.1


@dataclass(frozen=True, eq=False)
class Agreement:
    """
    How recorded velocities follow the derivative of the positions, per joint.

    Attributes
    ----------
    scale : ndarray, shape (n,)
        Recorded over differentiated velocity; nan for joints that do not move.
    correlation : ndarray, shape (n,)
        At no delay.
    lag_s : ndarray, shape (n,)
        By how much the recorded velocity comes late [s].

    """

    scale: Array
    correlation: Array
    lag_s: Array


def velocity_agreement(motion: Motion) -> Agreement:
    """Compare recorded and differentiated velocities."""
    truth, recorded = motion.joined('velocity'), motion.joined('recorded_velocity')
    scale = (truth * recorded).sum(axis=0) / np.square(truth).sum(axis=0)
    correlation = _correlation(truth, recorded)
    return Agreement(scale, correlation, _lag(motion))


def _correlation(first: Array, second: Array) -> Array:
    first, second = first - first.mean(axis=0), second - second.mean(axis=0)
    norms = np.sqrt(np.square(first).sum(axis=0) * np.square(second).sum(axis=0))
    cosine: Array = (first * second).sum(axis=0) / norms
    return cosine


def _lag(motion: Motion) -> Array:
    reach = max(1, round(LONGEST_LAG_S * motion.rate_hz))
    pieces = [piece for piece in motion.stretches if len(piece.velocity) > 3 * reach]
    if not pieces:
        return np.full(motion.stretches[0].velocity.shape[1], np.nan)
    truth = np.concatenate([piece.velocity[reach:-reach] for piece in pieces])
    alike = np.array(
        [
            np.abs(_correlation(truth, shifted(pieces, 'recorded_velocity', reach, lag)))
            for lag in range(-reach, reach + 1)
        ]
    )
    return np.array([peak(column, motion.rate_hz) for column in alike.T])
