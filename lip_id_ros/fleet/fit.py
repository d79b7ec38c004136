"""A fit to a fleet of recordings: survey, placements, statistics, solution (maths.md, 14)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.export.friction_table import labels
from lip_id_ros.fleet.engines import Engine
from lip_id_ros.fleet.model import model_of, with_entries, with_processes
from lip_id_ros.fleet.passes import Cache, digest, Passes, Source
from lip_id_ros.fleet.placements import chosen, contradictions, place, PlacedArm
from lip_id_ros.fleet.recordings import Recordings
from lip_id_ros.fleet.results import (
    EXCLUDED,
    FITTED,
    FleetResult,
    RecordingResult,
    Survey,
)
from lip_id_ros.fleet.survey import joint_order, reservoir_data
from lip_id_ros.identification.arm_fit import ArmFitter, Described
from lip_id_ros.identification.fitting import described_arm
from lip_id_ros.identification.identify import LEAST_SAMPLES_PER_JOINT, PROCESSES
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.posterior import is_linear, SAMPLES
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.identification.simple_geometry import Geometry
from lip_id_ros.identification.solution import (
    fitted_alone,
    Known,
    RecordingFits,
    Solution,
    solutions,
)
from lip_id_ros.identification.total import RecordingFactors, Total
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import Config

STATISTICS, ONCE_MORE = 'statistics of recordings', 'statistics, once more'
"""Stages of progress, one per pass."""

SURVEYED = 'n_samples', 'rate_hz', 'seconds', 'start_s', 'temperature', 'health'
"""Of a survey, what the result of its recording has too."""

EXCLUSIONS = 5
"""Most starts of the solution while recordings are found to contradict the fleet."""


def fit_fleet(
    sources: Sequence[Source],
    config: Config,
    engine: Engine,
    cache: Cache | None = None,
    progress: Progress = silent,
    holdout: float = 0.0,
) -> FleetResult:
    """
    Fit one model to all recordings of a fleet, and judge it by what is held out.

    `cache`: of surveys, placements and statistics, by contents and settings. `holdout`: last share
    of the samples of all recordings, in the order of the sources, that nothing is learned or
    selected from. ConfigError if the settings ask for another model than an arm, or cannot be
    selected. DataError if no recording can be used, or all together are too short. FitError if the
    data are not finite in units of the noise.
    """
    if config.fit.kernel != ARTICULATED:
        raise ConfigError(
            f'a fit recording by recording needs fit.kernel {ARTICULATED}, not '
            f'{config.fit.kernel}; leave the kernel out, or fit single recordings.'
        )
    with threadpool_limits(1):
        passes = Passes(engine, {} if cache is None else cache, progress)
        return _Fit(Recordings(sources, config, passes, holdout), passes).result()


@dataclass(frozen=True, eq=False)
class _Solved:
    """
    Solution of the second pass.

    `around`: where it was linear. `kept`: of the recordings in it. `numbers`: of the sources of
    the R recordings with statistics. `fits`: of these. `contradicting`: why a recording is left
    out, by number of the source.
    """

    solution: Solution
    around: Linearisation
    kept: list[Survey]
    numbers: list[int]
    fits: RecordingFits
    contradicting: dict[int, str]


class _Fit:
    """One fit of a fleet, pass by pass; surveys are by number of the source."""

    def __init__(self, recordings: Recordings, passes: Passes) -> None:
        self._recordings, self._passes = recordings, passes

    def result(self) -> FleetResult:
        """Run the passes, solve, judge and report."""
        started = time.monotonic()
        surveys = self._recordings.training()
        placed, described = self._placed(list(surveys.values()))
        fitter = ArmFitter(placed.dataset, described, couplings=placed.couplings)
        solved = self._solved_twice(surveys, placed, placed.known(fitter))
        model = model_of(placed, solved.solution, solved.around, solved.kept, fitter, described)
        model = with_entries(model, self._recordings.entries)
        terms = labels(placed.around.friction.basis, placed.joint_names, placed.joint_types)
        seconds = round(time.monotonic() - started, 3)
        model = replace(model, summary={**model.summary, 'seconds_total': seconds})
        model, evaluation = self._recordings.judged(model, placed.dataset)
        return FleetResult(
            model=model,
            recordings=self._results(solved),
            friction_names=tuple(f'{joint}: {term} [{unit}]' for joint, term, unit in terms),
            noise_std=solved.solution.noise_std,
            deviation_of_recordings=solved.solution.deviations.recordings,
            deviation_of_groups=solved.solution.deviations.groups,
            evaluation=evaluation,
        )

    def _placed(self, surveys: list[Survey]) -> tuple[PlacedArm, Described | None]:
        settings, names = self._recordings.config.fit, joint_order(surveys)
        least = LEAST_SAMPLES_PER_JOINT * len(names)
        if (count := sum(each.n_samples for each in surveys)) < least:
            raise DataError(
                f'a fit of several recordings needs at least {least} samples, but these have '
                f'{count}; record longer.'
            )
        joint_types = reservoir_data(surveys[0], names).joint_types
        described = described_arm(names, joint_types, settings)
        content = described[0].text if described else ''
        some = [(each.key, each.group) for each in chosen(surveys)]
        key = digest('placements', self._recordings.settings, some, names, settings, content)
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
        gathered = self._recordings.gathered(surveys, around, STATISTICS)
        for moves in (known.geometry, fixed):
            solved = self._solved(surveys, gathered, around, known, moves, contradicting)
            if is_linear(around, solved.solution, some):
                return solved
        found = solved.solution
        around = replace(around, chain=found.chain, links=found.links, friction=found.friction)
        gathered = self._recordings.gathered(surveys, around, ONCE_MORE)
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

    def _results(self, solved: _Solved) -> tuple[RecordingResult, ...]:
        reasons = dict(self._recordings.reasons)
        reasons |= {k: (EXCLUDED, each) for k, each in solved.contradicting.items()}
        rows = {number: row for row, number in enumerate(solved.numbers)}
        results = []
        for number, source in enumerate(self._recordings.sources):
            survey, row = self._recordings.surveys.get(number), rows.get(number)
            status, reason = reasons.get(number, (FITTED, ''))
            known: dict[str, Any] = {name: getattr(survey, name) for name in SURVEYED if survey}
            for name, values in vars(solved.fits).items():
                known[name] = np.full(values.shape[1], np.nan) if row is None else values[row]
            results.append(
                RecordingResult(
                    name=source.name, group=source.group, status=status, reason=reason, **known
                )
            )
        return tuple(results)
