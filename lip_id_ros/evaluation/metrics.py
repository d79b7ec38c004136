"""Error measures, each over the samples of a data set."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array


def nmse_percent(estimate: Array, truth: Array) -> Array:
    """
    Compute the normalized mean squared error, 100 mean((estimate - truth)^2) / var(truth).

    Parameters
    ----------
    estimate, truth : ndarray, shape (N,) or (N, n)

    Returns
    -------
    ndarray, shape () or (n,)
        Percent; nan where the truth does not vary.

    """
    return _relative(np.mean(np.square(estimate - truth), axis=0), truth)


def nmse_percent_without_offset(estimate: Array, truth: Array) -> Array:
    """Compute `nmse_percent` after removing the mean error: for what is known up to a constant."""
    return _relative(np.var(estimate - truth, axis=0), truth)


def rmse(estimate: Array, truth: Array) -> Array:
    """Root mean squared error in the unit of the arguments, shape () or (n,)."""
    error: Array = np.sqrt(np.mean(np.square(estimate - truth), axis=0))
    return error


def not_positive_definite_percent(smallest_eigenvalue: Array) -> float:
    """Share [percent] of inertia matrices whose smallest eigenvalue (N,) is not positive."""
    return 100.0 * float(np.mean(smallest_eigenvalue <= 0))


def _relative(squared_error: Array, truth: Array) -> Array:
    variance = np.var(truth, axis=0)
    varies = variance > 0
    return np.where(varies, 100.0 * squared_error / np.where(varies, variance, 1.0), np.nan)
