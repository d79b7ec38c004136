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
    return covering_points(scaled, count)


def covering_points(points: Array, count: int, near: float = 0.0) -> IndexArray:
    """
    Choose points of shape (N, d) until none is farther than `near` from one of them.

    Each is the farthest from those before (Gonzalez 1985); the first is the nearest to zero.
    Returns increasing row numbers, at most `count`.
    """
    chosen = [int(np.argmin((points**2).sum(axis=1)))]
    squares = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    for _ in range(count - 1):
        farthest = int(np.argmax(squares))
        if squares[farthest] <= near**2:
            break
        chosen.append(farthest)
        np.minimum(squares, ((points - points[farthest]) ** 2).sum(axis=1), out=squares)
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
