"""The model of a fleet from placements of the first pass and parameters of the second."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
import json
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset.formats import FINDINGS, N_NOTES
from lip_id_ros.fleet.consistency import disagreement
from lip_id_ros.fleet.placements import chosen, PlacedArm
from lip_id_ros.fleet.results import Survey
from lip_id_ros.fleet.survey import merged
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, Described, MOST_SAMPLES
from lip_id_ros.identification.folds import motion_of_samples_s
from lip_id_ros.identification.identify import prediction_noise, squares_of_signs
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.novelty import known_states, motion_entries
from lip_id_ros.identification.posterior import fit_of, posterior_of, SAMPLES
from lip_id_ros.identification.residual_gp_selection import (
    conditioned_residual_gp,
    select_processes,
)
from lip_id_ros.identification.sample_selection import plausible
from lip_id_ros.identification.solution import Solution
from lip_id_ros.loading.data_settings import SECTIONS
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.arm_posterior import ArmPosterior, compacted
from lip_id_ros.model.effort_calibration import effort_calibrations
from lip_id_ros.model.proof import with_checks
from lip_id_ros.model.residual_gp import ResidualGP

OF_HEALTH = (FINDINGS, N_NOTES, 'samples', 'rate_hz')
"""Entries of it that the cautions of a fit are about."""


def with_processes(
    placed: PlacedArm,
    solution: Solution,
    surveys: Sequence[Survey],
    described: Described | None = None,
) -> PlacedArm:
    """
    Select the joints that have a Gaussian process beside links and friction, or instead of them.

    `solution`: of the reservoirs.
    """
    excluded = dict(placed.excluded)
    some = [each for each in chosen(surveys) if each.key not in excluded]
    fitter = _measured(placed, some, described)
    _, new_s = _motion_s(placed, some)
    return placed.with_residual_gp(select_processes(fitter, _fit(placed, solution), new_s))


def model_of(
    placed: PlacedArm,
    solution: Solution,
    around: Linearisation,
    surveys: Sequence[Survey],
    fitter: ArmFitter,
    described: Described | None = None,
) -> InverseDynamicsModel:
    """Return the model of a fleet, whose torques were linear in `around`."""
    fit = _fit(placed, solution)
    residual_gp = _residual_gp(placed, solution, surveys, described)
    arm = posterior_of(around, solution, fitter.some(SAMPLES))
    noise = prediction_noise(fitter.thinned(MOST_SAMPLES), fit, arm.noise, residual_gp)
    arm = compacted(replace(arm, noise=noise), _ranges(placed, surveys))
    unexplained = solution.left_out.mean_squares
    unpredicted = unexplained + squares_of_signs(fitter.dataset, fit)
    report = _report(placed, solution, surveys) | {
        'unexplained_left_out': (unexplained / fitter.torque_std**2).tolist(),
        'unpredicted_left_out': (unpredicted / fitter.torque_std**2).tolist(),
        'remainder': residual_gp.joints.tolist() if residual_gp else [],
        'noise_std': arm.noise.std.tolist(),
        **motion_entries(*_motion_s(placed, surveys)),
    }
    model = _assembled(placed, surveys, arm, residual_gp, report)
    return with_checks(model, placed.dataset.q, placed.dataset.tau)


def with_entries(model: InverseDynamicsModel, entries: Mapping[str, Any]) -> InverseDynamicsModel:
    """Add entries to the provenance of the first recording, whose settings those of all are."""
    first, *others = model.provenance['sources']
    sources = [{**first, **entries}, *others]
    return replace(model, provenance={**model.provenance, 'sources': sources})


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
        present = replace(placed.around, chain=solution.chain, links=solution.links)
        groups = disagreement(chosen(surveys), present)
        report |= {'halves_agree': True, 'contradicting_recordings': groups}
    return report


def _residual_gp(
    placed: PlacedArm,
    solution: Solution,
    surveys: Sequence[Survey],
    described: Described | None,
) -> ResidualGP | None:
    """Return the selected processes, conditioned on the residual of links and friction."""
    processes = placed.residual_gp
    if not any(processes):
        return None
    fitter = _measured(placed, surveys, described)
    return conditioned_residual_gp(fitter, _fit(placed, solution), processes)


def _motion_s(placed: PlacedArm, surveys: Sequence[Survey]) -> Array:
    """Return for how long recordings move, and how long of that is no repetition, (2,) [s]."""
    some = chosen(surveys)
    return motion_of_samples_s(merged(some, placed.joint_names), [each.motion_s for each in some])


def _measured(
    placed: PlacedArm, surveys: Sequence[Survey], described: Described | None
) -> ArmFitter:
    """
    Return a fitter to reservoirs of some recordings with the torques as they were measured.

    Predictions are for a recording that is not known, whose friction deviates.
    """
    data = merged(chosen(surveys), placed.joint_names)
    data = data.select(np.flatnonzero(plausible(data)))
    return ArmFitter(data, described, couplings=placed.couplings)


def _fit(placed: PlacedArm, solution: Solution) -> ArmFit:
    """Return the fit with the parameters of a solution."""
    return fit_of(solution, placed.around.noise, placed.geometry)


def _ranges(placed: PlacedArm, surveys: Sequence[Survey]) -> tuple[Array, Array]:
    names = placed.joint_names
    low = np.array([_ordered(each, each.low, names) for each in surveys])
    high = np.array([_ordered(each, each.high, names) for each in surveys])
    return low.min(axis=0), high.max(axis=0)


def _assembled(
    placed: PlacedArm,
    surveys: Sequence[Survey],
    arm: ArmPosterior,
    residual_gp: ResidualGP | None,
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
        residual_gp=residual_gp,
        known_states=known_states(placed.dataset),
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
        short |= {name: source[name] for name in OF_HEALTH if name in source}
        known = settings in full
        full.setdefault(settings, {**source, **short})
        entries.append(short if known else full[settings])
    return entries, list(full.values())
