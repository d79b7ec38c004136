"""Error measures, each over the samples of a data set."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def nmse_percent(estimate: Floats, truth: Floats) -> Floats:
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


def nmse_percent_without_offset(estimate: Floats, truth: Floats) -> Floats:
    """Compute `nmse_percent` after removing the mean error: for what is known up to a constant."""
    return _relative(np.var(estimate - truth, axis=0), truth)


def rmse(estimate: Floats, truth: Floats) -> Floats:
    """Root mean squared error in the unit of the arguments, shape () or (n,)."""
    error: Floats = np.sqrt(np.mean(np.square(estimate - truth), axis=0))
    return error


def not_positive_definite_percent(smallest_eigenvalue: Floats) -> float:
    """Share [percent] of inertia matrices whose smallest eigenvalue (N,) is not positive."""
    return 100.0 * float(np.mean(smallest_eigenvalue <= 0))


def _relative(squared_error: Floats, truth: Floats) -> Floats:
    variance = np.var(truth, axis=0)
    varies = variance > 0
    return np.where(varies, 100.0 * squared_error / np.where(varies, variance, 1.0), np.nan)
