"""Which points to use when not all are used: those that cover the rest best."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, IndexArray


def farthest_points(points: Array, count: int) -> IndexArray:
    """
    Choose points by farthest-point selection, each coordinate in standard deviations.

    Parameters
    ----------
    points : ndarray, shape (N, d)
    count : int
        How many; all where there are not more.

    Returns
    -------
    ndarray of int, shape (min(count, N),)
        Increasing row numbers; fewer where the rest only repeats them. Begins from the point
        nearest the mean; no randomness.

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
