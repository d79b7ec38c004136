"""Recent errors of torques: whether what was learned is trusted, and how wide deviations are."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.friction.dahl import LONGEST_GAP_S

MEMORY_S, PROBATION_S = 10.0, 30.0
"""Time of motion over which what was learned is judged, and before it may be forgotten [s]."""

WORSE, MOST_DISTURBED = 1.1, 0.25
"""
Errors in those of the fit at which what was learned is forgotten, and share of disturbances above
which nothing is trusted.
"""

PRESUMED = 0.5
"""Share of disturbances that is presumed at first: nothing is trusted for 7 s of motion."""

MOST_RATIO = 1e100
"""Errors are no larger, in deviations: their squares are finite, and forgotten in time."""

MOST_SQUARE = 36.0
"""Largest squared error that widens deviations, in its variance."""


class RecentErrors:
    """
    Errors of torques over the last seconds of motion, of what was learned and of the fit.

    `excess`, `excess_moving`, shape (n,): squared errors of each joint's torques in the variances
    that the filter knows, of all samples and of those at which the joint moves.

    """

    def __init__(self, n_joints: int) -> None:
        self._losses, self._disturbed, self._seconds = np.zeros(2), PRESUMED, 0.0
        self.excess, self.excess_moving = np.ones((2, n_joints))

    @property
    def squares(self) -> tuple[float, float]:
        """
        Squares of errors of what was learned and of the fit, in the variance of the noise.

        With x for these, exp(mean(log(1 + x))) - 1: the mean of small ones, and not that of few
        that are large, as in contact.

        """
        learned, fitted = np.expm1(self._losses).tolist()
        return learned, fitted

    @property
    def is_trusted(self) -> bool:
        """Whether what was learned has been better than the fit, with few disturbances."""
        learned, fitted = self.squares
        return bool(learned <= fitted and self._disturbed < MOST_DISTURBED)

    @property
    def is_worse(self) -> bool:
        """Whether what was learned has been worse than the fit for long enough."""
        learned, fitted = self.squares
        return self._seconds > PROBATION_S and learned > WORSE * fitted

    def judge(
        self, steps: Array, learned: Array, fitted: Array, std: Array, disturbed: BoolArray
    ) -> None:
        """
        Take in N samples.

        `steps`, shape (N,): time since the sample before [s]. `learned`, `fitted`, shape (N, n):
        errors. `std`, same shape: deviations of the noise, infinite where a joint rests.
        `disturbed`, shape (N,).

        """
        moving, seconds = motion(steps, std)
        if not moving.any():
            return
        kept = np.exp(-seconds / MEMORY_S)
        ratios = (np.minimum(np.abs(x / std)[moving], MOST_RATIO) for x in (learned, fitted))
        losses = [np.mean(np.log1p(np.square(x))) for x in ratios]
        self._losses = kept * self._losses + (1.0 - kept) * np.array(losses)
        share = float(np.mean(disturbed[moving]))
        self._disturbed = kept * self._disturbed + (1.0 - kept) * share
        self._seconds += seconds

    def widen(self, steps: Array, errors: Array, variance: Array, rests: BoolArray) -> None:
        """
        Learn how much larger errors (N, n) are than the filter knows.

        `variance`, `rests`, same shape: of the torques, and where a joint rests. One that rests is
        held by any friction, which says nothing of what is known of the arm.

        """
        kept = np.exp(-np.minimum(steps, LONGEST_GAP_S) / MEMORY_S)
        ratios = np.minimum(errors**2 / variance, MOST_SQUARE)
        for share, ratio, rest in zip(kept, ratios, rests, strict=True):
            self.excess = share * self.excess + (1.0 - share) * ratio
            moving = share * self.excess_moving + (1.0 - share) * ratio
            self.excess_moving = np.where(rest, self.excess_moving, moving)


def motion(steps: Array, noise: Array) -> tuple[BoolArray, float]:
    """Mark the samples at which a joint moves, and return their time, of pauses the first part."""
    moving = np.isfinite(noise).any(axis=1)
    return moving, float(np.minimum(steps, LONGEST_GAP_S)[moving].sum())
