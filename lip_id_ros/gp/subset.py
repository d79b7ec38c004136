"""Which samples to use when not all are used: those that cover the motion best."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels import JointBasis

Array = NDArray[np.float64]


def spread(basis: JointBasis, q: Array, dq: Array, ddq: Array, count: int) -> NDArray[np.int64]:
    """
    Choose samples by farthest-point selection in joint features, velocities and accelerations.

    Parameters
    ----------
    basis : JointBasis
    q, dq, ddq : arrays, shape (N, n)
    count : int
        How many; all where there are not more.

    Returns
    -------
    int array, shape (min(count, N),)
        Increasing row numbers; fewer where the rest only repeats them. Begins from the sample
        nearest the mean; no randomness.

    """
    if count >= len(q):
        return np.arange(len(q))
    points = _standardised(basis, q, dq, ddq)
    centre = points.mean(axis=0)
    chosen = [int(np.argmin(((points - centre) ** 2).sum(axis=1)))]
    distance = ((points - points[chosen[0]]) ** 2).sum(axis=1)
    for _ in range(count - 1):
        farthest = int(np.argmax(distance))
        if distance[farthest] == 0.0:
            break
        chosen.append(farthest)
        np.minimum(distance, ((points - points[farthest]) ** 2).sum(axis=1), out=distance)
    return np.sort(chosen)


def _standardised(basis: JointBasis, q: Array, dq: Array, ddq: Array) -> Array:
    f, _ = basis.features(q)
    points = np.concatenate([f[0].T, f[1].T, dq, ddq], axis=1)
    deviation = points.std(axis=0)
    return (points - points.mean(axis=0)) / np.where(deviation > 0.0, deviation, 1.0)
