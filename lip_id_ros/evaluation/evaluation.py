"""The figures that judge a model on a data set."""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation import metrics
from lip_id_ros.evaluation.estimator import Estimator
from lip_id_ros.evaluation.outcome import Outcome, run
from lip_id_ros.progress import Progress, silent


@dataclass(frozen=True)
class Evaluation:
    """
    Errors of a model on a data set.

    Attributes
    ----------
    joint_names, joint_types : tuple of str
    n_samples : int
    nmse_percent : tuple of float
        Per joint; nan where the torque does not vary.
    rmse : tuple of float
        Per joint [N m or N].
    torque_std : tuple of float
        Standard deviation of the torques compared with [N m or N].
    against_truth : bool
        Whether those are the true torques, known in simulation, or the measured ones.
    kinetic_nmse_percent, potential_nmse_percent : float or None
        None where the true energies are unknown, or the model has no potential energy.
    inertia_not_pd_percent : float
        Share of samples at which the estimated inertia matrix is not positive definite.
    inertia_min_eigenvalue : float
        Smallest eigenvalue of that matrix over all samples [kg m^2 or kg].

    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    n_samples: int
    nmse_percent: tuple[float, ...]
    rmse: tuple[float, ...]
    torque_std: tuple[float, ...]
    against_truth: bool
    kinetic_nmse_percent: float | None
    potential_nmse_percent: float | None
    inertia_not_pd_percent: float
    inertia_min_eigenvalue: float

    @property
    def nmse_percent_mean(self) -> float:
        """Mean over the joints whose torque varies; nan where there is none."""
        known = [value for value in self.nmse_percent if not math.isnan(value)]
        return sum(known) / len(known) if known else math.nan

    def to_json(self) -> dict[str, Any]:
        """Return the keys of docs/interfaces.md; what is not a number becomes None."""
        return {
            'joint_names': list(self.joint_names),
            'n_samples': self.n_samples,
            'nmse_percent': [_number(value) for value in self.nmse_percent],
            'nmse_percent_mean': _number(self.nmse_percent_mean),
            'rmse': list(self.rmse),
            'kinetic_nmse_percent': _number(self.kinetic_nmse_percent),
            'potential_nmse_percent': _number(self.potential_nmse_percent),
            'inertia_not_pd_percent': self.inertia_not_pd_percent,
            'inertia_min_eigenvalue': self.inertia_min_eigenvalue,
        }


def evaluate(estimator: Estimator, dataset: Dataset, progress: Progress = silent) -> Evaluation:
    """
    Compare a model's torques and energies with a data set.

    Parameters
    ----------
    estimator : Estimator
        Such as a `Predictor`.
    dataset : Dataset
        Of the estimator's joints, in its order (`matched`).
    progress : Progress

    Returns
    -------
    Evaluation

    """
    return score(run(estimator, dataset, progress))


def score(outcome: Outcome) -> Evaluation:
    """
    Compute the errors of an outcome.

    The torques are compared with `tau_noiseless` where the data set has it; the potential energy
    after removing the mean error, since it is known up to a constant only.

    """
    data, estimate, reference = outcome.dataset, outcome.prediction, outcome.reference
    potential = None
    if data.potential is not None and estimate.potential is not None:
        potential = metrics.nmse_percent_without_offset(estimate.potential, data.potential)
    kinetic = None
    if data.kinetic is not None:
        kinetic = metrics.nmse_percent(estimate.kinetic, data.kinetic)
    return Evaluation(
        joint_names=data.joint_names,
        joint_types=data.joint_types,
        n_samples=data.n_samples,
        nmse_percent=tuple(metrics.nmse_percent(estimate.tau, reference).tolist()),
        rmse=tuple(metrics.rmse(estimate.tau, reference).tolist()),
        torque_std=tuple(np.std(reference, axis=0).tolist()),
        against_truth=data.tau_noiseless is not None,
        kinetic_nmse_percent=None if kinetic is None else float(kinetic),
        potential_nmse_percent=None if potential is None else float(potential),
        inertia_not_pd_percent=metrics.not_positive_definite_percent(outcome.smallest_eigenvalue),
        inertia_min_eigenvalue=float(outcome.smallest_eigenvalue.min()),
    )


def _number(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value
