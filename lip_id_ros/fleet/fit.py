"""A fit to a fleet of recordings: survey, placements, statistics, solution (docs/maths.md, 14)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
import hashlib
import json
import time
from typing import Any, Protocol, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError, DataError
from lip_id_ros.fleet.assembling import model_of
from lip_id_ros.fleet.placements import chosen, contradictions, place, PlacedArm
from lip_id_ros.fleet.recording_statistics import Regression, statistics_of_source
from lip_id_ros.fleet.results import (
    EXCLUDED,
    FAILED,
    FITTED,
    FleetResult,
    Packable,
    RecordingResult,
    RecordingStatistics,
    Survey,
)
from lip_id_ros.fleet.solution import Sizes, Solution, solve
from lip_id_ros.fleet.sums import FleetStatistics
from lip_id_ros.fleet.survey import sorted_of_one_arm, survey
from lip_id_ros.friction.model import FrictionBasis
from lip_id_ros.friction.terms import LoadCoulomb, LoadViscous
from lip_id_ros.identification.arm_fit import ArmFitter, Described
from lip_id_ros.identification.fitting import described_arm
from lip_id_ros.identification.identify import LEAST_SAMPLES_PER_JOINT
from lip_id_ros.identification.link_torques import links_torque
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.progress import Progress, silent
from lip_id_ros.settings import Config

SURVEY, STATISTICS = 'recordings read', 'statistics of recordings'
"""Stages of progress, one per pass."""

EXCLUSIONS = 3
"""Most repetitions of the solution while recordings are found to contradict the fleet."""

LOAD_CHANGE = 0.01
"""Change of the loads, as a share of them, from which statistics are gathered once more."""

Kept = TypeVar('Kept', bound=Packable)


class Source(Protocol):
    """A recording somewhere; picklable."""

    @property
    def name(self) -> str:
        """Address, as people know it."""

    @property
    def group(self) -> str:
        """Robot."""

    @property
    def fingerprint(self) -> str:
        """Text that changes with the content, for the cache; need not be that of the samples."""

    def local(self) -> AbstractContextManager[str]:
        """Give the path of a local copy while the context lasts."""


class Outcome(Protocol):
    """What came of one item: a value, or the reason why there is none."""

    @property
    def value(self) -> Any:
        """Result of the function; None where it failed."""

    @property
    def reason(self) -> str:
        """Why it failed; empty where it did not."""


class Engine(Protocol):
    """Runs a function for each of many items."""

    def map(
        self,
        function: Callable[[Any], Any],
        items: Sequence[Any],
        progress: Progress,
        keep: Callable[[int, Any], None],
    ) -> Sequence[Outcome]:
        """
        Return the outcomes in the order of the items.

        `keep` is called in this process with the number of an item and its value as soon as it
        has one.

        """


class Cache(Protocol):
    """Keeps named arrays under a key."""

    def get(self, key: str) -> Mapping[str, Any] | None:
        """Return the arrays of a key; None where there are none."""

    def put(self, key: str, arrays: Mapping[str, Any]) -> None:
        """Keep arrays; whole or not at all."""


class NoCache:
    """Keeps nothing."""

    def get(self, key: str) -> Mapping[str, Any] | None:
        """Return None."""

    def put(self, key: str, arrays: Mapping[str, Any]) -> None:
        """Keep nothing."""


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
        return _Fit(sources, config, engine, cache or NoCache(), progress).result()


@dataclass(frozen=True, eq=False)
class _Share:
    """What a recording has of a solution."""

    residual_rms: Array
    friction: Array
    friction_std: Array


class _Fit:
    """One fit of a fleet, pass by pass."""

    def __init__(
        self,
        sources: Sequence[Source],
        config: Config,
        engine: Engine,
        cache: Cache,
        progress: Progress,
    ) -> None:
        self._sources, self._config = sources, config
        self._engine, self._cache, self._progress = engine, cache, progress
        self._reasons: dict[int, tuple[str, str]] = {}
        self._shares: dict[str, _Share] = {}
        self._settings = _digest(config.recording, config.preprocessing, config.fit.kernel)

    def result(self) -> FleetResult:
        """Run both passes, solve and report."""
        started = time.monotonic()
        surveys = self._surveyed()
        placed, described = self._placed(list(surveys.values()))
        sizes = placed.sizes(ArmFitter(placed.dataset, described))
        self._exclude(surveys, dict(placed.excluded))
        regression = placed.regression
        solution, kept = self._solved(surveys, regression, sizes)
        if self._loads_changed(placed, solution):
            friction = replace(regression.friction, coefficients=solution.friction)
            regression = replace(regression, links=solution.links, friction=friction)
            solution, kept = self._solved(surveys, regression, sizes)
        model = model_of(placed, solution, kept, described)
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
        numbers = range(len(self._sources))
        keys = [_digest('survey', self._settings, each.fingerprint) for each in self._sources]
        function = partial(_survey, config=self._config)
        found = self._mapped(Survey, function, list(self._sources), keys, numbers, SURVEY)
        named = {
            k: replace(each, name=self._sources[k].name, group=self._sources[k].group)
            for k, each in found.items()
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
        settings, names = self._config.fit, surveys[0].joint_names
        least = LEAST_SAMPLES_PER_JOINT * len(names)
        if (count := sum(each.n_samples for each in surveys)) < least:
            raise DataError(
                f'a fit of a fleet needs at least {least} samples, but its recordings have '
                f'{count}; record longer.'
            )
        described = described_arm(names, surveys[0].joint_types, settings)
        content = described[0].fingerprint if described else ''
        some = [(each.key, each.group) for each in chosen(surveys)]
        key = _digest('placements', self._settings, some, names, settings, content)
        if (placed := self._restored(PlacedArm, key)) is None:
            placed = place(surveys, settings, described, self._progress)
            self._cache.put(key, placed.to_arrays())
        return placed, described

    def _solved(
        self, surveys: dict[int, Survey], regression: Regression, sizes: Sizes
    ) -> tuple[Solution, list[Survey]]:
        """Gather statistics, and solve without the recordings that contradict the fleet."""
        statistics = self._gathered(surveys, regression)
        for _ in range(EXCLUSIONS):
            kept = [surveys[k] for k in statistics if k not in self._reasons]
            some = [each for k, each in statistics.items() if k not in self._reasons]
            if not kept:
                raise DataError(
                    'at least one recording that agrees with the others was expected, but there '
                    'is none; fit the recordings of one robot alone.'
                )
            groups = [each.group for each in kept]
            solution = solve(FleetStatistics(regression, some, groups), sizes)
            self._share(kept, solution)
            reasons = contradictions(solution.residual_rms, regression.joint_names)
            if not reasons:
                break
            self._exclude(surveys, {kept[k].key: reason for k, reason in reasons.items()})
        return solution, kept

    def _gathered(
        self, surveys: dict[int, Survey], regression: Regression
    ) -> dict[int, RecordingStatistics]:
        """Return the statistics of recordings in the order of their keys."""
        numbers = list(surveys)
        what = 'statistics', self._settings, regression_digest(regression)
        keys = [_digest(*what, self._sources[k].fingerprint) for k in numbers]
        items = [(self._sources[k], surveys[k].key) for k in numbers]
        function = partial(_statistics, regression=regression, config=self._config)
        found = self._mapped(RecordingStatistics, function, items, keys, numbers, STATISTICS)
        return {k: found[k] for k in numbers if k in found}

    def _mapped(
        self,
        kind: type[Kept],
        function: Callable[[Any], Kept],
        items: Sequence[Any],
        keys: Sequence[str],
        numbers: Sequence[int],
        stage: str,
    ) -> dict[int, Kept]:
        """Return results by number, those that the cache has not from the engine."""
        found = {
            number: each
            for number, key in zip(numbers, keys, strict=True)
            if (each := self._restored(kind, key)) is not None
        }
        rest = [k for k, number in enumerate(numbers) if number not in found]

        def keep(k: int, value: Kept) -> None:
            self._cache.put(keys[rest[k]], value.to_arrays())

        def progress(_: str, done: int, total: int) -> None:
            self._progress(stage, done, total)

        outcomes = self._engine.map(function, [items[k] for k in rest], progress, keep)
        for k, outcome in zip(rest, outcomes, strict=True):
            if outcome.value is None:
                self._reasons[numbers[k]] = FAILED, outcome.reason
            else:
                found[numbers[k]] = outcome.value
        return found

    def _restored(self, kind: type[Kept], key: str) -> Kept | None:
        arrays = self._cache.get(key)
        try:
            return None if arrays is None else kind.from_arrays(arrays)
        except DataError:  # damaged: it is made anew
            return None

    def _exclude(self, surveys: Mapping[int, Survey], reasons: Mapping[str, str]) -> None:
        for number, each in surveys.items():
            if each.key in reasons:
                self._reasons[number] = EXCLUDED, reasons[each.key]

    def _share(self, kept: Sequence[Survey], solution: Solution) -> None:
        for k, each in enumerate(kept):
            self._shares[each.key] = _Share(
                solution.residual_rms[k],
                solution.recording_friction[k],
                solution.recording_friction_std[k],
            )

    @staticmethod
    def _loads_changed(placed: PlacedArm, solution: Solution) -> bool:
        regression, data = placed.regression, placed.dataset
        terms = regression.friction.basis.terms
        if not any(isinstance(each.term, LoadCoulomb | LoadViscous) for each in terms):
            return False
        before = links_torque(regression.chain, regression.links, data)
        after = links_torque(regression.chain, solution.links, data)
        size = np.sqrt(np.mean(before**2, axis=0))
        change = np.sqrt(np.mean((after - before) ** 2, axis=0))
        return bool(np.any(change > LOAD_CHANGE * size))

    def _recordings(
        self, surveys: Mapping[int, Survey], n_joints: int, n_friction: int
    ) -> tuple[RecordingResult, ...]:
        nothing = _Share(*(np.full(size, np.nan) for size in (n_joints, n_friction, n_friction)))
        results = []
        for number, source in enumerate(self._sources):
            each = self._every.get(number)
            status, reason = self._reasons.get(number, (FITTED, ''))
            share = (
                self._shares.get(surveys[number].key, nothing) if number in surveys else nothing
            )
            results.append(
                RecordingResult(
                    key=each.key if each else '',
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
                    **vars(share),
                )
            )
        return tuple(results)


def friction_names(basis: FrictionBasis, joint_names: Sequence[str]) -> tuple[str, ...]:
    """Return a name for each coefficient: joints, term and, of several, the number."""
    names = []
    for part in basis.terms:
        joints = ', '.join(joint_names[joint] for joint in part.drive.joints)
        for number in range(part.size):
            ending = f' {number + 1}' if part.size > 1 else ''
            names.append(f'{joints}: {part.term.name}{ending}')
    return tuple(names)


def regression_digest(regression: Regression) -> str:
    """Return a text that changes with what statistics are gathered with."""
    chain, noise = regression.chain, regression.noise
    arrays = *chain, regression.links, noise.std, noise.ratio, noise.velocity
    return _digest(
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


def _digest(*values: Any) -> str:
    text = json.dumps(values, sort_keys=True, default=vars)
    return hashlib.sha256(text.encode()).hexdigest()
