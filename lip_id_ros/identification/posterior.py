"""
The posterior of an arm's parameters, from all samples in memory (maths.md, section 13).

Deviations of the parameters of Denavit and Hartenberg are by the jackknife over left-out parts
too, which is true whatever the residuals are (Efron and Tibshirani 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtr, stdtrit

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.identification.arm_coordinates import friction_numbers
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, MOST_AT_ONCE
from lip_id_ros.identification.arm_prior import links_torque
from lip_id_ros.identification.arm_problem import ArmState
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import (
    coordinates_of,
    Known,
    left_out_at_present,
    parts_about,
    Solution,
    solve,
    system_of,
)
from lip_id_ros.identification.statistics import LeftOut, solved, TorqueStatistics
from lip_id_ros.identification.total import FOLDS, gather, has_most, Total
from lip_id_ros.model.arm_posterior import ArmPosterior, compacted
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.rigid_body.denavit_hartenberg import DenavitHartenberg, table_std
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

LINEAR = 0.05
"""Largest error of the linearisation at a solution, in standard deviations of the noise."""

RANK = 1e-9
"""Least singular value of a direction of links that changes torques, as a share."""

SAMPLES = 500
"""At which these are measured."""

SMALLEST = 1e-300
"""Least coefficient of friction that has a logarithm."""


def posterior(fitter: ArmFitter, fit: ArmFit) -> tuple[ArmFit, ArmPosterior, Solution, Total]:
    """Return the fit to all samples, its posterior, and the solution and statistics of both."""
    fit, known = fitter.to_all_samples(fit), known_of(fitter, fit)
    some, total = fitter.some(SAMPLES), total_of(fitter, fit)
    fixed = replace(fit.geometry, rigid=True)
    for moves in (fixed,) if _is_fitted(fitter.dataset) else (fit.geometry, fixed):
        solution = solve(total, known, moves)
        if is_linear(total.around, solution, some):
            break
    else:
        fit = fit_of(solution, fit.noise, fit.geometry)
        total = total_of(fitter, fit)
        solution = solve(total, known, fixed)
    arm = compacted(posterior_of(total.around, solution, some), ranges_of(fitter.dataset))
    return fit_of(solution, fit.noise, fit.geometry), arm, solution, total


def _is_fitted(dataset: Dataset) -> bool:
    """Return whether placements are fitted already: to all samples, and with their friction."""
    return dataset.n_samples <= MOST_AT_ONCE and bool(
        np.all(dataset.recording == dataset.recording[0])
    )


def ranges_of(dataset: Dataset) -> tuple[Array, Array]:
    """Return the lowest and highest q, dq, ddq, shapes (3, n)."""
    states = np.stack([dataset.q, dataset.dq, dataset.ddq])
    return states.min(axis=1), states.max(axis=1)


def known_of(fitter: ArmFitter, fit: ArmFit) -> Known:
    """Return what is known of an arm before its statistics are."""
    return Known(fitter.torque_std, fitter.prior, fit.geometry)


def left_out_of(fitter: ArmFitter, fit: ArmFit) -> LeftOut:
    """Return what left-out parts show of a fit to all samples."""
    return left_out_at_present(total_of(fitter, fit), known_of(fitter, fit))


def total_of(fitter: ArmFitter, fit: ArmFit) -> Total:
    """Gather the statistics of all samples, by recordings; of a single one in parts."""
    dataset, robots = fitter.dataset, fitter.robots
    around = around_fit(dataset, fit)
    numbers, counts = np.unique(dataset.recording, return_counts=True)
    blocks = FOLDS if has_most(counts) else 1
    parts = (dataset.select(dataset.recording == number) for number in numbers)
    groups = [robots[number] for number in numbers] if robots else None
    return Total(around, [gather(part, around, blocks) for part in parts], groups)


def around_fit(dataset: Dataset, fit: ArmFit) -> Linearisation:
    """Return what torques are regressed on around a fit."""
    return Linearisation(dataset.joint_names, fit.chain, fit.links, fit.friction, fit.noise)


def fit_of(solution: Solution, noise: TorqueNoise, geometry: Geometry) -> ArmFit:
    """Return the fit that has the parameters of a solution, and noise of a shape."""
    coefficients = solution.friction.coefficients
    positive = solution.friction.basis.is_positive
    friction = friction_numbers(coefficients, positive, SMALLEST)
    return ArmFit(
        ArmState(solution.chain, solution.numbers, friction),
        solution.links,
        solution.friction,
        replace(noise, std=solution.left_out.unbiased_std),
        geometry,
    )


def is_linear(around: Linearisation, solution: Solution, some: Dataset) -> bool:
    """Return whether the torques of samples at a solution are those of a linearisation."""
    state = some.q, some.dq, some.ddq
    load = links_torque(solution.chain, solution.links, some)
    residual = some.tau - load
    residual -= solution.friction.torque(*state, load, some.history)
    features, target = around.rows(some)
    for joint, (rows, own) in enumerate(zip(features, around.columns, strict=True)):
        residual[:, joint] -= target[:, joint] - rows @ solution.parameters[np.concatenate(own)]
    errors = np.sqrt(np.mean(residual**2, axis=0))
    return bool(np.all(errors <= LINEAR * solution.left_out.unbiased_std))


def posterior_of(around: Linearisation, solution: Solution, some: Dataset) -> ArmPosterior:
    """
    Return the posterior of an arm in a recording that is not known.

    Friction differs between recordings, by deviations that few recordings do not show exactly:
    Student's t.
    """
    deviations, count = solution.deviations, len(solution.recordings.residual_rms)
    within = deviations.recordings * widening(count)
    total = np.hypot(within, deviations.groups * widening(solution.n_robots))
    varying = np.flatnonzero(total)
    first = (DIRECTIONS + LINK_PARAMETERS) * len(solution.links)
    columns = np.zeros((len(solution.covariance_root), varying.size))
    columns[first + varying, np.arange(varying.size)] = total[varying]
    noise = replace(around.noise, std=solution.noise_std)
    root = np.hstack([_following(around, solution, some), columns])
    return ArmPosterior(solution.chain, solution.links, solution.friction, noise, root)


def _following(around: Linearisation, solution: Solution, some: Dataset) -> Array:
    """
    Return the covariance root of a solution, whose links and friction follow its placements.

    Links that differ by what changes no torque at these placements have other torques at others:
    what made up for a placement beside the present links does not beside those of the solution. So
    coordinates that others can stand for are left out first.
    """
    parts = around.chain, around.links, around.friction, around.noise
    present = ArmPosterior(*parts, solution.covariance_root)
    root, first = compacted(present, ranges_of(some)).covariance_root, around.n_placements
    last = first + around.links.size + around.n_friction
    before, after = (
        ArmPosterior(each.chain, each.links, each.friction, around.noise, root).jacobian(
            some.q, some.dq, some.ddq
        )
        for each in (around, solution)
    )
    change = (before - after) @ root[:last]
    rows = after[..., first:].reshape(-1, last - first)
    found, *_ = np.linalg.lstsq(rows, change.reshape(len(rows), -1), rcond=RANK)
    return np.concatenate([root[:first], root[first:last] + found, root[last:]])


def widening(count: int) -> float:
    """Return the factor of a deviation between so many recordings or parts, so that two cover."""
    return float(0.5 * stdtrit(count - 1, ndtr(2.0))) if count > 1 else 1.0


def table_deviations(total: Total, solution: Solution, known: Known) -> DenavitHartenberg:
    """
    Return deviations by the posterior and by the jackknife together, without selections.

    A length that was set to zero because no torque speaks against it is not known to be zero. Few
    parts do not show the jackknife's deviations exactly: Student's t.
    """
    if not known.geometry.rigid:
        known = replace(known, geometry=Geometry.free(total.around.n_joints))
    noise, deviations = solution.left_out.unbiased_std, solution.deviations
    problem = system_of(total, known, noise, deviations, solution.inflation)
    state = replace(
        problem.start(), friction=solution.friction.coefficients, numbers=solution.numbers
    )
    parts = parts_about(total, problem, state, noise, deviations)
    prior = coordinates_of(total, known).prior_rows(state)
    shown = jackknife_root(parts, prior, noise)
    first, size = total.around.basis.size, total.around.n_placements
    steps = problem.slopes(state)[first : first + size] @ shown
    root = np.hstack([problem.covariance_root(state)[:size], widening(len(parts)) * steps])
    return table_std(solution.chain, root)


def jackknife_root(parts: Sequence[TorqueStatistics], prior: Array, noise_std: Array) -> Array:
    """
    Return a root (m, K) of the parameters' covariance by leaving out parts.

    Parameters are as in `measure_left_out`.
    """
    grams = np.array([[r.T @ r for r in part.factors] for part in parts])
    rest = grams.sum(axis=0) - grams
    steps = np.stack([solved(each, prior, noise_std)[0] for each in rest], axis=1)
    count = len(parts)
    return np.asarray(np.sqrt((count - 1) / count) * (steps - steps.mean(axis=1, keepdims=True)))
