"""Errors of predictions: of all samples, in motion and near rest, and of several data sets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation.prediction import matched, Outcome, run
from lip_id_ros.model import TorqueModel
from lip_id_ros.model.proof import not_positive_definite_percent
from lip_id_ros.progress import Progress, silent

ROUNDING = 1e-12  # a smaller deviation of a torque, in its largest value, is none

NEAR_REST = 0.05
"""A joint is near rest below this share of the root mean square of its velocity."""


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
class RestErrors:
    """
    Root mean square errors of joints in motion and near rest [N m or N], per joint.

    Not a number where there are no such samples; `near_rest_percent` is the share of those near
    rest.
    """

    near_rest_percent: tuple[float, ...]
    in_motion: tuple[float, ...]
    near_rest: tuple[float, ...]

    @classmethod
    def of(cls, error: Array, dq: Array) -> RestErrors:
        """Return the errors of torques (N, n) at velocities (N, n) of one data set."""
        rests, squares = near_rest(dq).astype(np.float64), np.square(error)
        motion, rest = (
            _root(np.sum(some * squares, axis=0), some.sum(axis=0))
            for some in (1.0 - rests, rests)
        )
        return cls(tuple((100.0 * rests.mean(axis=0)).tolist()), motion, rest)

    @classmethod
    def merged(cls, parts: Sequence[RestErrors], counts: Array) -> RestErrors:
        """Return the errors of several data sets together, of so many samples each."""
        rests = counts[:, None] * np.array([each.near_rest_percent for each in parts]) / 100.0
        moves = counts[:, None] - rests
        motion, rest = (
            _root(np.sum(_squares(weight, values), axis=0), weight.sum(axis=0))
            for weight, values in (
                (moves, [each.in_motion for each in parts]),
                (rests, [each.near_rest for each in parts]),
            )
        )
        percent = 100.0 * rests.sum(axis=0) / counts.sum()
        return cls(tuple(percent.tolist()), motion, rest)


def near_rest(dq: Array) -> BoolArray:
    """Mark the samples at which joints are near rest, shape (N, n)."""
    usual = np.sqrt(np.mean(np.square(dq), axis=0))
    return np.asarray((np.abs(dq) < NEAR_REST * usual) | (usual == 0.0))


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


def merged(evaluations: Sequence[Evaluation]) -> Evaluation:
    """
    Return the errors of a model on one or several data sets together.

    They are what an evaluation of the joined samples has, the coverage is the mean weighted by
    samples; errors of energies, whose means are not known, are left out.
    """
    first, *others = evaluations
    if not others:
        return first
    counts = np.array([each.n_samples for each in evaluations])
    weights = counts / counts.sum()
    squares = weights @ np.square(_all(evaluations, 'rmse'))
    means = _all(evaluations, 'torque_mean')
    mean = weights @ means
    variances = np.square(_all(evaluations, 'torque_std')) + np.square(means - mean)
    variance = weights @ variances
    varies = np.sqrt(variance) > ROUNDING * np.abs(mean)
    nmse = np.where(varies, 100.0 * squares / np.where(varies, variance, 1.0), np.nan)
    known: dict[str, Any] = {}
    if all(each.within_two_std_percent is not None for each in evaluations):
        known['within_two_std_percent'] = _floats(
            weights @ _all(evaluations, 'within_two_std_percent')
        )
    rests = [each.rest for each in evaluations if each.rest is not None]
    if len(rests) == len(evaluations):
        known['rest'] = RestErrors.merged(rests, counts)
    if all(each.inertia_not_pd_percent is not None for each in evaluations):
        shares = _all(evaluations, 'inertia_not_pd_percent')
        smallest = _all(evaluations, 'inertia_min_eigenvalue')
        known['inertia_not_pd_percent'] = float(weights @ shares)
        known['inertia_min_eigenvalue'] = float(smallest.min())
    return Evaluation(
        joint_names=first.joint_names,
        joint_types=first.joint_types,
        n_samples=int(counts.sum()),
        nmse_percent=_floats(nmse),
        rmse=_floats(np.sqrt(squares)),
        torque_mean=_floats(mean),
        torque_std=_floats(np.sqrt(variance)),
        against_truth=all(each.against_truth for each in evaluations),
        kinetic_nmse_percent=None,
        potential_nmse_percent=None,
        cautions=tuple(dict.fromkeys(text for each in evaluations for text in each.cautions)),
        **known,
    )


def _number(value: float | None) -> float | None:
    return None if value is None or math.isnan(value) else value


def _relative(squared_error: Array, truth: Array) -> Array:
    variance = np.var(truth, axis=0)
    varies = np.sqrt(variance) > ROUNDING * np.abs(truth).max(axis=0)
    return np.where(varies, 100.0 * squared_error / np.where(varies, variance, 1.0), np.nan)


def _root(sums: Array, counts: Array) -> tuple[float, ...]:
    known = counts > 0.0
    means = np.where(known, sums / np.where(known, counts, 1.0), np.nan)
    return tuple(np.sqrt(means).tolist())


def _squares(weight: Array, values: Sequence[tuple[float, ...]]) -> Array:
    """Return sums of squares of parts from their roots, none where a part has no samples."""
    return np.where(weight > 0.0, weight * np.square(values), 0.0)


def _all(evaluations: Sequence[Evaluation], name: str) -> Array:
    return np.array([getattr(each, name) for each in evaluations])


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(values.tolist())
