"""What a model says of a data set, computed once for figures, tables and plots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ModelError
from lip_id_ros.progress import Progress, silent
from lip_id_ros.serving import Prediction

Floats = NDArray[np.float64]

BLOCK = 500


class Estimator(Protocol):
    """The part of a predictor that an evaluation needs."""

    def predict(self, q: Floats, dq: Floats, ddq: Floats) -> Prediction:
        """Torques with their parts, and energies, of N samples."""

    def inertia_matrix(self, q: Floats) -> Floats:
        """Inertia matrices, shape (N, n, n)."""


class Described(Protocol):
    """The part of a model that says which arm it is for."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints from base to tip."""

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Revolute or prismatic, per joint."""


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
    smallest_eigenvalue: Floats

    @property
    def reference(self) -> Floats:
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


def _joined(blocks: list[Prediction]) -> Prediction:
    names = ('tau', 'inertial', 'coriolis', 'gravity', 'friction', 'kinetic', 'potential')
    columns = {name: [getattr(block, name) for block in blocks] for name in names}
    return Prediction(
        **{
            name: None if parts[0] is None else np.concatenate(parts)
            for name, parts in columns.items()
        }
    )
