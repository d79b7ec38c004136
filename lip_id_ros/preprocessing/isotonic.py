"""Isotonic regression, which the SciPy 1.11 of Ubuntu 24.04 lacks."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array


def isotonic(values: Array) -> Array:
    """Return the non-decreasing values of least squares."""
    means: list[float] = []
    counts: list[int] = []
    for value in values.tolist():
        mean, count = value, 1
        while means and means[-1] >= mean:
            before = counts.pop()
            mean = (means.pop() * before + mean * count) / (before + count)
            count += before
        means.append(mean)
        counts.append(count)
    return np.repeat(np.array(means), counts)
