"""
Efforts regressed on the motion: whether they follow it, how late, and of which joint.

The inertia matrix is symmetric and positive definite, and friction brakes its own joint. So the
mean responses of all efforts to all accelerations, and to all velocities, are matrices with
positive diagonals, whose pairs of off-diagonal elements are smaller than those of the diagonal.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
import math

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.motion import peak, shifted, SmoothMotion, SmoothSegment

LONGEST_EFFORT_LAG_S = 0.12
SAMPLES_PER_SECOND = 8.0
"""Independent ones, at the cut-off of the low-pass."""
LEAST_SAMPLES_PER_TERM = 6.0
SIGN_WIDTH = 0.1
LEAST_VARIATION = 1e-6
"""Terms of joints that stand still are left out."""


@dataclass(frozen=True, eq=False)
class EffortRegression:
    """
    How efforts follow the motion, by a linear regression of each.

    Terms are sines and cosines of all positions, all accelerations, and the joint's own velocity
    and its smoothed sign. That is no dynamics, but enough to see whether effort follows the motion
    at all, whether friction acts against it, and at which delay the two fit best.

    `explained`, shape (n,): share of the variance of each effort. `friction_cosine`, shape (n,):
    between velocity and the friction that was found, both without what position and acceleration
    explain: about 1 for effort with the right sign, -1 where it is reversed. `friction_weight`,
    shape (n,): how many times larger the unexplained variance is without friction. `lag_s`,
    `lag_gain`: as in `EffortLags`.
    """

    explained: Array
    friction_cosine: Array
    friction_weight: Array
    lag_s: float
    lag_gain: float


def effort_regression(motion: SmoothMotion) -> EffortRegression | None:
    """Regress efforts on the motion; None where the recording is too short for it."""
    segments, reach = effort_segments(motion)
    if not segments or not _enough(motion, segments):
        return None
    regressions = _regressions(segments, reach)
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


def effort_segments(motion: SmoothMotion) -> tuple[list[SmoothSegment], int]:
    """Return the segments in which efforts can be shifted, and by how many samples at most."""
    reach = max(1, round(LONGEST_EFFORT_LAG_S * motion.rate_hz))
    return [piece for piece in motion.segments if len(piece.effort) > 3 * reach], reach


def _enough(motion: SmoothMotion, segments: Sequence[SmoothSegment]) -> bool:
    seconds = sum(len(segment.effort) for segment in segments) / motion.rate_hz
    terms = 3 * segments[0].effort.shape[1] + 3
    independent = seconds * min(SAMPLES_PER_SECOND, motion.rate_hz)
    return bool(independent > LEAST_SAMPLES_PER_TERM * terms)


@dataclass(frozen=True, eq=False)
class _Regression:
    """Of one joint's effort, at each of L lags: arrays of shape (L,)."""

    unexplained: Array
    friction_cosine: Array
    friction_weight: Array


def _regressions(segments: Sequence[SmoothSegment], reach: int) -> list[_Regression]:
    lags = range(-reach, reach + 1)
    efforts = np.array([shifted(segments, 'effort', reach, lag) for lag in lags])
    velocity = shifted(segments, 'velocity', reach, 0)
    basis, _ = np.linalg.qr(_unit(_motion_terms(segments, reach)))
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


def _motion_terms(segments: Sequence[SmoothSegment], reach: int) -> Array:
    position = shifted(segments, 'position', reach, 0)
    acceleration = shifted(segments, 'acceleration', reach, 0)
    terms = np.concatenate([np.sin(position), np.cos(position), acceleration], axis=1)
    varying = terms.std(axis=0) > LEAST_VARIATION
    return np.column_stack([np.ones(len(terms)), terms[:, varying]])


def _friction(velocity: Array) -> Array:
    width = SIGN_WIDTH * np.sqrt(np.mean(np.square(velocity)))
    return _unit(np.column_stack([velocity, np.tanh(velocity / width)]))


def _unit(terms: Array) -> Array:
    return terms / np.sqrt(np.mean(np.square(terms), axis=0))


LEAST_SAMPLES_OF_ALL, LEAST_OF_ONE = 2.5, 6.0
"""Independent ones, for the lag of all joints together and for that of each."""
MOST_ROWS = 10_000


@dataclass(frozen=True, eq=False)
class EffortLags:
    """
    Lags at which a regression of the efforts on the motion leaves least.

    `lag_s`: by how much the efforts of all joints come late [s], nan where it is unknown. `gain`:
    the share of the unexplained variance that this lag takes away. `joint_lag_s`, `joint_gain`,
    shape (n,): likewise of each joint by itself, which takes a longer recording.
    """

    lag_s: float
    gain: float
    joint_lag_s: Array
    joint_gain: Array


def effort_lags(motion: SmoothMotion) -> EffortLags | None:
    """Regress efforts, shifted in time, on the motion; None where the recording is too short."""
    segments, reach = effort_segments(motion)
    n = segments[0].effort.shape[1] if segments else 0
    rows = sum(len(piece.effort) - 2 * reach for piece in segments)
    independent = rows / motion.rate_hz * min(SAMPLES_PER_SECOND, motion.rate_hz)
    n_terms = 3 * n * n + 3 * n + 1
    if not segments or independent < LEAST_SAMPLES_OF_ALL * n_terms:
        return None
    every = max(1, rows // MOST_ROWS)
    names = ('position', 'velocity', 'acceleration')
    basis = _basis(*(shifted(segments, name, reach, 0)[::every] for name in names))
    left = [
        _unexplained(basis, shifted(segments, 'effort', reach, lag)[::every])
        for lag in range(-reach, reach + 1)
    ]
    gain = -np.log(np.array(left))
    known = np.isfinite(gain).all(axis=0)
    common = gain[:, known].mean(axis=1) if known.any() else np.zeros(len(gain))
    lag_s = np.array([peak(column, motion.rate_hz) for column in gain.T])
    return EffortLags(
        lag_s=peak(common, motion.rate_hz),
        gain=float(_share(common, reach)),
        joint_lag_s=lag_s if independent > LEAST_OF_ONE * n_terms else np.full(n, np.nan),
        joint_gain=_share(gain, reach),
    )


def _share(gain: Array, reach: int) -> Array:
    """Return the share that the best lag takes away from what no lag leaves."""
    return np.asarray(1.0 - np.exp(gain[reach] - gain.max(axis=0)))


def _basis(position: Array, velocity: Array, acceleration: Array) -> Array:
    """Return an orthonormal basis of terms as the torques of an arm have, shape (N, P)."""
    pairs = combinations(position.T, 2)
    sums = [sign * one + other for one, other in pairs for sign in (1.0, -1.0)]
    angles = np.column_stack([position, *sums])
    inertia = acceleration[:, :, np.newaxis] * np.cos(position)[:, np.newaxis]
    width = SIGN_WIDTH * np.sqrt(np.mean(np.square(velocity), axis=0))
    sign = np.tanh(velocity / np.maximum(width, LEAST_VARIATION))
    every = [np.sin(angles), np.cos(angles), acceleration, velocity, sign]
    terms = np.hstack([*every, inertia.reshape(len(position), -1)])
    terms = terms[:, terms.std(axis=0) > LEAST_VARIATION]
    terms = np.column_stack([np.ones(len(terms)), terms / terms.std(axis=0)])
    return np.asarray(np.linalg.qr(terms)[0])


def _unexplained(basis: Array, effort: Array) -> Array:
    effort = effort - effort.mean(axis=0)
    total: Array = np.square(effort).sum(axis=0)
    return 1.0 - np.square(basis.T @ effort).sum(axis=0) / total


RIDGE = 1e-4
"""Of terms with a mean square of 1, since joints may move in step."""


@dataclass(frozen=True, eq=False)
class Responses:
    """Mean responses (n, n) of efforts (rows) to a signal of all joints, with standard errors."""

    value: Array
    error: Array

    @property
    def own(self) -> Array:
        """Return the responses to the own joint in standard errors, shape (n,)."""
        own: Array = np.diag(self.value) / np.diag(self.error)
        return own

    @property
    def crossed(self) -> Array:
        """
        Return in standard errors by how much pairs answer rather to each other, (n, n).

        Negative where they answer rather to their own motion.
        """
        value, error, own = self.value, self.error, np.diag(self.value)
        excess = value * value.T - np.outer(own, own)
        across, along = value * error.T, np.outer(own, np.diag(self.error))
        deviation = np.sqrt(across**2 + across.T**2 + along**2 + along.T**2)
        each, rather = value / error, np.nan_to_num(excess / deviation)
        both = np.maximum(np.nan_to_num(np.minimum(each, each.T)), 0.0)
        return np.asarray(np.minimum(both, rather))


def responses(motion: SmoothMotion, lag_s: float) -> tuple[Responses, Responses]:
    """
    Regress all efforts on accelerations, velocities, and sines and cosines of positions.

    `motion` is long enough for `effort_regression`; efforts come late by `lag_s`, 0 where
    it is not finite. Returns responses to accelerations [N m s^2], and mean friction along the
    velocity.
    """
    segments, reach = effort_segments(motion)
    lag = round(lag_s * motion.rate_hz) if math.isfinite(lag_s) else 0
    names = ('position', 'velocity', 'acceleration')
    position, velocity, acceleration = (shifted(segments, name, reach, 0) for name in names)
    effort = shifted(segments, 'effort', reach, lag)
    n = effort.shape[1]
    speed = _size(velocity)
    sign = np.tanh(velocity / (SIGN_WIDTH * speed))
    terms = np.hstack([acceleration, velocity, sign, np.sin(position), np.cos(position)])
    terms = terms - terms.mean(axis=0)
    size = _size(terms)
    terms /= size
    inverse = np.linalg.inv(terms.T @ terms / len(terms) + RIDGE * np.eye(terms.shape[1]))
    effort = effort - effort.mean(axis=0)
    weights = inverse @ (terms.T @ effort) / len(terms)
    variance = np.var(effort - terms @ weights, axis=0)
    free = len(terms) / motion.rate_hz * min(SAMPLES_PER_SECOND, motion.rate_hz) - len(inverse)
    error = np.sqrt(np.outer(variance / max(free, 1.0), np.diag(inverse)))
    along = (velocity / speed)[:, np.newaxis] * _pairs(terms, n)
    friction = np.einsum('sk,isk->ik', along.mean(axis=0), _pairs(weights.T, n))
    worst = np.maximum(error[:, n : 2 * n], error[:, 2 * n : 3 * n])
    inertia = Responses(weights[:n].T / size[:n], error[:, :n] / size[:n])
    return inertia, Responses(friction, worst)


def _pairs(columns: Array, n: int) -> Array:
    """Return the columns (., m) of velocity and sign of each joint, shape (., 2, n)."""
    return columns[:, n : 3 * n].reshape(-1, 2, n)


def _size(terms: Array) -> Array:
    return np.maximum(np.sqrt(np.mean(np.square(terms), axis=0)), LEAST_VARIATION)
