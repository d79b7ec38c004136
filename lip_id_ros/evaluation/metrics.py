"""Predictions along a data set, and their errors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
import math
from typing import Any, TypeVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import cutoffs_hz, Dataset
from lip_id_ros.errors import DataError, ModelError
from lip_id_ros.evaluation.near_rest import RestErrors
from lip_id_ros.evaluation.training_data import training_data_warnings
from lip_id_ros.identification.folds import at_rest
from lip_id_ros.model import (
    DynamicsModel,
    InverseDynamicsModel,
    StandardDeviation,
    TorqueModel,
    TorquePrediction,
)
from lip_id_ros.model.proof import not_positive_definite_percent
from lip_id_ros.progress import Progress, silent

BLOCK = 500
STD_BLOCK = 50  # standard deviations need far more memory per sample
MOST_COVERED = 500  # samples of which a coverage is the share
ROUNDING = 1e-12  # a smaller deviation of a torque, in its largest value, is none

Blocks = TypeVar('Blocks', bound=Any)


def nmse_percent(estimate: Array, truth: Array) -> Array:
    """Compute 100 mean((estimate - truth)^2) / var(truth); nan where the truth is constant."""
    return _relative(np.mean(np.square(estimate - truth), axis=0), truth)


def nmse_percent_without_offset(estimate: Array, truth: Array) -> Array:
    """Compute `nmse_percent` after removing the mean error, where a constant is free."""
    return _relative(np.var(estimate - truth, axis=0), truth)


def rmse(estimate: Array, truth: Array) -> Array:
    """Root mean squared error in the unit of the arguments, shape () or (n,)."""
    error: Array = np.sqrt(np.mean(np.square(estimate - truth), axis=0))
    return error


def mean_of_known(values: tuple[float, ...]) -> float:
    """Mean over the joints whose torque varies; nan where there is none."""
    known = [value for value in values if not math.isnan(value)]
    return sum(known) / len(known) if known else math.nan


@dataclass(frozen=True)
class Outcome:
    """
    Predictions beside the N samples that they are for.

    `smallest_eigenvalue`, shape (N,): of the predicted inertia matrix [kg m^2 or kg]; None where
    the model has none. `within_two_std_percent`, shape (n,): share of measured torques within two
    standard deviations of a measurement; None where the model is no arm, or efforts were
    low-passed otherwise than those of its fit. `novelty`: median distance of the samples in motion
    to the training data, in that of left-out ones; None where the model does not know. `cautions`:
    sentences where the data are, or may be, training data.
    """

    dataset: Dataset
    prediction: TorquePrediction
    smallest_eigenvalue: Array | None = None
    within_two_std_percent: Array | None = None
    novelty: float | None = None
    cautions: tuple[str, ...] = ()

    @property
    def reference(self) -> Array:
        """Torques [N m or N], shape (N, n), to compare with: the true ones where known."""
        known = self.dataset.tau_noiseless
        return self.dataset.tau if known is None else known


def matched(dataset: Dataset, model: TorqueModel | Dataset) -> Dataset:
    """
    Return a data set with the joints of a model, in its order.

    DataError if a joint is missing. ModelError if a joint has another type than the model's, or
    only one of both leaves gravity out.
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
    without = _without_gravity(model)
    if without is not None and without != dataset.gravity_compensated:
        has = ('leave gravity out', 'contain gravity')
        raise ModelError(
            f'the torques of the data {has[without]}, but those that the model learned '
            f'{has[not without]}; correct recording.gravity_compensated, or fit a new model.'
        )
    return ordered


def _without_gravity(model: TorqueModel | Dataset) -> bool | None:
    """Return whether torques leave gravity out; None where the model does not tell."""
    if isinstance(model, Dataset):
        return model.gravity_compensated
    return not model.has_potential if isinstance(model, InverseDynamicsModel) else None


def run(model: TorqueModel, dataset: Dataset, progress: Progress = silent) -> Outcome:
    """Predict torques, energies and, where the model has them, inertia matrix and coverage."""
    predictions: list[TorquePrediction] = []
    eigenvalues = []
    arm = model if isinstance(model, InverseDynamicsModel) and model.arm is not None else None
    for q, dq, ddq in _state_blocks(dataset, BLOCK, 'predict', progress):
        if arm is None:
            predictions.append(model.predict(q, dq, ddq))
        if isinstance(model, DynamicsModel):
            eigenvalues.append(np.linalg.eigvalsh(model.inertia_matrix(q))[:, 0])
    smallest = np.concatenate(eigenvalues) if eigenvalues else None
    if arm is not None:  # whole: friction may remember
        predictions = [arm.predict(dataset.q, dataset.dq, dataset.ddq, dataset.t)]
    joined = _joined(predictions)
    covered = _within_two_std(model, dataset, joined.tau)
    cautions = tuple(training_data_warnings(model, dataset))
    return Outcome(dataset, joined, smallest, covered, novelty_of(model, dataset), cautions)


def novelty_of(model: TorqueModel, dataset: Dataset) -> float | None:
    """Return the median novelty of samples in motion; None where the model knows no states."""
    if not isinstance(model, InverseDynamicsModel) or model.known_states is None:
        return None
    moving = ~at_rest(dataset)
    some = dataset.select(np.flatnonzero(moving)) if moving.any() else dataset
    return float(np.median(model.novelty(some.q, some.dq, some.ddq)))


def _within_two_std(model: TorqueModel, dataset: Dataset, tau: Array) -> Array | None:
    """Return the share [percent] of measurements that two standard deviations cover, (n,)."""
    if not isinstance(model, InverseDynamicsModel) or model.arm is None:
        return None  # deviations of a Gaussian process on energies take seconds
    if not cutoffs_hz(dataset.provenance) <= (cutoffs_hz(model.provenance) - {None} or {None}):
        return None  # the noise of the model is that of efforts with another bandwidth
    count = min(MOST_COVERED, dataset.n_samples)
    rows = np.linspace(0, dataset.n_samples - 1, count).astype(np.intp)
    some = dataset.select(rows)
    std = model.standard_deviation(some.q, some.dq, some.ddq).measurement
    return np.asarray(100.0 * np.mean(np.abs(some.tau - tau[rows]) <= 2.0 * std, axis=0))


def standard_deviation(
    model: DynamicsModel, dataset: Dataset, progress: Progress = silent
) -> StandardDeviation:
    """Compute the standard deviations of torques and energies at every sample."""
    blocks = [
        model.predict(*states, return_std=True).std
        for states in _state_blocks(dataset, STD_BLOCK, 'standard deviation', progress)
    ]
    return _joined([block for block in blocks if block is not None])


def _state_blocks(
    dataset: Dataset, size: int, stage: str, progress: Progress
) -> Iterator[tuple[Array, Array, Array]]:
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


@dataclass(frozen=True)
class Evaluation:
    """
    Errors of a model on a data set.

    Attributes
    ----------
    joint_names, joint_types : tuple of str
    n_samples : int
    nmse_percent : tuple of float
        Per joint; nan where the torque is constant.
    rmse : tuple of float
        Per joint [N m or N].
    torque_mean, torque_std : tuple of float
        Mean and standard deviation of the reference torques [N m or N].
    against_truth : bool
        Whether the reference is the true torques of a simulation, or the measured ones.
    kinetic_nmse_percent, potential_nmse_percent : float or None
        None where the true energies are unknown, or the model has none.
    inertia_not_pd_percent : float or None
        Share of samples at which the estimated inertia matrix is not positive definite; None
        where the model has none.
    inertia_min_eigenvalue : float or None
        Smallest eigenvalue of that matrix over all samples [kg m^2 or kg].
    rest : RestErrors or None
        Errors in motion and near rest.
    within_two_std_percent : tuple of float or None
    novelty : float or None
    cautions : tuple of str
        As in `Outcome`.

    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    n_samples: int
    nmse_percent: tuple[float, ...]
    rmse: tuple[float, ...]
    torque_mean: tuple[float, ...]
    torque_std: tuple[float, ...]
    against_truth: bool
    kinetic_nmse_percent: float | None
    potential_nmse_percent: float | None
    inertia_not_pd_percent: float | None = None
    inertia_min_eigenvalue: float | None = None
    rest: RestErrors | None = None
    within_two_std_percent: tuple[float, ...] | None = None
    novelty: float | None = None
    cautions: tuple[str, ...] = ()

    @property
    def nmse_percent_mean(self) -> float:
        """Mean over the joints whose torque varies; nan where there is none."""
        return mean_of_known(self.nmse_percent)

    def to_json(self) -> dict[str, Any]:
        """Return the keys of interfaces.md; nan becomes None."""
        covered = self.within_two_std_percent
        return {
            'joint_names': list(self.joint_names),
            'n_samples': self.n_samples,
            'nmse_percent': [_number(value) for value in self.nmse_percent],
            'nmse_percent_mean': _number(self.nmse_percent_mean),
            'rmse': list(self.rmse),
            'rmse_in_motion': self.rest and [_number(each) for each in self.rest.in_motion],
            'rmse_near_rest': self.rest and [_number(each) for each in self.rest.near_rest],
            'near_rest_percent': self.rest and list(self.rest.near_rest_percent),
            'kinetic_nmse_percent': _number(self.kinetic_nmse_percent),
            'potential_nmse_percent': _number(self.potential_nmse_percent),
            'inertia_not_pd_percent': self.inertia_not_pd_percent,
            'inertia_min_eigenvalue': self.inertia_min_eigenvalue,
            'within_two_std_percent': covered and list(covered),
            'novelty': self.novelty,
        }


def evaluate(model: TorqueModel, dataset: Dataset, progress: Progress = silent) -> Evaluation:
    """
    Compare a model's torques and energies with a data set.

    Parameters
    ----------
    model : TorqueModel
    dataset : Dataset
        Of the model's joints, in any order.
    progress : Progress

    Returns
    -------
    Evaluation

    Raises
    ------
    DataError
        If a joint of the model is missing.
    ModelError
        If a joint has another type than the model's.

    """
    if not hasattr(model, 'predict') or not isinstance(dataset, Dataset):
        given = f'{type(model).__name__} and {type(dataset).__name__}'
        raise DataError(f'evaluate needs a model and a Dataset, not {given}; use load_dataset.')
    return score(run(model, matched(dataset, model), progress))


def score(outcome: Outcome) -> Evaluation:
    """
    Compute the errors of an outcome.

    Torques are compared with `tau_noiseless` where the data set has it; potential energies without
    the mean error, since their constant is free.
    """
    dataset, estimate, reference = outcome.dataset, outcome.prediction, outcome.reference
    covered = outcome.within_two_std_percent
    kinetic = potential = not_pd = smallest = None
    if dataset.kinetic is not None and estimate.kinetic is not None:
        kinetic = float(nmse_percent(estimate.kinetic, dataset.kinetic))
    if dataset.potential is not None and estimate.potential is not None:
        potential = float(nmse_percent_without_offset(estimate.potential, dataset.potential))
    if outcome.smallest_eigenvalue is not None:
        not_pd = not_positive_definite_percent(outcome.smallest_eigenvalue)
        smallest = float(outcome.smallest_eigenvalue.min())
    return Evaluation(
        joint_names=dataset.joint_names,
        joint_types=dataset.joint_types,
        n_samples=dataset.n_samples,
        nmse_percent=tuple(nmse_percent(estimate.tau, reference).tolist()),
        rmse=tuple(rmse(estimate.tau, reference).tolist()),
        torque_mean=tuple(np.mean(reference, axis=0).tolist()),
        torque_std=tuple(np.std(reference, axis=0).tolist()),
        against_truth=dataset.tau_noiseless is not None,
        kinetic_nmse_percent=kinetic,
        potential_nmse_percent=potential,
        inertia_not_pd_percent=not_pd,
        inertia_min_eigenvalue=smallest,
        rest=RestErrors.of(estimate.tau - reference, dataset.dq),
        within_two_std_percent=None if covered is None else tuple(covered.tolist()),
        novelty=outcome.novelty,
        cautions=outcome.cautions,
    )


def _number(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value


def _relative(squared_error: Array, truth: Array) -> Array:
    variance = np.var(truth, axis=0)
    varies = np.sqrt(variance) > ROUNDING * np.abs(truth).max(axis=0)
    return np.where(varies, 100.0 * squared_error / np.where(varies, variance, 1.0), np.nan)
