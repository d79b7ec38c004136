"""What a model says of a data set, computed once for figures, tables and plots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ModelError
from lip_id_ros.evaluation.estimator import Described, Estimator, Uncertain
from lip_id_ros.model import Prediction, StandardDeviation
from lip_id_ros.progress import Progress, silent

BLOCK = 500
UNCERTAIN_BLOCK = 50  # standard deviations need far more memory per sample


@dataclass(frozen=True)
class Outcome:
    """
    Estimates beside the samples they are for.

    Attributes
    ----------
    dataset : Dataset
        N samples.
    prediction : Prediction
        Estimates at the same N samples.
    smallest_eigenvalue : ndarray, shape (N,)
        Of the estimated inertia matrix [kg m^2 or kg].

    """

    dataset: Dataset
    prediction: Prediction
    smallest_eigenvalue: Array

    @property
    def reference(self) -> Array:
        """Torques [N m or N], shape (N, n), to compare with: the true ones where known."""
        known = self.dataset.tau_noiseless
        return self.dataset.tau if known is None else known


def matched(dataset: Dataset, model: Described) -> Dataset:
    """
    Return a data set with the joints of a model, in its order.

    Raises
    ------
    DataError
        If a joint of the model is missing.
    ModelError
        If a joint has another type than the model's.

    """
    ordered = dataset.with_joints(model.joint_names)
    for name, found, expected in zip(
        model.joint_names, ordered.joint_types, model.joint_types, strict=True
    ):
        if found != expected:
            raise ModelError(
                f'joint {name!r} must be {expected} as in the model, but is {found} in the data; '
                'correct recording.joint_types, or fit a new model.'
            )
    return ordered


def run(estimator: Estimator, dataset: Dataset, progress: Progress = silent) -> Outcome:
    """
    Estimate torques, energies and inertia at every sample.

    Parameters
    ----------
    estimator : Estimator
        Such as a `Predictor`.
    dataset : Dataset
        Of the estimator's joints, in its order.
    progress : Progress
        Told after every block of samples.

    Returns
    -------
    Outcome

    """
    predictions, eigenvalues = [], []
    for begin in range(0, dataset.n_samples, BLOCK):
        rows = slice(begin, begin + BLOCK)
        predictions.append(estimator.predict(dataset.q[rows], dataset.dq[rows], dataset.ddq[rows]))
        matrices = estimator.inertia_matrix(dataset.q[rows])
        eigenvalues.append(np.linalg.eigvalsh(matrices)[:, 0])
        progress('predict', min(begin + BLOCK, dataset.n_samples), dataset.n_samples)
    return Outcome(dataset, _joined(predictions), np.concatenate(eigenvalues))


def deviation(
    estimator: Uncertain, dataset: Dataset, progress: Progress = silent
) -> StandardDeviation:
    """
    Compute the standard deviations of torques and energies at every sample.

    Parameters
    ----------
    estimator : Uncertain
        Such as a `Predictor`.
    dataset : Dataset
        Of the estimator's joints, in its order.
    progress : Progress
        Told after every block of samples.

    Returns
    -------
    StandardDeviation

    """
    blocks = []
    for begin in range(0, dataset.n_samples, UNCERTAIN_BLOCK):
        rows = slice(begin, begin + UNCERTAIN_BLOCK)
        blocks.append(
            estimator.standard_deviation(dataset.q[rows], dataset.dq[rows], dataset.ddq[rows])
        )
        done = min(begin + UNCERTAIN_BLOCK, dataset.n_samples)
        progress('standard deviation', done, dataset.n_samples)
    return StandardDeviation(**_columns(blocks, ('tau', 'kinetic', 'potential')))


def _joined(blocks: list[Prediction]) -> Prediction:
    names = ('tau', 'inertial', 'coriolis', 'gravity', 'friction', 'kinetic', 'potential')
    return Prediction(**_columns(blocks, names))


def _columns(blocks: Sequence[object], names: Sequence[str]) -> dict[str, Any]:
    columns = {name: [getattr(block, name) for block in blocks] for name in names}
    return {
        name: None if parts[0] is None else np.concatenate(parts)
        for name, parts in columns.items()
    }
