"""Sources of any kind to one data set: what the command line and the nodes call."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
import os
from pathlib import Path
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.csv_table import CSV_SUFFIX
from lip_id_ros.dataset import concatenate, Dataset, DATASET_SUFFIX
from lip_id_ros.dataset.formats import COPIES
from lip_id_ros.errors import ConfigError, DataError, shortened, SourceError
from lip_id_ros.loading.data_settings import selected_config
from lip_id_ros.preprocessing.description import Assess
from lip_id_ros.preprocessing.pipeline import at_most, preprocess
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples, read_sources
from lip_id_ros.recording.joint_samples import RepeatedSamples
from lip_id_ros.recording.reading import read_log
from lip_id_ros.recording.sketch import content_sketch, SKETCH
from lip_id_ros.settings import AUTO, Config

PathLike = str | os.PathLike[str]

Raw = tuple[JointSamples, Mapping[str, Any]]
"""Samples before preprocessing, and entries for their source in the provenance."""

Part = Dataset | Raw


def load_dataset(
    sources: PathLike | Sequence[PathLike],
    settings: Config | None = None,
    progress: Progress = silent,
    assess: Assess = lambda samples: {},
    training_share: float = 1.0,
) -> Dataset:
    """
    Load bags and data sets and join them, each with segments of its own.

    Samples that an earlier source holds too are left out and noted in the provenance: a copy of a
    recording must not be on both sides of a split.

    `assess`: gets the raw samples of every recording before they are preprocessed; returns more
    entries for its source in the provenance. The other parameters, and the errors, are those of
    `lip_id_ros.loading.examined.load_dataset`.
    """
    settings = Config() if settings is None else settings
    if not isinstance(settings, Config):
        raise ConfigError(
            f'the settings of load_dataset must be a Config, not {type(settings).__name__}; '
            'write Config(recording=..., preprocessing=...), or use read_config.'
        )
    loading = _Loading(_paths(sources), settings, progress, assess)
    parts: Iterable[Part] = loading.parts()
    if settings.preprocessing.cutoff_hz == AUTO:
        parts = list(parts)
        loading.select(_recordings(parts), training_share)
    return loading.joined(parts)


def read_raw(source: PathLike, settings: Config) -> list[JointSamples]:
    """Return the recordings of a source before preprocessing, none of a data set."""
    return _recordings(_Loading([source], settings, silent).parts())


def _recordings(parts: Iterable[Part]) -> list[JointSamples]:
    return [part[0] for part in parts if not isinstance(part, Dataset)]


def _paths(sources: Any) -> list[PathLike]:
    is_one = isinstance(sources, (str, os.PathLike)) or not isinstance(sources, Iterable)
    paths = [sources] if is_one else list(sources)
    for path in paths:
        if not isinstance(path, (str, os.PathLike)):
            raise SourceError(
                f'a source must be a path, not {shortened(path)}; pass one path, or a list.'
            )
    if not paths:
        raise SourceError('at least one recording or data set is needed, but none was named.')
    return paths


class _Loading:
    """Loads sources one after another and leaves out what an earlier one holds already."""

    def __init__(
        self,
        paths: Sequence[PathLike],
        settings: Config,
        progress: Progress,
        assess: Assess = lambda samples: {},
    ) -> None:
        self._paths, self._settings = paths, settings
        self._progress, self._assess = progress, assess
        self._is_alone = len(paths) == 1  # nothing to compare with
        self._seen = RepeatedSamples()
        self._repeating: set[str] = set()
        self._joints: tuple[str, ...] = ()  # to which values per joint belong
        self._report: dict[str, Any] = {}
        self._copies: list[dict[str, Any]] = []

    def parts(self) -> Iterator[Part]:
        """Yield raw samples and data sets in the order of the sources, none of them twice."""
        recording = self._settings.recording
        for is_bag, some in groupby(self._paths, _is_bag):
            if is_bag:
                for samples in read_sources(list(some), recording, self._progress):
                    yield self._raw(samples)
                continue
            for path in some:
                if _is_data_set(path):
                    yield from self._data_set(path)
                else:
                    yield self._raw(read_log(path, recording.joints))

    def _bound(self, joint_names: Sequence[str]) -> tuple[str, ...]:
        """Return the order of joints: that of the settings, else of the first source."""
        if self._settings.recording.joints:
            return self._settings.recording.joints
        self._joints = self._joints or tuple(joint_names)
        return self._joints if set(self._joints) == set(joint_names) else tuple(joint_names)

    def _raw(self, samples: JointSamples) -> Raw:
        samples = samples.with_joints(self._bound(samples.joint_names))
        assessed = self._assess(samples)
        fresh = self._fresh(samples.source, samples.joint_names, samples.position, samples.effort)
        if not fresh.all():
            self._repeating.add(samples.source)
        return samples.select(fresh), assessed

    def select(self, recordings: Sequence[JointSamples], share: float) -> None:
        """Select the preprocessing of all recordings by the first share of them."""
        selected = selected_config(recordings, self._settings, share, self._progress)
        self._settings, self._report = selected

    def joined(self, parts: Iterable[Part]) -> Dataset:
        """Preprocess raw samples and join all parts, of which copies are noted."""
        data = concatenate(list(self._datasets(parts)))
        if self._copies:
            copies = [*data.provenance.get(COPIES, ()), *self._copies]
            data = replace(data, provenance={**data.provenance, COPIES: copies})
        return at_most(data, self._settings.preprocessing)

    def _datasets(self, parts: Iterable[Part]) -> Iterator[Dataset]:
        settings = replace(self._settings.preprocessing, max_samples=0)
        for part in parts:
            if isinstance(part, Dataset):
                yield part
                continue
            samples, assessed = part
            self._progress('preprocessing', 0, 0)
            try:
                data = preprocess(samples, settings, self._settings.recording)
            except DataError:
                if samples.source not in self._repeating:
                    raise
            else:
                yield noted(noted(data, assessed), self._report)

    def _data_set(self, path: PathLike) -> Iterator[Dataset]:
        data, recording = Dataset.load(path), self._settings.recording
        data = data.with_joints(self._bound(data.joint_names))
        defaults = _defaults(data)
        if 'gravity_compensated' in defaults:
            without = data.gravity_compensated or recording.gravity_compensated
            data = replace(data, gravity_compensated=without)
        if recording.joint_types and 'joint_types' in defaults:
            data = replace(data, joint_types=recording.joint_types)
        fresh = self._fresh(os.fspath(path), data.joint_names, data.q, data.tau)
        if fresh.any():
            data = data if fresh.all() else data.select(np.flatnonzero(fresh))
            yield _with_sketch(data, os.fspath(path))

    def _fresh(self, source: str, joint_names: Sequence[str], *signals: Array) -> BoolArray:
        if self._is_alone:
            return np.ones(len(signals[0]), dtype=bool)
        repeated = self._seen.repeated(joint_names, *signals)
        if repeated.any():
            count = int(repeated.sum())
            self._copies.append({'source': source, 'samples': len(repeated), 'repeated': count})
        fresh: BoolArray = ~repeated
        return fresh


def _defaults(data: Dataset) -> Sequence[str]:
    """Return what was not given where the data were read, of what the settings give."""
    first = next(iter(data.provenance.get('sources', ())), None)  # those of arrays are names
    return first.get('defaults', ()) if isinstance(first, Mapping) else ()


def _with_sketch(data: Dataset, path: str) -> Dataset:
    """Add some samples of a data set to those of its first source, to know its copies by."""
    sketch = content_sketch(data.joint_names, data.q, data.tau)
    first, *others = data.provenance.get('sources') or [path]
    first = first if isinstance(first, Mapping) else {'source': first}
    known = first.get(SKETCH, '')
    if not known.endswith(sketch):  # as where a data set was loaded and saved
        first = {**first, SKETCH: known + sketch}
    return replace(data, provenance={**data.provenance, 'sources': [first, *others]})


def noted(data: Dataset, entries: Mapping[str, Any]) -> Dataset:
    """Add entries to each source in the provenance of recordings."""
    if not entries:
        return data
    sources = [{**source, **entries} for source in data.provenance['sources']]
    return replace(data, provenance={**data.provenance, 'sources': sources})


def _is_bag(path: PathLike) -> bool:
    return Path(path).suffix not in (DATASET_SUFFIX, CSV_SUFFIX)


def _is_data_set(path: PathLike) -> bool:
    return Path(path).suffix == DATASET_SUFFIX
