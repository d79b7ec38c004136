"""How sure the model is, at as many samples as a plot needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.evaluation.estimator import Uncertain
from lip_id_ros.evaluation.outcome import deviation, Outcome
from lip_id_ros.progress import Progress, silent

MOST_SAMPLES = 200  # a standard deviation costs far more than a prediction


@dataclass(frozen=True)
class Band:
    """
    Predicted standard deviations at some of the samples.

    Attributes
    ----------
    rows : ndarray of int, shape (B,)
        Numbers of the samples, increasing.
    tau : ndarray, shape (B, n)
        Of measured torques: that of the prediction and of the noise [N m or N].
    kinetic, potential : ndarray, shape (B,), or None
        Of the energies [J].

    """

    rows: IntArray
    tau: Array
    kinetic: Array
    potential: Array | None

    def at(self, rows: IntArray, std: Array) -> Array:
        """
        Interpolate standard deviations (B,) between the samples at which they are known.

        Parameters
        ----------
        rows : ndarray of int, shape (R,)
            Numbers of samples.
        std : ndarray, shape (B,)
            A column of the band.

        """
        return np.interp(rows, self.rows, std)


def band(
    estimator: Uncertain, outcome: Outcome, noise_std: Array, progress: Progress = silent
) -> Band:
    """
    Compute standard deviations at evenly spread samples.

    Parameters
    ----------
    estimator : Uncertain
        Such as a `Predictor`.
    outcome : Outcome
    noise_std : ndarray, shape (n,)
        Of the measured torques [N m or N].
    progress : Progress

    """
    n_samples = outcome.dataset.n_samples
    spread = np.linspace(0, n_samples - 1, min(MOST_SAMPLES, n_samples))
    rows = spread.round().astype(np.int64)
    std = deviation(estimator, outcome.dataset.select(rows), progress)
    return Band(rows, np.hypot(std.tau, noise_std), std.kinetic, std.potential)
