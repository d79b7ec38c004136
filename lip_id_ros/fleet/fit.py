"""A fit to a fleet of recordings: survey, placements, statistics, solution (docs/maths.md, 14)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
import time

import numpy as np
from threadpoolctl import threadpool_limits

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.fleet.assembling import model_of, with_processes
from lip_id_ros.fleet.engines import Engine
from lip_id_ros.fleet.passes import Cache, digest, Passes, Source
from lip_id_ros.fleet.placements import chosen, contradictions, place, PlacedArm
from lip_id_ros.fleet.recording_statistics import Regression, statistics_of_source
from lip_id_ros.fleet.results import (
    EXCLUDED,
    FAILED,
    FITTED,
    FleetResult,
    RecordingResult,
    RecordingStatistics,
    Survey,
)
from lip_id_ros.fleet.solution import fitted_alone, Sizes, Solution, solutions
from lip_id_ros.fleet.sums import FleetStatistics
from lip_id_ros.fleet.survey import joint_order, reservoir_data, sorted_of_one_arm, survey
from lip_id_ros.friction.model import FrictionBasis
from lip_id_ros.identification.arm_fit import ArmFitter, Described
from lip_id_ros.identification.fitting import described_arm
from lip_id_ros.identification.identify import LEAST_SAMPLES_PER_JOINT
from lip_id_ros.identification.link_torques import links_torque
from lip_id_ros.identification.sample_selection import evenly
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import Config

SURVEY, STATISTICS = 'recordings read', 'statistics of recordings'
ONCE_MORE = 'statistics, new loads'
"""Stages of progress, one per pass."""

EXCLUSIONS = 5
"""Most starts of the solution while recordings are found to contradict the fleet."""

LOAD_CHANGE, LOAD_SAMPLES = 0.01, 1000
"""
Change of the loads, as a share of them, from which statistics are gathered once more, and the
samples that it is measured with.
"""


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
            f'a fleet is fitted with fit.kernel {ARTICULATED}, not {config.fit.kernel}; leave '
            'the kernel out, or fit single recordings.'
        )
    with threadpool_limits(1):
        return _Fit(
            sources, config, Passes(engine, {} if cache is None else cache, progress)
        ).result()


class _Fit:
    """One fit of a fleet, pass by pass."""

    def __init__(self, sources: Sequence[Source], config: Config, passes: Passes) -> None:
        self._sources, self._config, self._passes = sources, config, passes
        self._reasons: dict[int, tuple[str, str]] = {}
        self._shares: dict[str, dict[str, Array]] = {}
        self._contradicting: dict[str, str] = {}
        self._settings = digest(config.recording, config.preprocessing, config.fit.kernel)

    def result(self) -> FleetResult:
        """Run both passes, solve and report."""
        started = time.monotonic()
        surveys = self._surveyed()
        placed, described = self._placed(list(surveys.values()))
        fitter = ArmFitter(placed.dataset, described)
        sizes = placed.sizes(fitter)
        self._contradicting = dict(placed.excluded)
        regression = placed.regression
        solution, kept = self._solved(surveys, regression, sizes, STATISTICS)
        if self._loads_changed(placed, solution):
            friction = replace(regression.friction, coefficients=solution.friction)
            regression = replace(regression, links=solution.links, friction=friction)
            solution, kept = self._solved(surveys, regression, sizes, ONCE_MORE)
        model = model_of(placed, solution, kept, fitter, described)
        seconds = round(time.monotonic() - started, 3)
        basis = regression.friction.basis
        return FleetResult(
            model=replace(model, summary={**model.summary, 'seconds_total': seconds}),
            recordings=self._recordings(surveys, model.n_joints, basis.size),
            friction_names=friction_names(basis, placed.joint_names),
            deviation_of_recordings=solution.deviations.recordings,
            deviation_of_groups=solution.deviations.groups,
        )

    def _surveyed(self) -> dict[int, Survey]:
        """Return the surveys of all recordings that can be used, by number of the source."""
        keys = [digest('survey', self._settings, each.fingerprint) for each in self._sources]
        function = partial(_survey, config=self._config)
        found, failed = self._passes.run(Survey, function, self._sources, keys, SURVEY)
        self._reasons |= {k: (FAILED, reason) for k, reason in failed.items()}
        named = {
            k: replace(each, name=self._sources[k].name, group=self._sources[k].group)
            for k, each in sorted(found.items())
        }
        self._every = named
        if not named:
            some = next(iter(self._reasons.values()))[1] if self._reasons else 'there is none'
            raise DataError(
                f'at least one recording that can be read is needed, but {len(self._sources)} '
                f'sources have none; the first: {some}'
            )
        kept, left_out = sorted_of_one_arm(list(named.values()))
        order = list(named)
        self._reasons |= {order[k]: (EXCLUDED, reason) for k, reason in left_out.items()}
        number_of = {id(each): k for k, each in named.items()}
        return {number_of[id(each)]: each for each in kept}

    def _placed(self, surveys: list[Survey]) -> tuple[PlacedArm, Described | None]:
        settings, names = self._config.fit, joint_order(surveys)
        least = LEAST_SAMPLES_PER_JOINT * len(names)
        if (count := sum(each.n_samples for each in surveys)) < least:
            raise DataError(
                f'a fit of a fleet needs at least {least} samples, but its recordings have '
                f'{count}; record longer.'
            )
        joint_types = reservoir_data(surveys[0], names).joint_types
        described = described_arm(names, joint_types, settings)
        content = described[0].fingerprint if described else ''
        some = [(each.key, each.group) for each in chosen(surveys)]
        key = digest('placements', self._settings, some, names, settings, content)
        if (placed := self._passes.restored(PlacedArm, key)) is None:
            placed, solution = place(surveys, names, settings, described, self._passes.progress)
            placed = with_processes(placed, solution, surveys, described)
            self._passes.keep(key, placed)
        return placed, described

    def _solved(
        self, surveys: dict[int, Survey], regression: Regression, sizes: Sizes, stage: str
    ) -> tuple[Solution, list[Survey]]:
        """Gather statistics, and solve without the recordings that contradict the fleet."""
        gathered = self._gathered(surveys, regression, stage)
        if not gathered:
            raise DataError(
                'at least one recording that can be read twice was expected, but there is none; '
                f'the first: {next(iter(self._reasons.values()))[1]}'
            )
        every = [surveys[k] for k in gathered]
        groups = [each.group for each in every]
        statistics = FleetStatistics(regression, list(gathered.values()), groups)
        kept = np.array([each.key not in self._contradicting for each in every])
        for left in reversed(range(EXCLUSIONS)):
            solved, others = statistics.select(kept), statistics.select(~kept)
            for solution in solutions(solved, sizes):
                fits = solution.recordings.among(kept, fitted_alone(others, solution))
                reasons = contradictions(fits.residual_rms, kept, regression.joint_names)
                now = np.array([k not in reasons for k in range(len(every))])
                if left and not np.array_equal(now, kept):
                    break  # the later rounds would be of the wrong recordings
            else:
                break
            kept = now
        self._contradicting = {every[k].key: reason for k, reason in reasons.items()}
        self._shares = {
            each.key: {name: values[k] for name, values in vars(fits).items()}
            for k, each in enumerate(every)
        }
        return solution, [each for each, is_kept in zip(every, kept, strict=True) if is_kept]

    def _gathered(
        self, surveys: dict[int, Survey], regression: Regression, stage: str
    ) -> dict[int, RecordingStatistics]:
        """Return the statistics of recordings in the order of their keys."""
        numbers = list(surveys)
        what = 'statistics', self._settings, regression_digest(regression)
        keys = [digest(*what, self._sources[k].fingerprint) for k in numbers]
        items = [(self._sources[k], surveys[k].key) for k in numbers]
        function = partial(_statistics, regression=regression, config=self._config)
        found, failed = self._passes.run(RecordingStatistics, function, items, keys, stage)
        self._reasons |= {numbers[k]: (FAILED, reason) for k, reason in failed.items()}
        return {number: found[k] for k, number in enumerate(numbers) if k in found}

    @staticmethod
    def _loads_changed(placed: PlacedArm, solution: Solution) -> bool:
        regression = placed.regression
        if not regression.friction.basis.is_loaded.any():
            return False
        data = placed.dataset.select(evenly(placed.dataset.n_samples, LOAD_SAMPLES))
        before = links_torque(regression.chain, regression.links, data)
        after = links_torque(regression.chain, solution.links, data)
        size = np.sqrt(np.mean(before**2, axis=0))
        change = np.sqrt(np.mean((after - before) ** 2, axis=0))
        return bool(np.any(change > LOAD_CHANGE * size))

    def _recordings(
        self, surveys: Mapping[int, Survey], n_joints: int, n_friction: int
    ) -> tuple[RecordingResult, ...]:
        sizes = {'residual_rms': n_joints, 'friction': n_friction, 'friction_std': n_friction}
        results = []
        for number, source in enumerate(self._sources):
            each = self._every.get(number)
            key = each.key if each else ''
            share = self._shares.get(key) if number in surveys else None
            contradiction = self._contradicting.get(key)
            default = (EXCLUDED, contradiction) if contradiction else (FITTED, '')
            status, reason = self._reasons.get(number, default)
            results.append(
                RecordingResult(
                    key=key,
                    name=source.name,
                    group=source.group,
                    status=status,
                    reason=reason,
                    n_samples=each.n_samples if each else 0,
                    rate_hz=each.rate_hz if each else np.nan,
                    seconds=each.seconds if each else np.nan,
                    start_s=each.start_s if each else np.nan,
                    temperature=each.temperature if each else np.nan,
                    health=each.health if each else (),
                    **(share or {name: np.full(size, np.nan) for name, size in sizes.items()}),
                )
            )
        return tuple(results)


def friction_names(basis: FrictionBasis, joint_names: Sequence[str]) -> tuple[str, ...]:
    """Return a name for each coefficient: joints, term and, of several, the number."""
    names = []
    for part in basis.terms:
        acted_on = [joint_names[joint] for joint, _ in part.drive.efforts]
        others = [name for k in part.drive.joints if (name := joint_names[k]) not in acted_on]
        coupled = f' coupled with {", ".join(others)}' if others else ''
        for number in range(part.size):
            ending = f' {number + 1}' if part.size > 1 else ''
            names.append(f'{", ".join(acted_on)}: {part.term.name}{coupled}{ending}')
    return tuple(names)


def regression_digest(regression: Regression) -> str:
    """Return a text that changes with what statistics are gathered with."""
    chain, noise = regression.chain, regression.noise
    arrays = *chain, regression.links, noise.std, noise.ratio, noise.velocity
    return digest(
        regression.joint_names,
        regression.friction.to_json(),
        [np.ascontiguousarray(each).tobytes().hex() for each in arrays],
    )


def _survey(source: Source, config: Config) -> Survey:
    with source.local() as path:
        return survey(path, source.name, source.group, config)


def _statistics(
    item: tuple[Source, str], regression: Regression, config: Config
) -> RecordingStatistics:
    source, key = item
    with source.local() as path:
        return statistics_of_source(path, key, regression, config)
