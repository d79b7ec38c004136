"""
Placements of the joints from the reservoirs of all recordings, and recordings of another arm.

The first identification takes all recordings for one arm with one friction. With its placements,
each recording gets its own friction, and those whose residuals contradict the fleet are left out;
then the arm is identified again, with what friction deviates by taken from the torques.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
import json
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.checked_file import Packable
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.fleet.results import ARM, SIGNALS, Survey
from lip_id_ros.fleet.survey import merged
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.identification.arm_fit import ArmFitter, Described
from lip_id_ros.identification.arm_prior import links_torque
from lip_id_ros.identification.fitting import description_report, fit_report, known_couplings
from lip_id_ros.identification.identify import Identified, identify
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.residual_gp_selection import ResidualProcess
from lip_id_ros.identification.sample_selection import plausible
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import Known, Solution
from lip_id_ros.progress import Progress, silent
from lip_id_ros.rigid_body import Chain
from lip_id_ros.settings import FitSettings

ROUNDS = ('', ', friction of each', ', without outliers')
"""
Identifications, by what they add to the names of their stages: with one friction, with that of
each recording, and once more where recordings are found to contradict the fleet.
"""

MOST_RECORDINGS = 24
"""Recordings that placements are identified with."""

LEAST_RECORDINGS = 4
"""With fewer recordings none contradicts the others."""

FARTHEST, LEAST_RATIO = 6.0, 2.0
"""
Residual from which a recording contradicts the fleet: so many robust standard deviations of the
logarithms above the median, and at least this factor.
"""

NOTHING = (
    'has no samples that count: its drives are off, or all of it contradicts the other recordings'
)
"""Reason to leave out a recording."""

NORMAL_MAD = 1.4826
"""Standard deviation of a normal variable in median absolute deviations."""


@dataclass(frozen=True, eq=False)
class PlacedArm(Packable):
    """
    Outcome of the first pass, as plain arrays and texts.

    Chain, friction, noise, geometry and samples.
    """

    KIND = 'placements'
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    rotations: Array
    translations: Array
    gravity: Array
    couplings: Array
    links: Array  # (n, 11)
    friction: str  # JSON: terms and coefficients
    noise_std: Array  # (n,), as the next two, of the samples of the fit
    noise_ratio: Array
    noise_velocity: Array
    twists: Array  # of the geometry that was selected, as the next two
    meets: BoolArray
    rigid: bool
    report: str  # JSON: summary of the identification
    excluded: tuple[tuple[str, str], ...]  # key and reason, of contradicting recordings
    processes: tuple[tuple[Any, ...], ...]  # fields of a GP by joint; empty where none
    t: Array
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    low_passed_sign: Array | None
    dahl_states: Array | None
    segment: IntArray
    recording: IntArray
    gravity_compensated: bool

    @cached_property
    def dataset(self) -> Dataset:
        """The samples that the arm was identified with."""
        return Dataset(**{name: getattr(self, name) for name in (*ARM, *SIGNALS, 'recording')})

    @cached_property
    def around(self) -> Linearisation:
        """What torques are regressed on."""
        return Linearisation(
            self.joint_names,
            Chain(
                self.rotations,
                self.translations,
                self.dataset.prismatic,
                self.gravity,
                self.couplings,
            ),
            self.links,
            FrictionModel.from_json(json.loads(self.friction)),
            TorqueNoise(self.noise_std, self.noise_ratio, self.noise_velocity),
        )

    @property
    def geometry(self) -> Geometry:
        """Twists and lengths that were selected to be simple."""
        return Geometry(self.twists, self.meets, self.rigid)

    @property
    def residual_gp(self) -> list[ResidualProcess | None]:
        """Gaussian process of every joint; None where it has none."""
        return [
            ResidualProcess(each[0], np.array(each[1]), *each[2:]) if each else None
            for each in self.processes
        ]

    def with_residual_gp(self, processes: Sequence[ResidualProcess | None]) -> PlacedArm:
        """Return the arm with Gaussian processes."""
        fields = tuple(
            (
                each.replaces,
                tuple(each.lengths.tolist()),
                each.noise,
                each.weight,
                each.left_out_std,
            )
            if each
            else ()
            for each in processes
        )
        return replace(self, processes=fields)

    def known(self, fitter: ArmFitter) -> Known:
        """Return what is known of the arm before statistics are."""
        return Known(fitter.torque_std, fitter.prior, self.geometry)


def place(
    surveys: Sequence[Survey],
    joint_names: Sequence[str],
    settings: FitSettings,
    described: Described | None = None,
    progress: Progress = silent,
) -> tuple[PlacedArm, Solution]:
    """
    Identify an arm with the reservoirs of its recordings, base to tip.

    A description is a prior. Returns the arm without processes, and the solution of these
    reservoirs. ConfigError if couplings name other joints; FitError if the data are not finite in
    units of the noise.
    """
    kept, excluded = chosen(surveys), dict[str, str]()
    couplings = known_couplings(settings, joint_names)
    data = merged(kept, joint_names)
    for number, stages in enumerate(ROUNDS):
        robots = [each.group for each in kept]
        stage = _named(progress, stages)
        arm = described, robots, couplings, settings.terms
        found = identify(data, settings.seed, stage, *arm)
        if len(kept) == 1:
            break
        rms = found.solution.recordings.residual_rms
        reasons = contradictions(rms, np.ones(len(rms), dtype=bool), joint_names)
        present = [kept[k] for k in found.recordings]
        excluded |= {each.key: NOTHING for each in kept if each not in present}
        if number == len(ROUNDS) - 1 or (number > 0 and not reasons):
            break
        excluded |= {present[row].key: reason for row, reason in reasons.items()}
        rows = [row for row in range(len(present)) if row not in reasons]
        kept = [present[row] for row in rows]
        data = _centred(kept, joint_names, found, rows)
    placed = _placed(data, found, settings, described, excluded)
    return _with_keys(placed, [each.key for each in kept]), found.solution


def _named(progress: Progress, ending: str) -> Progress:
    """Return a callback for stages whose names are the usual ones with an ending."""
    return lambda stage, done, total: progress(f'{stage}{ending}', done, total)


def chosen(surveys: Sequence[Survey]) -> list[Survey]:
    """
    Return the recordings that placements are identified with, those with the lowest keys.

    A key is as good as random, and further recordings seldom have lower ones (bottom-k sampling:
    Cohen and Kaplan, PODC 2007), so that statistics of before can be used again.
    """
    return sorted(surveys, key=lambda each: each.key)[:MOST_RECORDINGS]


def contradictions(rms: Array, kept: BoolArray, joint_names: Sequence[str]) -> dict[int, str]:
    """
    Return which recordings contradict the fleet, and why.

    Residuals (R, n) are those with own friction [N m or N]; `kept` marks what the fleet was fitted
    to.
    """
    known = np.isfinite(rms).all(axis=1)
    nothing = {int(k): NOTHING for k in np.flatnonzero(~known)}
    if kept.size < LEAST_RECORDINGS:
        return nothing
    kept = kept & known
    logs = np.log(np.maximum(rms, 1e-300))
    median = np.median(logs[kept], axis=0)
    spread = NORMAL_MAD * np.median(np.abs(logs[kept] - median), axis=0)
    excess = logs - median - np.maximum(FARTHEST * spread, np.log(LEAST_RATIO))
    worst = np.argmax(excess, axis=1)
    return nothing | {
        int(k): (
            f'contradicts the other recordings: its residual at {joint_names[worst[k]]} is '
            f'{np.exp(logs[k, worst[k]] - median[worst[k]]):.1f} times the median of '
            f'{kept.sum()} recordings; it may be of another arm or have another load'
        )
        for k in np.flatnonzero(excess.max(axis=1) > 0.0)
    }


def _placed(
    data: Dataset,
    found: Identified,
    settings: FitSettings,
    described: Described | None,
    excluded: Mapping[str, str],
) -> PlacedArm:
    fit, report = found.fit, fit_report(found, settings)
    if described is not None:
        report['description'] = description_report(found, described[0])
    kept = data.select(np.flatnonzero(plausible(data)))
    return PlacedArm(
        rotations=fit.chain.rotations,
        translations=fit.chain.translations,
        gravity=fit.chain.gravity,
        couplings=fit.chain.couplings,
        links=fit.links,
        friction=json.dumps(fit.friction.to_json()),
        noise_std=fit.noise.std,
        noise_ratio=fit.noise.ratio,
        noise_velocity=fit.noise.velocity,
        twists=fit.geometry.twists,
        meets=fit.geometry.meets,
        rigid=fit.geometry.rigid,
        report=json.dumps(report),
        excluded=tuple(excluded.items()),
        processes=(),
        **{name: getattr(kept, name) for name in (*ARM, *SIGNALS, 'recording')},
    )


def _with_keys(placed: PlacedArm, keys: Sequence[str]) -> PlacedArm:
    """Return the arm with the keys of the recordings whose episodes were left out."""
    report = json.loads(placed.report)
    episodes = [{**each, 'key': keys[each['recording']]} for each in report['disturbances']]
    return replace(placed, report=json.dumps(report | {'disturbances': episodes}))


def _centred(
    surveys: Sequence[Survey],
    joint_names: Sequence[str],
    found: Identified,
    numbers: Sequence[int],
) -> Dataset:
    """Join reservoirs, with the torques that they have with the friction of all together."""
    fit, solution = found.fit, found.solution
    data = merged(surveys, joint_names)
    parts = []
    for recording, number in zip(np.unique(data.recording), numbers, strict=True):
        part = data.select(data.recording == recording)
        deviation = solution.recordings.friction[number] - solution.friction.coefficients
        load = links_torque(fit.chain, fit.links, part)
        state = part.q, part.dq, part.ddq, load, part.history
        features = fit.friction.basis.features(*state)
        parts.append(replace(part, tau=part.tau - features @ deviation))
    return concatenate(parts)
