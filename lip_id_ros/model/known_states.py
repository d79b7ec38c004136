"""
How far a state is from the training data, in how far left-out training data were from the rest.

In standard deviations of q, dq, ddq to the nearest of a few states that cover the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array

LIKE_THE_RECORDING = 1.25
"""Largest novelty that is called like the recording."""

WELL_KNOWN = 0.5
"""Largest novelty that is called known."""


@dataclass(frozen=True, eq=False)
class KnownStates:
    """Training states that cover the others, and the distance of left-out ones."""

    states: Array  # (K, 3 n), q, dq, ddq in units of the scale
    scale: Array  # (3 n,), deviations times the root of 3 n
    left_out: float  # median distance of those in motion to the rest

    def distances(self, states: Array) -> Array:
        """Return distances to the nearest, (N,), of states q, dq, ddq side by side, (N, 3 n)."""
        return nearest(states / self.scale, self.states)

    def novelty(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return how many times as far as left-out training states are N states, shape (N,)."""
        return self.distances(np.hstack([q, dq, ddq])) / self.left_out


def stored_states(states: Array) -> Array:
    """Return states as a model file has them, to a thousandth of their size."""
    return states.astype(np.float16).astype(np.float64)


def nearest(points: Array, known: Array) -> Array:
    """Return distances of points (N, d) to the nearest of those that are known (K, d), (N,)."""
    squares = ((known**2).sum(axis=1) - 2.0 * (points @ known.T)).min(axis=1)
    return np.asarray(np.sqrt(np.maximum(squares + (points**2).sum(axis=1), 0.0)))


def novelty_in_words(novelty: float) -> str:
    """Return what a novelty means, as the end of a sentence about motions."""
    if novelty <= WELL_KNOWN:
        return 'much nearer to the training data than new motion'
    if novelty <= LIKE_THE_RECORDING:
        return 'like the recording'
    times = 'twice' if 1.95 <= novelty < 2.05 else f'{novelty:.2g} times'
    return f'{times} as far from the training data'
