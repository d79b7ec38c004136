"""Delays of efforts, of all joints together and of each, where a recording is long enough."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.motion import (
    effort_segments,
    LEAST_VARIATION,
    peak,
    SAMPLES_PER_SECOND,
    shifted,
    SIGN_WIDTH,
    SmoothMotion,
)

LEAST_SAMPLES_PER_TERM, LEAST_OF_ONE = 2.5, 6.0
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
    if not segments or independent < LEAST_SAMPLES_PER_TERM * n_terms:
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
