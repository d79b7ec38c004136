"""Efforts that were clipped before noise was added to them."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, runs

WINDOW = 9
"""Samples of a moving mean, which leaves a third of the noise."""
NOISE_OF_DIFFERENCE = 1.4826 / np.sqrt(20.0)
"""Standard deviation of white noise over the median size of its third difference."""
REACH, LEAST_WIDTH, MOST_WIDTH = 7.0, 0.002, 0.1
"""Width of the last band of the range, in standard deviations and as shares of the range."""
CROWDED, LEAST_VISITS, LEAST_RUN, BOTH_WAYS = 6.0, 4, 5, 0.1
"""
Samples there over those of a band beside it, separate visits of so many samples, and the least
share of them that goes either way.
"""


def noisy_share(values: Array, position: Array) -> float:
    """
    Return the share of the samples (N,) near a level that was clipped, 0 where there is none.

    A smooth peak has 2.7 times as many samples in the last band as in the mean of the two before.
    Friction alone is near a level while its joint moves in one direction, and is not clipped.
    """
    if values.size < WINDOW + 3:
        return 0.0
    noise = NOISE_OF_DIFFERENCE * float(np.median(np.abs(np.diff(values, 3)))) / np.sqrt(WINDOW)
    smooth = np.convolve(values, np.full(WINDOW, 1.0 / WINDOW), 'valid')
    spread = float(np.ptp(smooth))
    width = max(LEAST_WIDTH * spread, REACH * noise)
    if width > MOST_WIDTH * spread:
        return 0.0
    ends = (smooth.max() - smooth, smooth - smooth.min())
    forward = position[WINDOW - 1 :] > position[: 1 - WINDOW]
    return max(_share(below < width, below < 3.0 * width, forward) for below in ends)


def _share(last: BoolArray, three: BoolArray, forward: BoolArray) -> float:
    first, end = runs(last)
    visits = int((end - first >= LEAST_RUN).sum())
    beside = 0.5 * float(three.sum() - last.sum())
    is_crowded = last.sum() > CROWDED * (beside + 1.0) and visits >= LEAST_VISITS
    ways = float(forward[last].mean())
    return float(last.mean()) if is_crowded and min(ways, 1.0 - ways) > BOTH_WAYS else 0.0
