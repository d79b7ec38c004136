"""A fit to a fleet of recordings: survey, placements, statistics, solution (maths.md, 14)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
import time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.fleet.engines import Engine
from lip_id_ros.fleet.gathering import gathered_from
from lip_id_ros.fleet.model import model_of, with_processes
from lip_id_ros.fleet.passes import Cache, digest, Passes, Source
from lip_id_ros.fleet.placements import chosen, contradictions, place, PlacedArm
from lip_id_ros.fleet.results import (
    EXCLUDED,
    FAILED,
    FITTED,
    FleetResult,
    RecordingResult,
    Survey,
)
from lip_id_ros.fleet.survey import joint_order, reservoir_data, sorted_of_one_arm, survey
from lip_id_ros.friction.model import FrictionBasis
from lip_id_ros.friction.terms import Coulomb, Offset, Viscous
from lip_id_ros.identification.arm_fit import ArmFitter, Described
from lip_id_ros.identification.fitting import described_arm
from lip_id_ros.identification.identify import LEAST_SAMPLES_PER_JOINT, PROCESSES
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.posterior import is_linear, SAMPLES
from lip_id_ros.identification.recording_factors import RecordingFactors
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import (
    fitted_alone,
    Known,
    RecordingFits,
    Solution,
    solutions,
)
from lip_id_ros.identification.total import FOLDS, Total
from lip_id_ros.joint_types import POSITION_UNITS, TORQUE_UNITS
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import Config

SURVEY, STATISTICS = 'recordings read', 'statistics of recordings'
ONCE_MORE = 'statistics, once more'
"""Stages of progress, one per pass."""

SURVEYED = 'n_samples', 'rate_hz', 'seconds', 'start_s', 'temperature', 'health'
"""Of a survey, what the result of its recording has too."""

UNITS = {Viscous.name: ' [{0} s/{1}]', Coulomb.name: ' [{0}]', Offset.name: ' [{0}]'}
"""Of coefficients, by the units of torques and positions."""

EXCLUSIONS = 5
"""Most starts of the solution while recordings are found to contradict the fleet."""


def fit_fleet(
    sources: Sequence[Source],
    config: Config,
    engine: Engine,
    cache: Cache | None = None,
    progress: Progress = silent,
) -> FleetResult:
    """
    Fit one model to all recordings of a fleet.

    Parameters
    ----------
    sources : sequence of Source
    config : Config
    engine : Engine
    cache : Cache, optional
        Of surveys, placements and statistics, by contents and settings.
    progress : callable

    Raises
    ------
    ConfigError
        If the settings ask for another model than an arm.
    DataError
        If no recording can be used, or all together are too short.
    FitError
        If the data are not finite in units of the noise.

    """
    if config.fit.kernel != ARTICULATED:
        raise ConfigError(
            f'a fit recording by recording needs fit.kernel {ARTICULATED}, not '
            f'{config.fit.kernel}; leave the kernel out, or fit single recordings.'
        )
    with threadpool_limits(1):
        return _Fit(
            sources, config, Passes(engine, {} if cache is None else cache, progress)
        ).result()


@dataclass(frozen=True, eq=False)
class _Solved:
    """
    Solution of the second pass.

    Attributes
    ----------
    solution : Solution
    around : Linearisation
        Where it was linear.
    kept : list of Survey
        Of the recordings in it.
    numbers : list of int
        Of the sources of the R recordings with statistics.
    fits : RecordingFits
        Of these.
    contradicting : dict
        Why a recording is left out, by number of the source.

    """

    solution: Solution
    around: Linearisation
    kept: list[Survey]
    numbers: list[int]
    fits: RecordingFits
    contradicting: dict[int, str]


class _Fit:
    """One fit of a fleet, pass by pass; surveys and reasons are by number of the source."""

    def __init__(self, sources: Sequence[Source], config: Config, passes: Passes) -> None:
        self._sources, self._config, self._passes = sources, config, passes
        self._settings = digest(config.recording, config.preprocessing, config.fit.kernel)
        self._reasons: dict[int, tuple[str, str]] = {}

    def result(self) -> FleetResult:
        """Run both passes, solve and report."""
        started = time.monotonic()
        every = self._surveyed()
        surveys = self._of_one_arm(every)
        placed, described = self._placed(list(surveys.values()))
        fitter = ArmFitter(placed.dataset, described, couplings=placed.couplings)
        solved = self._solved_twice(surveys, placed, placed.known(fitter))
        model = model_of(placed, solved.solution, solved.around, solved.kept, fitter, described)
        seconds = round(time.monotonic() - started, 3)
        return FleetResult(
            model=replace(model, summary={**model.summary, 'seconds_total': seconds}),
            recordings=self._recordings(every, solved),
            friction_names=friction_names(
                placed.around.friction.basis, placed.joint_names, placed.joint_types
            ),
            noise_std=solved.solution.noise_std,
            deviation_of_recordings=solved.solution.deviations.recordings,
            deviation_of_groups=solved.solution.deviations.groups,
        )

    def _surveyed(self) -> dict[int, Survey]:
        """Return the surveys of all recordings that can be read."""
        keys = [digest('survey', self._settings, each.fingerprint) for each in self._sources]
        function = partial(_survey, config=self._config)
        found, failed = self._passes.run(Survey, function, self._sources, keys, SURVEY)
        self._reasons |= {k: (FAILED, reason) for k, reason in failed.items()}
        if not found:
            some = next(iter(failed.values()), 'there is none')
            raise DataError(
                f'at least one recording that can be read is needed, but {len(self._sources)} '
                f'sources have none; the first: {some}'
            )
        return {
            k: replace(each, name=self._sources[k].name, group=self._sources[k].group)
            for k, each in sorted(found.items())
        }

    def _of_one_arm(self, surveys: dict[int, Survey]) -> dict[int, Survey]:
        """Return the surveys of one arm in the order of their keys."""
        numbers = list(surveys)
        kept, left_out = sorted_of_one_arm(list(surveys.values()))
        self._reasons |= {numbers[k]: (EXCLUDED, reason) for k, reason in left_out.items()}
        return {numbers[k]: surveys[numbers[k]] for k in kept}

    def _placed(self, surveys: list[Survey]) -> tuple[PlacedArm, Described | None]:
        settings, names = self._config.fit, joint_order(surveys)
        least = LEAST_SAMPLES_PER_JOINT * len(names)
        if (count := sum(each.n_samples for each in surveys)) < least:
            raise DataError(
                f'a fit of several recordings needs at least {least} samples, but these have '
                f'{count}; record longer.'
            )
        joint_types = reservoir_data(surveys[0], names).joint_types
        described = described_arm(names, joint_types, settings)
        content = described[0].fingerprint if described else ''
        some = [(each.key, each.group) for each in chosen(surveys)]
        key = digest('placements', self._settings, some, names, settings, content)
        if (placed := self._passes.restored(PlacedArm, key)) is None:
            placed, solution = place(surveys, names, settings, described, self._passes.progress)
            if settings.terms == PROCESSES:
                placed = with_processes(placed, solution, surveys, described)
            self._passes.keep(key, placed)
        return placed, described

    def _solved_twice(
        self, surveys: dict[int, Survey], placed: PlacedArm, known: Known
    ) -> _Solved:
        """Solve, and once more where the solution is too far away to be linear."""
        excluded, around = dict(placed.excluded), placed.around
        contradicting = {k: excluded[s.key] for k, s in surveys.items() if s.key in excluded}
        some = placed.dataset.select(evenly(placed.dataset.n_samples, SAMPLES))
        fixed = replace(known.geometry, rigid=True)
        gathered = self._gathered(surveys, around, STATISTICS)
        for moves in (known.geometry, fixed):
            solved = self._solved(surveys, gathered, around, known, moves, contradicting)
            if is_linear(around, solved.solution, some):
                return solved
        found = solved.solution
        around = replace(around, chain=found.chain, links=found.links, friction=found.friction)
        gathered = self._gathered(surveys, around, ONCE_MORE)
        return self._solved(surveys, gathered, around, known, fixed, solved.contradicting)

    def _solved(
        self,
        surveys: dict[int, Survey],
        gathered: dict[int, RecordingFactors],
        around: Linearisation,
        known: Known,
        moves: Geometry,
        contradicting: Mapping[int, str],
    ) -> _Solved:
        """Solve without the recordings that contradict the fleet."""
        numbers = list(gathered)
        groups = [surveys[k].group for k in numbers]
        statistics = Total(around, list(gathered.values()), groups)
        kept = np.array([k not in contradicting for k in numbers])
        for left in reversed(range(EXCLUSIONS)):
            solved, others = statistics.select(kept), statistics.select(~kept)
            for solution in solutions(solved, known, moves):
                fits = solution.recordings.among(kept, fitted_alone(others, solution))
                reasons = contradictions(fits.residual_rms, kept, around.joint_names)
                now = np.array([k not in reasons for k in range(len(numbers))])
                if left and not np.array_equal(now, kept):
                    break  # the later rounds would be of the wrong recordings
            else:
                break
            kept = now
        in_fit = [surveys[numbers[k]] for k in np.flatnonzero(kept)]
        return _Solved(
            solution, around, in_fit, numbers, fits, {numbers[k]: reasons[k] for k in reasons}
        )

    def _gathered(
        self, surveys: dict[int, Survey], around: Linearisation, stage: str
    ) -> dict[int, RecordingFactors]:
        """Return the statistics of recordings in the order of their keys."""
        numbers = list(surveys)
        some = [self._sources[k] for k in numbers]
        blocks = FOLDS if len(surveys) <= 2 else 1  # one of two may fail
        what = 'statistics', self._settings, linearisation_digest(around), blocks
        keys = [digest(*what, each.fingerprint) for each in some]
        function = partial(_factors, around=around, blocks=blocks, config=self._config)
        found, failed = self._passes.run(RecordingFactors, function, some, keys, stage)
        for number in numbers:  # what failed in the pass before may have gone well in this one
            self._reasons.pop(number, None)
        self._reasons |= {numbers[k]: (FAILED, reason) for k, reason in failed.items()}
        if not found:
            raise DataError(
                'at least one recording that can be read twice was expected, but there is none; '
                f'the first: {next(iter(self._reasons.values()))[1]}'
            )
        return {numbers[k]: found[k] for k in sorted(found)}

    def _recordings(
        self, surveys: Mapping[int, Survey], solved: _Solved
    ) -> tuple[RecordingResult, ...]:
        self._reasons |= {k: (EXCLUDED, each) for k, each in solved.contradicting.items()}
        rows = {number: row for row, number in enumerate(solved.numbers)}
        results = []
        for number, source in enumerate(self._sources):
            survey, row = surveys.get(number), rows.get(number)
            status, reason = self._reasons.get(number, (FITTED, ''))
            known: dict[str, Any] = {name: getattr(survey, name) for name in SURVEYED if survey}
            for name, values in vars(solved.fits).items():
                known[name] = np.full(values.shape[1], np.nan) if row is None else values[row]
            results.append(
                RecordingResult(
                    name=source.name, group=source.group, status=status, reason=reason, **known
                )
            )
        return tuple(results)


def friction_names(
    basis: FrictionBasis, joint_names: Sequence[str], joint_types: Sequence[str]
) -> tuple[str, ...]:
    """Return a name for each coefficient: joints, term, number of several, unit of the usual."""
    names = []
    for part in basis.terms:
        acted_on = [joint_names[joint] for joint, _ in part.drive.efforts]
        others = [name for k in part.drive.joints if (name := joint_names[k]) not in acted_on]
        coupled = f' coupled with {", ".join(others)}' if others else ''
        kind = joint_types[part.drive.joints[0]]
        unit = UNITS.get(part.term.name, '').format(TORQUE_UNITS[kind], POSITION_UNITS[kind])
        for number in range(part.size):
            ending = f' {number + 1}' if part.size > 1 else ''
            names.append(f'{", ".join(acted_on)}: {part.term.name}{coupled}{ending}{unit}')
    return tuple(names)


def linearisation_digest(around: Linearisation) -> str:
    """Return a text that changes with what statistics are gathered with."""
    chain, noise = around.chain, around.noise
    arrays = *chain, around.links, noise.std, noise.ratio, noise.velocity
    return digest(
        around.joint_names,
        around.friction.to_json(),
        [np.ascontiguousarray(each).tobytes().hex() for each in arrays],
    )


def _survey(source: Source, config: Config) -> Survey:
    with source.local() as path:
        return survey(path, source.name, source.group, config)


def _factors(
    source: Source, around: Linearisation, blocks: int, config: Config
) -> RecordingFactors:
    with source.local() as path:
        return gathered_from(path, around, blocks, config)
