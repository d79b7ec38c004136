"""Whether efforts follow positions as they are, or read in degrees."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.motion import LEAST_VARIATION, SIGN_WIDTH, SmoothMotion

DEGREE = np.pi / 180.0
FOLDS, RIDGE = 6, 1e-4


def left_by_degrees(motion: SmoothMotion) -> float:
    """Return the mean squares of left-out efforts with positions in degrees over those in rad."""
    position, velocity, acceleration, effort = (
        motion.joined(name) for name in ('position', 'velocity', 'acceleration', 'effort')
    )
    effort = effort[:, effort.std(axis=0) > LEAST_VARIATION]
    speed = np.maximum(velocity.std(axis=0), LEAST_VARIATION)
    others = [acceleration, velocity, np.tanh(velocity / (SIGN_WIDTH * speed))]
    angles = (position, DEGREE * position)
    recorded, read = (
        _left_out(np.hstack([np.sin(each), np.cos(each), *others]), effort) for each in angles
    )
    return float(np.exp(np.mean(np.log(read / recorded))))


def _left_out(terms: Array, effort: Array) -> Array:
    """Return mean squares of efforts that are predicted from the other folds, at most 1, (n,)."""
    terms = (terms - terms.mean(axis=0)) / np.maximum(terms.std(axis=0), LEAST_VARIATION)
    terms = np.column_stack([np.ones(len(terms)), terms])
    effort = (effort - effort.mean(axis=0)) / effort.std(axis=0)
    residuals = []
    for fold in np.array_split(np.arange(len(terms)), FOLDS):
        rest, values = np.delete(terms, fold, axis=0), np.delete(effort, fold, axis=0)
        normal = rest.T @ rest + RIDGE * len(rest) * np.eye(terms.shape[1])
        residuals.append(effort[fold] - terms[fold] @ np.linalg.solve(normal, rest.T @ values))
    return np.minimum(np.mean(np.square(np.concatenate(residuals)), axis=0), 1.0)
