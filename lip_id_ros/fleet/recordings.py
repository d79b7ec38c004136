"""What the passes of a fit read of many recordings, and which of them it learns from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
import json
from typing import Any

import numpy as np

from lip_id_ros.checked_file import Packable
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.evaluation import evaluate, Evaluation, matched
from lip_id_ros.evaluation.metrics import merged
from lip_id_ros.fleet.passes import digest, Passes, Source
from lip_id_ros.fleet.results import EXCLUDED, FAILED, HELD_OUT, Survey
from lip_id_ros.fleet.survey import (
    first_shares,
    gathered_from,
    joint_order,
    last_part,
    sorted_of_one_arm,
    survey,
)
from lip_id_ros.identification.folds import new_motion_s
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.total import FOLDS, has_most, RecordingFactors
from lip_id_ros.loading import load_dataset
from lip_id_ros.loading.data_settings import SECTIONS, selected_config
from lip_id_ros.loading.load import read_raw
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.proof import with_held_out
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import AUTO, Config, flatten, override, PreprocessingSettings

Part = tuple[Source, float]
"""A recording, and the first share of its samples that is learned from."""

SURVEY = 'recordings read'
"""Stage of progress of the first pass."""


class Recordings:
    """
    Sources of a fit, of which the first samples are learned from and the others judge it.

    `config`: with what is selected for `cutoff_hz: -1`, once `training` has been called.
    `surveys`: of all recordings that can be read, by number of the source. `reasons`: status and
    reason of those that are not in the fit, likewise. `entries`: how preprocessing was selected,
    for the provenance of the model.
    """

    def __init__(
        self, sources: Sequence[Source], config: Config, passes: Passes, holdout: float
    ) -> None:
        self.sources, self._given, self._passes = sources, config, passes
        self._holdout, self._shares = holdout, dict[int, float]()
        self.config = usual(config)
        self.surveys: dict[int, Survey] = {}
        self.reasons: dict[int, tuple[str, str]] = {}
        self.entries: Mapping[str, Any] = {}

    @property
    def settings(self) -> str:
        """Changes with the settings of passes."""
        config = self.config
        return digest(config.recording, config.preprocessing, config.fit.kernel)

    def training(self) -> dict[int, Survey]:
        """
        Return the surveys of what is learned from, of one arm, in the order of their keys.

        Preprocessing is selected on it alone. DataError if there is none.
        """
        self.surveys = self._surveyed(range(len(self.sources)))
        self._require(self.surveys, 'read')
        surveys = self._to_learn_from(self._of_one_arm(self.surveys))
        if is_automatic(self._given):
            order = joint_order(list(surveys.values()))
            some = [k for k, each in surveys.items() if each.joint_names == order]
            parts = [self._part(k) for k in some[:MOST_RECORDINGS]]
            self.config, self.entries = selected(parts, order, self._given, self._passes)
            surveys = self._once_more(surveys, list(surveys))
        return surveys

    def gathered(
        self, surveys: Mapping[int, Survey], around: Linearisation, stage: str
    ) -> dict[int, RecordingFactors]:
        """Return the statistics of recordings in the order of their keys."""
        numbers = list(surveys)
        some = [self._part(k) for k in numbers]
        counts = np.array([each.n_samples for each in surveys.values()])
        # one of two may fail
        blocks = FOLDS if len(surveys) <= 2 or has_most(counts) else 1
        what = 'statistics', self.settings, linearisation_digest(around), blocks
        keys = [digest(*what, *_content(each)) for each in some]
        function = partial(_factors, around=around, blocks=blocks, config=self.config)
        found, failed = self._passes.run(RecordingFactors, function, some, keys, stage)
        for number in numbers:  # what failed in the pass before may have gone well in this one
            self.reasons.pop(number, None)
        self.reasons |= {numbers[k]: (FAILED, reason) for k, reason in failed.items()}
        self._require(found, 'read twice')
        return {numbers[k]: found[k] for k in sorted(found)}

    def judged(
        self, model: InverseDynamicsModel, known: Dataset
    ) -> tuple[InverseDynamicsModel, Evaluation | None]:
        """
        Return a model with its errors on what is held out in its summary, and those errors.

        `known`: samples that its motion is known by. New motion is that of the part that has most,
        since parts may repeat each other.
        """
        items = [self._part(k) for k in sorted(self._shares) if self._share(k) < 1.0]
        if not items:
            return model, None
        function = partial(_judgement, model=model, known=known, config=self.config)
        outcomes = self._passes.map(function, items, HELD_OUT)
        good = [each.value for each in outcomes if each.value is not None]
        if not good:
            raise DataError(
                'at least one recording that can be read is needed to judge the fit, but there '
                f'is none; the first: {outcomes[0].reason}'
            )
        evaluation = merged([each for each, _ in good])
        new_s = max(new for _, new in good)
        return with_held_out(model, evaluation.nmse_percent, new_s), evaluation

    def _surveyed(self, numbers: Sequence[int]) -> dict[int, Survey]:
        """Return the surveys of those of some recordings that can be read, in their order."""
        items = [self._part(k) for k in numbers]
        keys = [digest('survey', self.settings, *_content(each)) for each in items]
        function = partial(_survey, config=self.config)
        found, failed = self._passes.run(Survey, function, items, keys, SURVEY)
        self.reasons |= {numbers[k]: (FAILED, reason) for k, reason in failed.items()}
        return {
            numbers[k]: replace(found[k], name=source.name, group=source.group)
            for k, (source, _) in enumerate(items)
            if k in found
        }

    def _of_one_arm(self, surveys: Mapping[int, Survey]) -> dict[int, Survey]:
        """Return the surveys of one arm in the order of their keys."""
        numbers = list(surveys)
        kept, left_out = sorted_of_one_arm(list(surveys.values()))
        self.reasons |= {numbers[k]: (EXCLUDED, reason) for k, reason in left_out.items()}
        return {numbers[k]: surveys[numbers[k]] for k in kept}

    def _to_learn_from(self, surveys: dict[int, Survey]) -> dict[int, Survey]:
        """Return the surveys of what is not held out."""
        if self._holdout == 0.0:
            return surveys
        counts = {k: each.n_samples for k, each in surveys.items()}
        self._shares = first_shares(counts, 1.0 - self._holdout)
        unseen = {k for k in surveys if self._share(k) == 0.0}
        self.reasons |= dict.fromkeys(unseen, (HELD_OUT, 'the fit is judged by it'))
        surveys = {k: each for k, each in surveys.items() if k not in unseen}
        return self._once_more(surveys, [k for k in surveys if self._share(k) < 1.0])

    def _once_more(self, surveys: Mapping[int, Survey], numbers: list[int]) -> dict[int, Survey]:
        """Return surveys, some of them made anew, in the order of their keys."""
        again = self._surveyed(numbers) if numbers else {}
        kept = {k: again.get(k, each) for k, each in surveys.items() if k not in self.reasons}
        self._require(kept, 'read')
        return dict(sorted(kept.items(), key=lambda each: each[1].key))

    def _share(self, number: int) -> float:
        return self._shares.get(number, 1.0)

    def _part(self, number: int) -> Part:
        return self.sources[number], self._share(number)

    def _require(self, found: Mapping[int, object], how: str) -> None:
        if not found:
            some = next((reason for _, reason in self.reasons.values()), 'there is none')
            raise DataError(
                f'at least one recording that can be {how} is needed, but '
                f'{len(self.sources)} sources have none; the first: {some}'
            )


def linearisation_digest(around: Linearisation) -> str:
    """Return a text that changes with what statistics are gathered with."""
    chain, noise = around.chain, around.noise
    arrays = *chain, around.links, noise.std, noise.ratio, noise.velocity
    return digest(
        around.joint_names,
        around.friction.to_json(),
        [np.ascontiguousarray(each).tobytes().hex() for each in arrays],
    )


def _content(part: Part) -> tuple[str | float, ...]:
    """Return what changes with the content of a part of a recording."""
    source, share = part
    return (source.fingerprint,) if share == 1.0 else (source.fingerprint, share)


def _survey(part: Part, config: Config) -> Survey:
    source, share = part
    with source.local() as path:
        return survey(path, source.name, source.group, config, share)


def _factors(part: Part, around: Linearisation, blocks: int, config: Config) -> RecordingFactors:
    source, share = part
    with source.local() as path:
        return gathered_from(path, around, blocks, config, share)


def _judgement(
    part: Part, model: InverseDynamicsModel, known: Dataset, config: Config
) -> tuple[Evaluation, float]:
    source, share = part
    with source.local() as path:
        data = matched(last_part(load_dataset(path, config), share), model)
    return evaluate(model, data), new_motion_s(known, data)


MOST_RECORDINGS = 6
"""Recordings that preprocessing is selected on; they are in memory together."""


@dataclass(frozen=True, eq=False)
class SelectedPreprocessing(Packable):
    """Settings by ``section.name``, and entries for the provenance of recordings: both as JSON."""

    KIND = 'preprocessing'
    settings: str
    entries: str


def is_automatic(config: Config) -> bool:
    """Whether cut-off, derivative and delays are to be selected."""
    return config.preprocessing.cutoff_hz == AUTO


def usual(config: Config) -> Config:
    """Return the settings with the usual cut-off for `cutoff_hz: -1`."""
    if not is_automatic(config):
        return config
    cutoff = PreprocessingSettings().cutoff_hz
    return replace(config, preprocessing=replace(config.preprocessing, cutoff_hz=cutoff))


def selected(
    some: Sequence[tuple[Source, float]],
    joint_names: tuple[str, ...],
    config: Config,
    passes: Passes,
) -> tuple[Config, Mapping[str, Any]]:
    """
    Select preprocessing by the first shares of some recordings, whose joints have this order.

    Returns settings with numbers for `cutoff_hz: -1`, and entries for the provenance of
    recordings; raises what `load_dataset` raises with it.
    """
    given = config.recording, config.preprocessing
    key = digest('preprocessing', *given, [(each.fingerprint, share) for each, share in some])
    found = passes.restored(SelectedPreprocessing, key)
    if found is None:
        raw = [part for each, share in some for part in _first(each, share, config)]
        chosen, entries = selected_config(raw, config, 1.0, passes.progress)
        if chosen.recording.effort_delay_s and not chosen.recording.joints:
            # so that they are those of the same joints in recordings of another order
            recording = replace(chosen.recording, joints=joint_names)
            chosen = replace(chosen, recording=recording)
        of_data = {name: x for name, x in flatten(chosen).items() if name.startswith(SECTIONS)}
        found = SelectedPreprocessing(json.dumps(of_data), json.dumps(entries))
        passes.keep(key, found)
    entries = json.loads(found.entries)
    return override(config, json.loads(found.settings), 'the selection'), entries


def _first(source: Source, share: float, config: Config) -> list[JointSamples]:
    with source.local() as path:
        raw = read_raw(path, config)
    return [each.rows(slice(0, round(share * each.n_samples))) for each in raw]
