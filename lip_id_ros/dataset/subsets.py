"""Row numbers of subsets of a data set: samples that cover the motion, and blocks of them."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, IndexArray, IntArray

GUARD = 8
"""
Samples between training data and a left-out block.

Two periods of the low-pass where every sample that preprocessing keeps is a quarter of one.
"""
_NEAR = 0.1
"""A cut moves to the end of a segment that is within this share of a block."""


def farthest_points(points: Array, count: int) -> IndexArray:
    """
    Choose points of shape (N, d) by farthest-point selection, in standard deviations.

    Returns increasing row numbers; fewer than `count` where the rest only repeats them. Begins
    from the point nearest the mean; no randomness.

    """
    if count >= len(points):
        return np.arange(len(points))
    deviation = points.std(axis=0)
    scaled = (points - points.mean(axis=0)) / np.where(deviation > 0.0, deviation, 1.0)
    chosen = [int(np.argmin((scaled**2).sum(axis=1)))]
    distance = ((scaled - scaled[chosen[0]]) ** 2).sum(axis=1)
    for _ in range(count - 1):
        farthest = int(np.argmax(distance))
        if distance[farthest] == 0.0:
            break
        chosen.append(farthest)
        np.minimum(distance, ((scaled - scaled[farthest]) ** 2).sum(axis=1), out=distance)
    return np.sort(np.array(chosen, dtype=np.intp))


def contiguous_cuts(segment: IntArray, count: int) -> IndexArray:
    """
    Return where to cut N samples into 1 to N blocks of about the same size, shape (count + 1,).

    A cut moves to the beginning of a segment where one is near.

    """
    size = segment.size
    begins = np.concatenate([[0], np.flatnonzero(np.diff(segment)) + 1, [size]])
    even = np.round(np.linspace(0, size, count + 1)).astype(np.intp)
    nearest = begins[np.argmin(np.abs(begins[:, np.newaxis] - even), axis=0)]
    cuts: IndexArray = np.where(np.abs(nearest - even) <= _NEAR * size / count, nearest, even)
    return cuts
