"""An arm from its recordings: placements, links, friction and their posterior, in that order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from threadpoolctl import threadpool_limits

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.friction.dahl_friction import DahlFriction
from lip_id_ros.friction.noise import estimate_noise, sticking_noise, TorqueNoise
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter, Described, MOST_SAMPLES
from lip_id_ros.identification.arm_prior import links_torque
from lip_id_ros.identification.arm_search import ArmSearch, find_placements
from lip_id_ros.identification.coupling_search import find_couplings
from lip_id_ros.identification.description_doubts import DescriptionDoubts, doubts
from lip_id_ros.identification.disturbances import (
    Episode,
    halves_agree,
    without_disturbances,
)
from lip_id_ros.identification.friction_candidates import named_candidates
from lip_id_ros.identification.friction_selection import EVERY_TERM, Offer
from lip_id_ros.identification.geometry_selection import select_geometry
from lip_id_ros.identification.lag_selection import with_lags
from lip_id_ros.identification.lever_steps import with_lever_steps
from lip_id_ros.identification.placement_search import Calibration, in_near_frames
from lip_id_ros.identification.posterior import known_of, posterior, table_deviations
from lip_id_ros.identification.residual_gp_selection import select_residual_gp
from lip_id_ros.identification.sample_selection import (
    evenly,
    explained,
    measured,
    plausible,
    remembering,
    without_long_rests,
)
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import Solution
from lip_id_ros.identification.suspicions import suspicions
from lip_id_ros.model.arm_posterior import ArmPosterior
from lip_id_ros.model.residual_gp import ResidualGP, ResidualGPMean
from lip_id_ros.progress import Progress, silent
from lip_id_ros.rigid_body.chain import NO_COUPLINGS
from lip_id_ros.rigid_body.denavit_hartenberg import DenavitHartenberg

Find = Callable[[ArmFitter, int, Progress], tuple[ArmSearch, Calibration]]

STAGE = 'links and friction'
STEPS = 4

PROCESSES, NAMED, FRICTION = 'processes', 'named', 'friction'
OFFERS: Mapping[str, Offer] = {
    PROCESSES: EVERY_TERM,
    NAMED: EVERY_TERM,
    FRICTION: Offer(named_candidates, levers=True),
}
"""Friction terms on offer, by what may be beside the links: a value of the setting `fit.terms`."""

LEAST_SAMPLES_PER_JOINT = 2
"""With fewer samples placements fit anything, and mean nothing."""


@dataclass(frozen=True, eq=False)
class Identified:
    """An arm that was identified, and how that went."""

    arm: ArmPosterior
    fit: ArmFit  # that the posterior is about, with the noise of its samples
    solution: Solution  # of all samples, by recordings
    recordings: IntArray  # (R,), numbers of those with samples that count
    residual_gp: ResidualGP | None  # beside torques of some joints, or in their place
    kinematics_std: DenavitHartenberg  # as if no geometry had been selected
    geometry: Geometry
    searches_agreed: bool  # both ended in the same minimum
    descents: int  # of both searches
    unexplained: Array  # (n,), share of variance of left-out torques
    unexplained_of_all: Array  # (n,), of all torques, contacts and outliers included
    disturbed: Array  # (n,), share of the samples that are outside of the fit as contacts
    unpredicted: Array  # (n,), the same without low-passed signs of the fit
    outliers: int  # samples that were left out
    disturbances: list[Episode]  # parts of the time that were left out
    halves_agree: bool  # whether both halves are of one arm
    suspicions: list[str]
    doubts: DescriptionDoubts | None = None  # where the data contradict the description

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torques at joint states of shape (N, n), same shape [N m or N]."""
        tau = self.arm.torque(q, dq, ddq)
        if self.residual_gp is not None:
            ResidualGPMean(self.residual_gp).add_to(tau, q, dq, ddq)
        return tau


def identify(
    dataset: Dataset,
    seed: int = 0,
    progress: Progress = silent,
    described: Described | None = None,
    robots: Sequence[str] | None = None,
    couplings: Array | None = None,
    terms: str = PROCESSES,
) -> Identified:
    """
    Identify chain, links and friction of an arm, from samples in the order of time.

    `described` is the prior of placements and links, which keeps its frames; without one the
    placements are searched for. `robots` has the robot of every number of a recording.
    `couplings`, shape (k, 3) as in `Chain`, are searched for where neither they nor a description
    is given. `terms` is a key of `OFFERS`. Raises FitError if the data are not finite in units of
    the noise.
    """
    # Products this small gain nothing from more threads of their own.
    with threadpool_limits(1):
        known = NO_COUPLINGS if couplings is None else couplings
        fitter = ArmFitter(dataset, described, robots, known)
        find = find_placements if described or couplings is not None else _find_arm
        return _identified(fitter, find, seed, progress, described, terms)


def prediction_noise(
    fitter: ArmFitter, fit: ArmFit, noise: TorqueNoise, residual_gp: ResidualGP | None
) -> TorqueNoise:
    """
    Return the noise of predictions from that of links and friction.

    A residual GP leaves its own residuals, and a joint that sticks has any friction.
    """
    signs = squares_of_signs(fitter.dataset, fit)
    noise = _of_single_states(fitter.dataset, fit, noise)
    replaced = np.zeros(noise.std.shape, dtype=np.bool_)
    if residual_gp is not None:
        replaced = residual_gp.replaces
        own = np.sqrt(residual_gp.left_out_std**2 + np.where(replaced, 0.0, signs))
        noise = replace(noise, std=np.where(residual_gp.joints, own, noise.std))
    some = fitter.some(MOST_SAMPLES)
    load = links_torque(fit.chain, fit.links, some)
    remembered = DahlFriction.of(fit.friction, replaced).largest(replaced.size)
    return sticking_noise(noise, fit.friction, some.q, some.ddq, load, remembered)


def squares_of_signs(dataset: Dataset, fit: ArmFit) -> Array:
    """Return what predictions leave more than the fit, whose signs they do not know, (n,)."""
    some = dataset.select(evenly(dataset.n_samples, MOST_SAMPLES))
    single = replace(some, low_passed_sign=None)
    squares = [np.mean(_residual(each, fit) ** 2, axis=0) for each in (single, some)]
    return np.asarray(np.maximum(squares[0] - squares[1], 0.0))


def _residual(dataset: Dataset, fit: ArmFit) -> Array:
    state, load = (dataset.q, dataset.dq, dataset.ddq), links_torque(fit.chain, fit.links, dataset)
    friction = fit.friction.torque(*state, load, dataset.history)
    return np.asarray(dataset.tau - load - friction)


def _weighted_squares(dataset: Dataset, fit: ArmFit) -> Array:
    some = dataset.select(evenly(dataset.n_samples, MOST_SAMPLES))
    return np.asarray(np.mean(fit.noise.weights(some.dq) * _residual(some, fit) ** 2, axis=0))


def _of_single_states(dataset: Dataset, fit: ArmFit, noise: TorqueNoise) -> TorqueNoise:
    """Return the noise where signs are not known, as in predictions; at least the one given."""
    if dataset.low_passed_sign is None:
        return noise
    some = dataset.select(evenly(dataset.n_samples, MOST_SAMPLES))
    single = estimate_noise(_residual(replace(some, low_passed_sign=None), fit), some.dq)
    squares = [np.mean(each.std_at(some.dq) ** 2, axis=0) for each in (single, noise)]
    wider = squares[0] > squares[1]
    return TorqueNoise(
        np.where(wider, single.std, noise.std),
        np.where(wider, single.ratio, noise.ratio),
        np.where(wider, single.velocity, noise.velocity),
    )


def _identified(
    fitter: ArmFitter,
    find: Find,
    seed: int,
    progress: Progress,
    described: Described | None,
    terms: str,
) -> Identified:
    dataset = remembering(fitter.dataset)
    rows = without_long_rests(dataset)
    if rows.size < dataset.n_samples:  # a long recording is not copied for nothing
        dataset = dataset.select(rows)
    usable = _usable(dataset)
    search, calibration, disturbances = _calibrated(fitter.of(usable), find, seed, progress)
    if not fitter.is_described:
        calibration = in_near_frames(search.search_samples(), calibration)
    fitter, agree = search.fitter, halves_agree(search, calibration)
    fit = _fitted(fitter, calibration, OFFERS[terms], progress)
    fit, arm, solution, total = posterior(fitter, fit)
    residual_gp = select_residual_gp(fitter, fit) if terms == PROCESSES else None
    arm = replace(arm, noise=prediction_noise(fitter, fit, arm.noise, residual_gp))
    kinematics_std = table_deviations(total, solution, known_of(fitter, fit))
    progress(STAGE, STEPS, STEPS)
    unexplained = solution.left_out.mean_squares
    return Identified(
        arm=arm,
        fit=fit,
        solution=solution,
        recordings=np.unique(fitter.dataset.recording),
        residual_gp=residual_gp,
        geometry=fit.geometry,
        searches_agreed=calibration.agreed,
        descents=calibration.descents,
        unexplained=unexplained / fitter.torque_std**2,
        unpredicted=(unexplained + squares_of_signs(fitter.dataset, fit)) / fitter.torque_std**2,
        unexplained_of_all=_weighted_squares(usable, fit) / fitter.torque_std**2,
        disturbed=_disturbed(usable, disturbances),
        outliers=dataset.n_samples - fitter.dataset.n_samples,
        disturbances=disturbances,
        halves_agree=agree,
        suspicions=suspicions(search, calibration, seed, progress),
        kinematics_std=kinematics_std,
        doubts=doubts(fitter, fit, described[0]) if described else None,
    )


def _find_arm(fitter: ArmFitter, seed: int, progress: Progress) -> tuple[ArmSearch, Calibration]:
    """Find placements and coupled positions."""
    return find_couplings(*find_placements(fitter, seed, progress), seed, progress)


def _usable(dataset: Dataset) -> Dataset:
    """Return the samples that are measured, and of the size of the others."""
    if not (kept := measured(dataset)).all():
        dataset = dataset.select(np.flatnonzero(kept))
    return dataset.select(np.flatnonzero(plausible(dataset)))


def _disturbed(dataset: Dataset, episodes: Sequence[Episode]) -> Array:
    """Return the shares of the samples that are in episodes of each joint, (n,)."""
    share = np.zeros(dataset.n_joints)
    for each in episodes:
        inside = (each.start_s <= dataset.t) & (dataset.t <= each.end_s)
        share[list(each.joints)] += np.mean(inside & (dataset.recording == each.recording))
    return share


def _calibrated(
    fitter: ArmFitter, find: Find, seed: int, progress: Progress
) -> tuple[ArmSearch, Calibration, list[Episode]]:
    """Find the placements, and leave out the samples that nothing explains."""
    found = _without_outliers(*find(fitter, seed, progress))
    search, calibration, disturbances = without_disturbances(*found)
    if disturbances:
        search, calibration = _without_outliers(search, calibration)
    return search, calibration, disturbances


def _without_outliers(
    search: ArmSearch, calibration: Calibration
) -> tuple[ArmSearch, Calibration]:
    kept = explained(search.residual(calibration.placements))
    if kept.all():
        return search, calibration
    fitter = search.fitter
    search = search.of(fitter.of(fitter.dataset.select(np.flatnonzero(kept))))
    return search, search.recalibrated(calibration)


def _fitted(
    fitter: ArmFitter, calibration: Calibration, offer: Offer, progress: Progress
) -> ArmFit:
    """Select friction and geometry, and fit placements, links and friction together."""
    progress(STAGE, 0, STEPS)
    selected = fitter.selected(calibration.placements.chain, offer)
    progress(STAGE, 1, STEPS)
    fit = fitter.best_start([each.chain for each in calibration.candidates], selected)
    progress(STAGE, 2, STEPS)
    # Loads and placements are better known by now.
    fit = fitter.with_friction(fit, fitter.selected(fit.chain, offer))
    fit = with_lever_steps(fitter, fitter.refined(fitter.some(MOST_SAMPLES), fit))
    fit = with_lags(fitter, fit)
    progress(STAGE, 3, STEPS)
    if fitter.is_described:
        return fitter.converged(fitter.some(MOST_SAMPLES), fit)
    return select_geometry(fitter, fit)
