"""
The search for coupled positions, from wrong serial chains (maths.md, section 10).

Where a coupling lowers the residuals far, left-out motions judge it, with placements found without
them and friction selected anew; then the placements are searched for again.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.identification.arm_search import (
    ArmSearch,
    FEW_SAMPLES,
    LEAST_RESIDUAL,
    log_left_out,
)
from lip_id_ros.identification.folds import recurrent_folds
from lip_id_ros.identification.kinematic_calibration import (
    PlacementProblem,
    placements_residual,
    Samples,
)
from lip_id_ros.identification.left_out import Gain
from lip_id_ros.identification.placement_search import (
    Calibration,
    coarse_noise,
    few_of,
    FINE,
    MORE_EVALUATIONS,
    SEARCHES,
)
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.progress import Progress
from lip_id_ros.rigid_body.couplings import contradiction, Coupling, couplings_of, rows_of

FIRST_RATIOS = (1.0, -1.0, 0.5, -0.5)
RATIOS = tuple(
    sign * ratio for ratio in (0.25, 1 / 3, 0.5, 2 / 3, 1.0, 1.5, 2.0, 3.0) for sign in (1.0, -1.0)
)
"""Ratios that all neighbours are tried with, and the best of them once more."""

EVALUATIONS, MINIMA = 20, 2
"""Of the descent of a trial from each of so many minima."""

FINALISTS, LAST_EVALUATIONS = 3, 60
"""Ratios that descend farther, and how far: short descents may order them wrongly."""

HINT = 0.1
"""
Least decrease of the logarithm of the cost of a trial that is worth trying more ratios, and a
judgement.
"""

SAMPLES, FOLDS, LEAST_FOLDS = 600, 6, 4
"""
Samples that are predicted, motions that are left out, and the least number of different ones:
where a recording repeats more than that, nothing is judged.
"""

LEAST_GAIN = float(np.log(4.0))
"""
Least decrease of the logarithm of left-out mean squares, summed over joints, by each coupling: the
error of one joint has to halve.
"""

MOST = 3
"""Couplings of an arm."""


def find_couplings(
    search: ArmSearch, found: Calibration, seed: int, progress: Progress
) -> tuple[ArmSearch, Calibration]:
    """
    Find couplings of neighbouring revolute joints one by one, and the placements.

    Raises FitError. Returns what is given where no coupling predicts left-out motions better for
    sure.
    """
    best = at = search, found
    while len(at[0].fitter.couplings) < MOST:
        coupling = promising(*at)
        if coupling is None:
            break
        # where there are several, one alone may predict little better
        other = with_coupling(at[0], coupling)
        at = other, other.recalibrated(at[1])
        if predicts_better(*at, *best):
            best = at = other, other.calibrated(seed, progress)
    return best


def with_coupling(search: ArmSearch, coupling: Coupling) -> ArmSearch:
    """Return a search with one more coupling."""
    fitter = search.fitter
    rows = np.concatenate([fitter.couplings, rows_of((coupling,))])
    return ArmSearch(fitter.coupled(rows), search.terms, search.rise_time)


def promising(search: ArmSearch, found: Calibration) -> Coupling | None:
    """Return the coupling with which short descents explain most, if that is far more."""
    if not (found.noise_std > LEAST_RESIDUAL * search.fitter.torque_std).any():
        return None
    samples = search.search_samples()
    coarse, few = coarse_noise(samples), few_of(samples, FEW_SAMPLES)
    with threadpool_limits(1), ThreadPoolExecutor(SEARCHES) as pool:

        def cost(*more: Coupling, evaluations: int = EVALUATIONS) -> float:
            couplings = np.concatenate([few.couplings, rows_of(more)])
            return _lowest_cost(replace(few, couplings=couplings), coarse, found, evaluations)

        offers = [c for c in _neighbours(search) if not _contradicts(search, c)]
        if not offers:
            return None
        serial, first = cost(), list(pool.map(cost, offers))
        if np.log(serial / min(first)) < HINT:
            return None
        best = offers[int(np.argmin(first))]
        ratios = [best._replace(ratio=ratio) for ratio in RATIOS]
        order = np.argsort([*pool.map(cost, ratios)], kind='stable')[:FINALISTS]
        last = [ratios[k] for k in order]
        lowest = [*pool.map(partial(cost, evaluations=LAST_EVALUATIONS), last)]
    return last[int(np.argmin(lowest))] if np.log(serial / min(lowest)) > HINT else None


def _neighbours(search: ArmSearch) -> Iterator[Coupling]:
    slides = search.fitter.dataset.prismatic
    for joint in range(1, len(slides)):
        if not (slides[joint] or slides[joint - 1]):
            yield from (Coupling(joint, joint - 1, ratio) for ratio in FIRST_RATIOS)


def _contradicts(search: ArmSearch, coupling: Coupling) -> bool:
    couplings = (*couplings_of(search.fitter.couplings), coupling)
    return bool(contradiction(couplings, search.fitter.dataset.n_joints))


def _lowest_cost(
    samples: Samples, noise_std: Array, found: Calibration, evaluations: int
) -> float:
    """Return the lowest cost of short descents from the minima."""
    problem = PlacementProblem(samples, noise_std)
    chains = [each.chain for each in found.candidates[:MINIMA]]
    descents = [problem.descend(c.rotations, c.translations, evaluations) for c in chains]
    return min(each.cost for each in descents)


def predicts_better(
    other: ArmSearch, its: Calibration, search: ArmSearch, found: Calibration
) -> bool:
    """Return whether a search with more couplings predicts left-out motions better for sure."""
    dataset = search.fitter.dataset
    rows = evenly(dataset.n_samples, SAMPLES)
    fold = recurrent_folds(dataset, FOLDS)[rows]
    if np.unique(fold).size < LEAST_FOLDS:
        return False
    floor = np.square(search.fitter.least_noise)
    now, then = (
        floor + _left_out_squares(each.samples(dataset.select(rows)), calibration, fold)
        for each, calibration in ((search, found), (other, its))
    )
    least = least_gain(len(other.fitter.couplings) - len(search.fitter.couplings))
    if not Gain.between([now], [then]).is_sure(least):
        return False
    # efforts of coupled motors are no coupled positions: friction terms stand for them
    gain = log_left_out(search.fitter, found) - log_left_out(other.fitter, its)
    return bool(2.0 * dataset.n_joints * gain > least)


def least_gain(more: int) -> float:
    """Return the least gain of so many more couplings: each has to be worth its own."""
    return LEAST_GAIN * more


def _left_out_squares(samples: Samples, found: Calibration, fold: IndexArray) -> Array:
    """Return mean squares of motions that placements and all else were found without, (K, n)."""
    chain, squares = found.placements.chain, []
    for k in np.unique(fold):
        problem = PlacementProblem(samples.select(np.flatnonzero(fold != k)), found.noise_std)
        placed = problem.descend(chain.rotations, chain.translations, MORE_EVALUATIONS, FINE)
        left = samples.select(np.flatnonzero(fold == k))
        residual = placements_residual(placed, left)
        squares.append(np.mean(left.weights * residual**2, axis=0))
    return np.array(squares)
