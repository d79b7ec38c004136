"""
What a crude model of the arm can explain of its efforts.

Each joint's effort is regressed on sines and cosines of all positions, all accelerations, and the
joint's own velocity and its smoothed sign. That is no dynamics, but enough to see whether effort
follows the motion at all, whether friction acts against it, and at which delay the two fit best.

"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.health.lags import peak, shifted
from lip_id_ros.health.motion import Motion, Stretch
from lip_id_ros.recording.joint_samples import Floats

LONGEST_LAG_S = 0.12
SAMPLES_PER_SECOND = 8.0
"""Independent ones, at the cut-off of the low-pass."""
LEAST_SAMPLES_PER_TERM = 2.5
SIGN_WIDTH = 0.1


@dataclass(frozen=True, eq=False)
class Explanation:
    """
    How efforts follow the motion.

    Attributes
    ----------
    explained : ndarray, shape (n,)
        Share of the variance of each effort.
    friction_cosine : ndarray, shape (n,)
        Between velocity and the friction that was found: about 1 for effort with the right sign,
        -1 where it is turned round.
    friction_weight : ndarray, shape (n,)
        How many times larger the unexplained variance is without friction.
    lag_s : float
        By how much the efforts of all joints come late [s]; nan where it cannot be told.
    lag_gain : float
        Share of the unexplained variance that this lag takes away.

    """

    explained: Floats
    friction_cosine: Floats
    friction_weight: Floats
    lag_s: float
    lag_gain: float


def effort_explanation(motion: Motion) -> Explanation | None:
    """Regress efforts on the motion; None where the recording is too short for it."""
    reach = max(1, round(LONGEST_LAG_S * motion.rate_hz))
    stretches = [piece for piece in motion.stretches if len(piece.effort) > 3 * reach]
    if not stretches or not _enough(motion, stretches):
        return None
    joints = range(stretches[0].effort.shape[1])
    lags = range(-reach, reach + 1)
    efforts = [shifted(stretches, 'effort', reach, lag) for lag in lags]
    found = [_joint(stretches, efforts, joint, reach) for joint in joints]
    explained, cosine, weight, unexplained = (np.array(part) for part in zip(*found, strict=True))
    known = np.isfinite(unexplained).all(axis=1)
    gain = -np.log(unexplained[known]).mean(axis=0) if known.any() else np.zeros(len(lags))
    return Explanation(
        explained=explained,
        friction_cosine=cosine,
        friction_weight=weight,
        lag_s=peak(gain, motion.rate_hz),
        lag_gain=float(1.0 - np.exp(gain[reach] - gain.max())),
    )


def _enough(motion: Motion, stretches: Sequence[Stretch]) -> bool:
    seconds = sum(len(stretch.effort) for stretch in stretches) / motion.rate_hz
    terms = 3 * stretches[0].effort.shape[1] + 3
    return seconds * min(SAMPLES_PER_SECOND, motion.rate_hz) > LEAST_SAMPLES_PER_TERM * terms


def _joint(
    stretches: Sequence[Stretch], efforts: Sequence[Floats], joint: int, reach: int
) -> tuple[float, float, float, Floats]:
    velocity = shifted(stretches, 'velocity', reach, 0)[:, joint]
    friction = _friction(velocity)
    others = _unit(_motion_terms(stretches, reach))
    basis, _ = np.linalg.qr(others)
    own = friction - basis @ (basis.T @ friction)
    own_basis, own_triangle = np.linalg.qr(own)
    unexplained, with_friction = [], np.zeros(2)
    left, left_without = 0.0, 0.0
    for number, efforts_at_lag in enumerate(efforts):
        effort = efforts_at_lag[:, joint] - efforts_at_lag[:, joint].mean()
        total = effort @ effort
        without = total - np.square(basis.T @ effort).sum()
        projected = own_basis.T @ effort
        rest = without - np.square(projected).sum()
        unexplained.append(rest / total)
        if number == reach:
            left, left_without, with_friction = rest / total, without / total, projected
    force = friction @ _solved(own_triangle, with_friction)
    cosine = (force @ velocity) / np.sqrt((force @ force) * (velocity @ velocity))
    return 1.0 - left, float(cosine), left_without / left, np.array(unexplained)


def _motion_terms(stretches: Sequence[Stretch], reach: int) -> Floats:
    position = shifted(stretches, 'position', reach, 0)
    acceleration = shifted(stretches, 'acceleration', reach, 0)
    ones = np.ones((len(position), 1))
    return np.concatenate([ones, np.sin(position), np.cos(position), acceleration], axis=1)


def _friction(velocity: Floats) -> Floats:
    width = SIGN_WIDTH * np.sqrt(np.mean(np.square(velocity)))
    return _unit(np.column_stack([velocity, np.tanh(velocity / width)]))


def _unit(terms: Floats) -> Floats:
    return terms / np.sqrt(np.mean(np.square(terms), axis=0))


def _solved(triangle: Floats, right: Floats) -> Floats:
    if np.abs(np.diag(triangle)).min() <= 1e-9 * np.abs(triangle).max():
        return np.full(len(right), np.nan)
    solution: Floats = np.linalg.solve(triangle, right)
    return solution
