"""Whether a reference is one that the model can know: training range, standard deviation."""

from __future__ import annotations

from collections import Counter

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.rules import Policy

SMALLEST = 1e-12
"""In place of a range or a standard deviation of zero: whatever differs is beyond it."""


class TrainingRange:
    """
    Smallest box around the training samples.

    Parameters
    ----------
    low, high : ndarray, shape (3, n)
        Positions, velocities, accelerations.

    """

    def __init__(self, low: Array, high: Array) -> None:
        self._low, self._high = low, high
        self._centre = 0.5 * (low + high)
        self._edge = np.maximum(0.5 * (high - low), SMALLEST)

    def widened(self, margins: Array) -> TrainingRange:
        """
        Return the range with something added to each side.

        Parameters
        ----------
        margins : ndarray, shape (n,)
            As a share of half the range.

        """
        more = 0.5 * margins * (self._high - self._low)
        return TrainingRange(self._low - more, self._high + more)

    def excess(self, states: Array) -> Array:
        """
        Tell how far outside samples are.

        Parameters
        ----------
        states : ndarray, shape (3, n) or (3, N, n)
            Positions, velocities, accelerations.

        Returns
        -------
        ndarray, shape () or (N,)
            Of the worst joint: its distance from the centre by that of the edge, 1 at the edge.

        """
        shape = (3, *[1] * (states.ndim - 2), -1)
        distance = np.abs(states - self._centre.reshape(shape)) / self._edge.reshape(shape)
        return np.asarray(distance.max(axis=(0, -1)))


def std_excess(std: Array, limits: Array) -> Array:
    """Return the standard deviation of the worst joint by its limit, 1 at the limit."""
    return np.asarray((std / np.maximum(limits, SMALLEST)).max(axis=-1))


def factors(policy: Policy, excess: Array, counts: Counter[str], key: str) -> Array:
    """
    Apply a policy.

    Parameters
    ----------
    policy : Policy
    excess : ndarray
        Above 1 where a sample is doubtful.
    counts : Counter
        Gets the number of doubtful samples.
    key : str
        Under this key.

    Returns
    -------
    ndarray, shape as excess
        Factor on the torques of all joints: with `scale` it falls from 1 at the edge to 0 at
        twice its distance, with `zero` at once.

    """
    counts[key] += int(np.count_nonzero(excess > 1.0))
    if policy is Policy.SCALE:
        return np.clip(2.0 - excess, 0.0, 1.0)
    if policy is Policy.ZERO:
        return np.where(excess > 1.0, 0.0, 1.0)
    return np.ones_like(excess)
