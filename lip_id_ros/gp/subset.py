"""Which samples to use when not all are used: those that cover the motion best."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.dataset.subsets import farthest_points
from lip_id_ros.kernels import JointBasis


def spread(basis: JointBasis, q: Array, dq: Array, ddq: Array, count: int) -> IndexArray:
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
    f, _ = basis.features(q)
    return farthest_points(np.concatenate([f[0].T, f[1].T, dq, ddq], axis=1), count)
