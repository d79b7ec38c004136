"""
A linear regression of each effort on the motion.

Each joint's effort is regressed on sines and cosines of all positions, all accelerations, and the
joint's own velocity and its smoothed sign. That is no dynamics, but enough to see whether effort
follows the motion at all, whether friction acts against it, and at which delay the two fit best.

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.motion import peak, shifted, SmoothMotion, Stretch

LONGEST_LAG_S = 0.12
SAMPLES_PER_SECOND = 8.0
"""Independent ones, at the cut-off of the low-pass."""
LEAST_SAMPLES_PER_TERM = 6.0
SIGN_WIDTH = 0.1
LEAST_VARIATION = 1e-6
"""Terms of joints that stand still are left out."""


@dataclass(frozen=True, eq=False)
class EffortRegression:
    """
    How efforts follow the motion.

    Attributes
    ----------
    explained : ndarray, shape (n,)
        Share of the variance of each effort.
    friction_cosine : ndarray, shape (n,)
        Between velocity and the friction that was found, both without what position and
        acceleration explain: about 1 for effort with the right sign, -1 where it is turned round.
    friction_weight : ndarray, shape (n,)
        How many times larger the unexplained variance is without friction.
    lag_s : float
        By how much the efforts of all joints come late [s]; nan where it is unknown.
    lag_gain : float
        Share of the unexplained variance that this lag takes away.

    """

    explained: Array
    friction_cosine: Array
    friction_weight: Array
    lag_s: float
    lag_gain: float


def effort_regression(motion: SmoothMotion) -> EffortRegression | None:
    """Regress efforts on the motion; None where the recording is too short for it."""
    reach = max(1, round(LONGEST_LAG_S * motion.rate_hz))
    stretches = [piece for piece in motion.stretches if len(piece.effort) > 3 * reach]
    if not stretches or not _enough(motion, stretches):
        return None
    regressions = _regressions(stretches, reach)
    unexplained = np.array([regression.unexplained for regression in regressions])
    known = np.isfinite(unexplained).all(axis=1)
    gain = -np.log(unexplained[known]).mean(axis=0) if known.any() else np.zeros(2 * reach + 1)
    at = int(np.argmax(gain))  # a delay of gravity looks like friction with the wrong sign
    return EffortRegression(
        explained=1.0 - unexplained[:, at],
        friction_cosine=np.array([each.friction_cosine[at] for each in regressions]),
        friction_weight=np.array([each.friction_weight[at] for each in regressions]),
        lag_s=peak(gain, motion.rate_hz),
        lag_gain=float(1.0 - np.exp(gain[reach] - gain[at])),
    )


def _enough(motion: SmoothMotion, stretches: Sequence[Stretch]) -> bool:
    seconds = sum(len(stretch.effort) for stretch in stretches) / motion.rate_hz
    terms = 3 * stretches[0].effort.shape[1] + 3
    independent = seconds * min(SAMPLES_PER_SECOND, motion.rate_hz)
    return bool(independent > LEAST_SAMPLES_PER_TERM * terms)


@dataclass(frozen=True, eq=False)
class _Regression:
    """Of one joint's effort, at each of L lags: arrays of shape (L,)."""

    unexplained: Array
    friction_cosine: Array
    friction_weight: Array


def _regressions(stretches: Sequence[Stretch], reach: int) -> list[_Regression]:
    lags = range(-reach, reach + 1)
    efforts = np.array([shifted(stretches, 'effort', reach, lag) for lag in lags])
    velocity = shifted(stretches, 'velocity', reach, 0)
    basis, _ = np.linalg.qr(_unit(_motion_terms(stretches, reach)))
    return [
        _regression(basis, velocity[:, joint], efforts[:, :, joint].T)
        for joint in range(velocity.shape[1])
    ]


def _regression(basis: Array, velocity: Array, effort: Array) -> _Regression:
    friction = _friction(velocity)
    own_friction = friction - basis @ (basis.T @ friction)  # what nothing else explains
    own_velocity = own_friction[:, 0]
    own, _ = np.linalg.qr(own_friction)
    effort = effort - effort.mean(axis=0)
    total = np.square(effort).sum(axis=0)
    without = total - np.square(basis.T @ effort).sum(axis=0)
    shares = own.T @ effort
    rest = without - np.square(shares).sum(axis=0)
    norms = np.sqrt(np.square(shares).sum(axis=0) * (own_velocity @ own_velocity))
    cosine = (own.T @ own_velocity) @ shares / norms
    return _Regression(rest / total, cosine, without / rest)


def _motion_terms(stretches: Sequence[Stretch], reach: int) -> Array:
    position = shifted(stretches, 'position', reach, 0)
    acceleration = shifted(stretches, 'acceleration', reach, 0)
    terms = np.concatenate([np.sin(position), np.cos(position), acceleration], axis=1)
    varying = terms.std(axis=0) > LEAST_VARIATION
    return np.column_stack([np.ones(len(terms)), terms[:, varying]])


def _friction(velocity: Array) -> Array:
    width = SIGN_WIDTH * np.sqrt(np.mean(np.square(velocity)))
    return _unit(np.column_stack([velocity, np.tanh(velocity / width)]))


def _unit(terms: Array) -> Array:
    return terms / np.sqrt(np.mean(np.square(terms), axis=0))
