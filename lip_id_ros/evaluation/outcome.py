"""Predictions beside the samples that they are for, computed once for figures and plots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ModelError
from lip_id_ros.model import DynamicsModel, StandardDeviation, TorqueModel, TorquePrediction
from lip_id_ros.progress import Progress, silent

BLOCK = 500
STD_BLOCK = 50  # standard deviations need far more memory per sample

Blocks = TypeVar('Blocks', bound=Any)


@dataclass(frozen=True)
class Outcome:
    """
    Predictions beside the samples that they are for.

    Attributes
    ----------
    dataset : Dataset
        N samples.
    prediction : TorquePrediction
        At the same N samples.
    smallest_eigenvalue : ndarray, shape (N,), or None
        Of the predicted inertia matrix [kg m^2 or kg]; None where the model has none.

    """

    dataset: Dataset
    prediction: TorquePrediction
    smallest_eigenvalue: Array | None = None

    @property
    def reference(self) -> Array:
        """Torques [N m or N], shape (N, n), to compare with: the true ones where known."""
        known = self.dataset.tau_noiseless
        return self.dataset.tau if known is None else known


def matched(dataset: Dataset, model: TorqueModel | Dataset) -> Dataset:
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


def run(model: TorqueModel, dataset: Dataset, progress: Progress = silent) -> Outcome:
    """
    Predict torques, energies and, where the model has it, the inertia matrix at every sample.

    Parameters
    ----------
    model : TorqueModel
    dataset : Dataset
        Of the model's joints, in its order.
    progress : Progress
        Called after every block of samples.

    """
    predictions, eigenvalues = [], []
    for q, dq, ddq in _state_blocks(dataset, BLOCK, 'predict', progress):
        predictions.append(model.predict(q, dq, ddq))
        if isinstance(model, DynamicsModel):
            eigenvalues.append(np.linalg.eigvalsh(model.inertia_matrix(q))[:, 0])
    smallest = np.concatenate(eigenvalues) if eigenvalues else None
    return Outcome(dataset, _joined(predictions), smallest)


def standard_deviation(
    model: DynamicsModel, dataset: Dataset, progress: Progress = silent
) -> StandardDeviation:
    """
    Compute the standard deviations of torques and energies at every sample.

    Parameters
    ----------
    model : DynamicsModel
    dataset : Dataset
        Of the model's joints, in its order.
    progress : Progress
        Called after every block of samples.

    """
    blocks = [
        model.predict(*states, return_std=True).std
        for states in _state_blocks(dataset, STD_BLOCK, 'standard deviation', progress)
    ]
    return _joined([block for block in blocks if block is not None])


def _state_blocks(
    dataset: Dataset, size: int, stage: str, progress: Progress
) -> Iterator[tuple[Array, Array, Array]]:
    """Yield joint states, `size` samples at a time, and report each block as done."""
    for begin in range(0, dataset.n_samples, size):
        rows = slice(begin, begin + size)
        yield dataset.q[rows], dataset.dq[rows], dataset.ddq[rows]
        progress(stage, min(begin + size, dataset.n_samples), dataset.n_samples)


def _joined(blocks: Sequence[Blocks]) -> Blocks:
    columns = {}
    for field in fields(blocks[0]):
        parts = [getattr(block, field.name) for block in blocks]
        columns[field.name] = None if parts[0] is None else np.concatenate(parts)
    joined: Blocks = type(blocks[0])(**columns)
    return joined
