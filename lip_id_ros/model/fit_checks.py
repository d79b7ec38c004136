"""What every fit is judged by, at samples of its training data."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.model.inverse_dynamics_model import InverseDynamicsModel

MOST_CHECKED = 1000
"""Samples at which M(q) is checked, at most."""


def with_checks(model: InverseDynamicsModel, q: Array, tau: Array) -> InverseDynamicsModel:
    """
    Add checks to the summary of a model.

    `inertia_not_pd_percent` is the share of samples at which M(q) is not positive definite,
    `inertia_min_eigenvalue` its smallest eigenvalue at any of them [kg m^2 or kg], and
    `unexplained_percent` the noise variance of each joint, or its error on left-out blocks where
    that is larger, in percent of the variance of its torque (None where that is constant).

    `q`, `tau`, shape (N, n): positions and torques of the samples of its fit [rad or m, N m or N].
    """
    inertia = model.inertia_matrix(q[:: 1 + len(q) // MOST_CHECKED])
    smallest = np.linalg.eigvalsh(inertia)[:, 0]
    variance = tau.var(axis=0)
    squares = np.maximum(model.noise_std**2, _left_out_squares(model, variance))
    checks: dict[str, Any] = {
        'inertia_not_pd_percent': not_positive_definite_percent(smallest),
        'inertia_min_eigenvalue': float(smallest.min()),
        'unexplained_percent': [
            100.0 * float(square) / float(total) if total > 0.0 else None
            for square, total in zip(squares, variance, strict=True)
        ],
    }
    return replace(model, summary={**model.summary, **checks})


def not_positive_definite_percent(smallest_eigenvalue: Array) -> float:
    """Share [percent] of inertia matrices whose smallest eigenvalue (N,) is not positive."""
    return 100.0 * float(np.mean(smallest_eigenvalue <= 0))


def _left_out_squares(model: InverseDynamicsModel, variance: Array) -> Array:
    """Return mean squares of predictions' errors on left-out blocks; 0 where not known, (n,)."""
    known = model.summary.get('unexplained_left_out')
    shares = model.summary.get('unpredicted_left_out', known)
    if shares is None:
        return np.zeros(len(variance))
    # the noise of a joint with a Gaussian process is its error on left-out blocks
    has_process = model.remainder.joints if model.remainder else np.zeros(len(variance), bool)
    return np.where(has_process, 0.0, np.asarray(shares) * variance)
