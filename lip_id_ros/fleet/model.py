"""The model of a fleet from placements of the first pass and parameters of the second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import json
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.fleet.consistency import disagreement
from lip_id_ros.fleet.placements import chosen, PlacedArm
from lip_id_ros.fleet.results import Survey
from lip_id_ros.fleet.solution import Solution
from lip_id_ros.fleet.survey import merged
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, Described, MOST_SAMPLES
from lip_id_ros.identification.arm_prior import ArmPrior
from lip_id_ros.identification.arm_problem import ArmState
from lip_id_ros.identification.identify import prediction_noise
from lip_id_ros.identification.remainder_election import conditioned_remainder, elect_processes
from lip_id_ros.identification.sample_selection import evenly, plausible
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior, compacted
from lip_id_ros.model.effort_calibration import effort_calibrations
from lip_id_ros.model.fit_checks import with_checks
from lip_id_ros.model.remainder import Remainder
from lip_id_ros.rigid_body.pseudo_inertia import log_cholesky
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

EXISTS = 1e-12
"""Least scaled eigenvalue of links that exist already."""

SECTIONS = ('recording', 'preprocessing')
"""Settings in the provenance of a recording."""

RANK = 1e-9
"""Least singular value of a direction of placements that is known to less than all, as a share."""

STATES = 500
"""Samples at which links follow placements."""

SMALLEST = 1e-300
"""Least coefficient of friction that has a logarithm."""


def with_processes(
    placed: PlacedArm,
    solution: Solution,
    surveys: Sequence[Survey],
    described: Described | None = None,
) -> PlacedArm:
    """
    Elect the joints that have a Gaussian process beside links and friction, or instead of them.

    Parameters
    ----------
    placed : PlacedArm
    solution : Solution
        Of the reservoirs.
    surveys : sequence of Survey
    described : tuple of RobotDescription and DescriptionSettings, optional

    """
    excluded = dict(placed.excluded)
    fitter = _measured(placed, [each for each in surveys if each.key not in excluded], described)
    return placed.with_remainder(elect_processes(fitter, _fit(placed, solution, fitter.prior)))


def model_of(
    placed: PlacedArm,
    solution: Solution,
    surveys: Sequence[Survey],
    fitter: ArmFitter,
    described: Described | None = None,
) -> InverseDynamicsModel:
    """
    Return the model of a fleet.

    Parameters
    ----------
    placed : PlacedArm
    solution : Solution
    surveys : sequence of Survey
        Of the recordings in the fit.
    fitter : ArmFitter
        To the samples of the first pass.
    described : tuple of RobotDescription and DescriptionSettings, optional
        That the first pass had.

    """
    fit = _fit(placed, solution, fitter.prior)
    remainder = _remainder(placed, solution, surveys, described)
    noise = replace(fit.noise, std=solution.noise_std)
    arm = ArmPosterior(
        fit.chain,
        fit.links,
        fit.friction,
        prediction_noise(fitter.thinned(MOST_SAMPLES), fit, noise, remainder),
        _root(placed, solution),
    )
    arm = compacted(arm, _ranges(placed, surveys))
    report = _report(placed, solution, surveys) | {
        'unexplained_left_out': (solution.left_out / fitter.torque_std**2).tolist(),
        'remainder': remainder.joints.tolist() if remainder else [],
        'noise_std': arm.noise.std.tolist(),
    }
    model = _assembled(placed, surveys, arm, remainder, report)
    return with_checks(model, placed.dataset.q, placed.dataset.tau)


def _report(placed: PlacedArm, solution: Solution, surveys: Sequence[Survey]) -> dict[str, Any]:
    """Return what the first pass reports, with recordings that contradict each other."""
    report: dict[str, Any] = json.loads(placed.report)
    names = {each.key: each.name for each in surveys}
    report |= {
        'covariance_inflation': solution.inflation,
        'friction_between_recordings': solution.deviations.recordings.tolist(),
        'friction_between_groups': solution.deviations.groups.tolist(),
        'recordings': len(surveys),
        'disturbances': [
            {**each, 'name': names[each['key']]}
            for each in report['disturbances']
            if each['key'] in names
        ],
    }
    if len(surveys) > 1:  # halves of samples in the order of keys mean nothing
        groups = disagreement(chosen(surveys), placed.regression, solution.links)
        report |= {'halves_agree': True, 'contradicting_recordings': groups}
    return report


def _remainder(
    placed: PlacedArm,
    solution: Solution,
    surveys: Sequence[Survey],
    described: Described | None,
) -> Remainder | None:
    """Return the elected processes, conditioned on the residual of links and friction."""
    processes = placed.remainder
    if not any(processes):
        return None
    fitter = _measured(placed, surveys, described)
    return conditioned_remainder(fitter, _fit(placed, solution, fitter.prior), processes)


def _measured(
    placed: PlacedArm, surveys: Sequence[Survey], described: Described | None
) -> ArmFitter:
    """
    Return a fitter to reservoirs of some recordings with the torques as they were measured.

    Predictions are for a recording that is not known, whose friction deviates.

    """
    data = merged(chosen(surveys), placed.joint_names)
    return ArmFitter(data.select(np.flatnonzero(plausible(data))), described)


def _fit(placed: PlacedArm, solution: Solution, prior: ArmPrior) -> ArmFit:
    """Return the fit of the first pass with given parameters, in the scales of a prior."""
    regression = placed.regression
    basis = regression.friction.basis
    numbers = log_cholesky(solution.links, prior.scale, EXISTS)
    logs = np.log(np.maximum(solution.friction, SMALLEST))
    friction = np.where(basis.is_positive, logs, solution.friction)
    return ArmFit(
        ArmState(regression.chain, numbers, friction),
        solution.links,
        FrictionModel(basis, solution.friction),
        replace(regression.noise, std=solution.noise_std),
        placed.geometry,
    )


def _root(placed: PlacedArm, solution: Solution) -> Array:
    """
    Return a square root of the covariance of placements, links and friction.

    The placements have the covariance of the first pass, and links and friction follow them so
    that torques change as there; with the placements given, they have that of the second.

    """
    count = DIRECTIONS * len(solution.links)
    # widths of signs are taken as known
    first = placed.covariance_root[: count + len(solution.covariance_root)]
    moved = first @ _row_space(first[:count])
    moved[count:] = _following(placed, solution, moved)
    columns = [moved]
    for root in (solution.covariance_root, _deviations(solution)):
        column = np.zeros((len(first), root.shape[1]))
        column[len(first) - len(root) :] = root
        columns.append(column)
    return np.hstack(columns)


def _following(placed: PlacedArm, solution: Solution, moved: Array) -> Array:
    """
    Return how links and friction follow placements, shape (11 n + K, r).

    Links that differ by what changes no torque at these placements have other torques at others:
    what made up for a placement beside the links of the first pass does not beside these.

    """
    regression, data = placed.regression, placed.dataset
    some = data.select(evenly(data.n_samples, STATES))
    friction = FrictionModel(regression.friction.basis, solution.friction)
    before, after = (
        ArmPosterior(regression.chain, *each, regression.noise, moved).jacobian(
            some.q, some.dq, some.ddq
        )
        for each in ((regression.links, regression.friction), (solution.links, friction))
    )
    count = DIRECTIONS * len(solution.links)
    change = before @ moved - after[..., :count] @ moved[:count]
    rows = after[..., count:].reshape(-1, len(moved) - count)
    found, *_ = np.linalg.lstsq(rows, change.reshape(len(rows), -1), rcond=RANK)
    return np.asarray(found)


def _row_space(matrix: Array) -> Array:
    """Return an orthonormal basis of the rows of a matrix (m, r), shape (r, rank)."""
    _, values, rows = np.linalg.svd(matrix, full_matrices=False)
    rank = np.count_nonzero(values > RANK * values[0]) if values.size else 0
    return np.asarray(rows[:rank].T)


def _deviations(solution: Solution) -> Array:
    """Return the columns of friction that differs in a recording that is not known."""
    total = solution.deviations.total
    return np.diag(total)[:, total > 0.0]


def _ranges(placed: PlacedArm, surveys: Sequence[Survey]) -> tuple[Array, Array]:
    names = placed.joint_names
    low = np.array([_ordered(each, each.low, names) for each in surveys])
    high = np.array([_ordered(each, each.high, names) for each in surveys])
    return low.min(axis=0), high.max(axis=0)


def _assembled(
    placed: PlacedArm,
    surveys: Sequence[Survey],
    arm: ArmPosterior,
    remainder: Remainder | None,
    report: dict[str, Any],
) -> InverseDynamicsModel:
    names = placed.joint_names
    counts = np.array([each.n_samples for each in surveys])
    means = np.array([_ordered(each, each.mean_q, names) for each in surveys])
    largest = [_ordered(each, each.largest_torque, names) for each in surveys]
    sources, calibrated = _sources(surveys)
    return InverseDynamicsModel(
        joint_names=names,
        joint_types=placed.joint_types,
        potential_reference=counts @ means / counts.sum(),
        training_range=_ranges(placed, surveys),
        largest_torque=np.max(largest, axis=0),
        n_samples=int(counts.sum()),
        effort_calibrations=effort_calibrations({'sources': calibrated}, names),
        arm=arm,
        remainder=remainder,
        summary=report,
        provenance={'sources': sources, 'n_samples_available': int(counts.sum())},
    )


def _ordered(survey: Survey, values: Array, names: Sequence[str]) -> Array:
    """Return values of joints (..., n) in the order of the model."""
    return values[..., [survey.joint_names.index(name) for name in names]]


def _sources(surveys: Sequence[Survey]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Return an entry for each recording, and the full ones of those with other settings."""
    entries, full = [], dict[str, dict[str, Any]]()
    for survey in surveys:
        source = json.loads(survey.provenance)
        settings = json.dumps([source.get(name) for name in SECTIONS], sort_keys=True)
        short = {'source': survey.name, 'content': source.get('content', survey.key)}
        known = settings in full
        full.setdefault(settings, {**source, **short})
        entries.append(short if known else full[settings])
    return entries, list(full.values())
