"""The figures that judge a model on a data set."""

from __future__ import annotations

from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
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
        None where the true energies are unknown, or the model has none.
    inertia_not_pd_percent : float or None
        Share of samples at which the estimated inertia matrix is not positive definite; None
        where the model has none.
    inertia_min_eigenvalue : float or None
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
    inertia_not_pd_percent: float | None = None
    inertia_min_eigenvalue: float | None = None

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
    """Compute the errors of an outcome, those of its inertia matrices too."""
    estimate, smallest = outcome.prediction, outcome.smallest_eigenvalue
    errors = judged(outcome.dataset, estimate.tau, estimate.kinetic, estimate.potential)
    return replace(
        errors,
        inertia_not_pd_percent=metrics.not_positive_definite_percent(smallest),
        inertia_min_eigenvalue=float(smallest.min()),
    )


def judged(
    dataset: Dataset, tau: Array, kinetic: Array | None, potential: Array | None
) -> Evaluation:
    """
    Compute the errors of torques and energies.

    The torques are compared with `tau_noiseless` where the data set has it; the potential energy
    after removing the mean error, since it is known up to a constant only.

    Parameters
    ----------
    dataset : Dataset
        N samples of n joints.
    tau : ndarray, shape (N, n)
        Estimates [N m or N].
    kinetic, potential : ndarray, shape (N,), or None
        Estimates [J].

    """
    reference = dataset.tau if dataset.tau_noiseless is None else dataset.tau_noiseless
    kinetic_error = potential_error = None
    if dataset.kinetic is not None and kinetic is not None:
        kinetic_error = float(metrics.nmse_percent(kinetic, dataset.kinetic))
    if dataset.potential is not None and potential is not None:
        found = metrics.nmse_percent_without_offset(potential, dataset.potential)
        potential_error = float(found)
    return Evaluation(
        joint_names=dataset.joint_names,
        joint_types=dataset.joint_types,
        n_samples=dataset.n_samples,
        nmse_percent=tuple(metrics.nmse_percent(tau, reference).tolist()),
        rmse=tuple(metrics.rmse(tau, reference).tolist()),
        torque_std=tuple(np.std(reference, axis=0).tolist()),
        against_truth=dataset.tau_noiseless is not None,
        kinetic_nmse_percent=kinetic_error,
        potential_nmse_percent=potential_error,
    )


def _number(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value
