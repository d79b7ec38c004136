"""Sources of any kind to one data set: what the command line and the nodes call."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
import os
from pathlib import Path
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.csv_table import CSV_SUFFIX, has_accelerations
from lip_id_ros.dataset import concatenate, Dataset, DATASET_SUFFIX
from lip_id_ros.dataset.provenance import COPIES, ELECTED
from lip_id_ros.errors import ConfigError, DataError, shortened, SourceError
from lip_id_ros.loading.election import elect_preprocessing
from lip_id_ros.preprocessing.description import Assess
from lip_id_ros.preprocessing.pipeline import at_most, preprocess
from lip_id_ros.preprocessing.smoothing import longest_step
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples, read_sources
from lip_id_ros.recording.joint_samples import RepeatedSamples
from lip_id_ros.recording.reading import read_log
from lip_id_ros.recording.sketch import content_sketch, SKETCH
from lip_id_ros.recording.timing import gap_starts
from lip_id_ros.settings import AUTO, Config, override, PreprocessingSettings

PathLike = str | os.PathLike[str]

ROUNDING = 1e-6
"""Of sums of times [s]."""

Part = Dataset | JointSamples


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

    Parameters
    ----------
    sources : path or sequence of paths
        Bags and CSV logs are preprocessed by the settings; data sets (.npz, or .csv with
        accelerations) are taken as they are, but for the choice of joints and `max_samples`.
    settings : Config
        Sections `recording` and `preprocessing` are used. With `cutoff_hz: auto` all recordings
        are read before the first is preprocessed.
    progress : callable
        Called with the number of messages read.
    assess : callable
        Gets the raw samples of every recording before they are preprocessed; returns more entries
        for its source in the provenance.
    training_share : float
        First share of the recordings that `cutoff_hz: auto` may look at; the rest is held out.

    Raises
    ------
    SourceError
        If a source is no recording or holds no usable joint samples, or there is none.
    ConfigError
        If a setting does not fit the joints.
    DataError
        If a source is damaged or too short, or they have different joints.
    OSError
        If a source does not exist or cannot be opened.

    """
    settings = Config() if settings is None else settings
    if not isinstance(settings, Config):
        raise ConfigError(
            f'the settings of load_dataset must be a Config, not {type(settings).__name__}; '
            'write Config(recording=..., preprocessing=...), or use read_config.'
        )
    paths = _paths(sources)
    if not paths:
        raise SourceError('at least one recording or data set is needed, but none was named.')
    loading = _Loading(settings, progress, assess, is_alone=len(paths) == 1)
    parts: Iterable[Part] = loading.parts(paths)
    if settings.preprocessing.cutoff_hz == AUTO:
        parts = list(parts)
        recordings = [part for part in parts if isinstance(part, JointSamples)]
        settings = loading.elect(recordings, training_share)
    data = concatenate(list(loading.datasets(parts)))
    if loading.copies:
        copies = [*data.provenance.get(COPIES, ()), *loading.copies]
        data = replace(data, provenance={**data.provenance, COPIES: copies})
    return at_most(data, settings.preprocessing)


def _paths(sources: Any) -> list[PathLike]:
    is_one = isinstance(sources, (str, os.PathLike)) or not isinstance(sources, Iterable)
    paths = [sources] if is_one else list(sources)
    for path in paths:
        if not isinstance(path, (str, os.PathLike)):
            raise SourceError(
                f'a source must be a path, not {shortened(path)}; pass one path, or a list.'
            )
    return paths


class _Loading:
    """Loads sources one after another and leaves out what an earlier one holds already."""

    def __init__(
        self, settings: Config, progress: Progress, assess: Assess, *, is_alone: bool
    ) -> None:
        self._settings, self._progress, self._assess = settings, progress, assess
        self._assessed = deque[Mapping[str, Any]]()  # of raw samples, until they are preprocessed
        self._is_alone = is_alone  # nothing to compare with
        self._seen = RepeatedSamples()
        self._repeating: set[str] = set()
        self._joints: tuple[str, ...] = ()  # to which values per joint belong
        self._report: dict[str, Any] = {}
        self.copies: list[dict[str, Any]] = []

    def parts(self, paths: Sequence[PathLike]) -> Iterator[Part]:
        """Yield raw samples and data sets in the order of the sources, none of them twice."""
        recording = self._settings.recording
        for is_bag, some in groupby(paths, _is_bag):
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

    def _raw(self, samples: JointSamples) -> JointSamples:
        samples = samples.with_joints(self._bound(samples.joint_names))
        self._assessed.append(self._assess(samples))
        fresh = self._fresh(samples.source, samples.joint_names, samples.position, samples.effort)
        if not fresh.all():
            self._repeating.add(samples.source)
        return samples.select(fresh)

    def elect(self, recordings: Sequence[JointSamples], share: float) -> Config:
        """Elect the preprocessing of all recordings by the first share of them."""
        elected = elected_config(recordings, self._settings, share, self._progress)
        self._settings, self._report = elected
        return self._settings

    def datasets(self, parts: Iterable[Part]) -> Iterator[Dataset]:
        """Preprocess raw samples; bags side by side may give one data set together."""
        settings = replace(self._settings.preprocessing, max_samples=0)
        for part in parts:
            if isinstance(part, Dataset):
                yield part
                continue
            self._progress('preprocessing', 0, 0)
            assessed = self._assessed.popleft()
            try:
                data = preprocess(part, settings, self._settings.recording)
            except DataError:
                if part.source not in self._repeating:
                    raise
            else:
                yield noted(noted(data, assessed), self._report)

    def _data_set(self, path: PathLike) -> Iterator[Dataset]:
        data, recording = Dataset.load(path), self._settings.recording
        data = data.with_joints(self._bound(data.joint_names))
        defaults = _defaults(data)
        if Path(path).suffix == CSV_SUFFIX or 'gravity_compensated' in defaults:
            without = data.gravity_compensated or recording.gravity_compensated
            data = replace(data, gravity_compensated=without)
        if Path(path).suffix == CSV_SUFFIX or 'joint_types' in defaults:
            data = _with_types(data, recording.joint_types)
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
            self.copies.append({'source': source, 'samples': len(repeated), 'repeated': count})
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


def _with_types(data: Dataset, joint_types: Sequence[str]) -> Dataset:
    """Give joints the types of the settings, where there are any."""
    return replace(data, joint_types=tuple(joint_types)) if joint_types else data


def elected_config(
    recordings: Sequence[JointSamples],
    config: Config,
    training_share: float,
    progress: Progress = silent,
) -> tuple[Config, dict[str, Any]]:
    """
    Elect the preprocessing of recordings by the first share of them.

    Returns settings with numbers in the place of `auto`, and an entry for sources' provenance.

    LipIdError: see `lip_id_ros.loading.election.elect_preprocessing`.

    """
    longest = config.preprocessing.max_gap_s
    some = _first_share(recordings, training_share, longest)
    elected = elect_preprocessing(some, config.preprocessing, config.recording, progress)
    changed = replace(config, preprocessing=elected.preprocessing, recording=elected.recording)
    return changed, {ELECTED: elected.report}


def noted(data: Dataset, entries: Mapping[str, Any]) -> Dataset:
    """Add entries to each source in the provenance of recordings."""
    if not entries:
        return data
    sources = [{**source, **entries} for source in data.provenance['sources']]
    return replace(data, provenance={**data.provenance, 'sources': sources})


def with_elected(config: Config, provenance: Mapping[str, Any]) -> Config:
    """
    Put the settings elected for training data, or a model, in the place of `cutoff_hz: auto`.

    ConfigError if none of its sources was preprocessed.

    """
    if config.preprocessing.cutoff_hz != AUTO:
        return config
    for source in provenance.get('sources', ()):
        if 'preprocessing' in source and 'recording' in source:
            names = ('cutoff_hz', 'derivative')
            chosen = {f'preprocessing.{name}': source['preprocessing'][name] for name in names}
            chosen['recording.effort_delay_s'] = source['recording'].get('effort_delay_s', ())
            return override(config, chosen, 'the settings of the training data')
    raise ConfigError(
        'preprocessing.cutoff_hz: auto needs the settings of the training data, which were no '
        'recordings; give the cut-off as a number.'
    )


def _first_share(
    recordings: Sequence[JointSamples], share: float, longest_s: float = 0.0
) -> list[JointSamples]:
    """Return the first share of all recorded time, of which gaps are none."""
    elapsed = [_elapsed(samples.t, longest_s) for samples in recordings]
    rest = share * sum(float(each[-1]) for each in elapsed)
    first = []
    for samples, each in zip(recordings, elapsed, strict=True):
        if rest > 0.0:
            first.append(samples.rows(slice(0, int(np.searchsorted(each, rest + ROUNDING)))))
        rest -= float(each[-1])
    return first


def _elapsed(t: Array, longest_s: float) -> Array:
    """Return the recorded time up to each sample, shape (N,) [s]."""
    if t.size < 2:
        return np.zeros(t.size or 1)
    steps = np.diff(t, prepend=t[0])
    usual = PreprocessingSettings().cutoff
    steps[gap_starts(t, longest_s or longest_step(t, usual)) + 1] = 0.0
    return np.cumsum(steps)


def _is_bag(path: PathLike) -> bool:
    return Path(path).suffix not in (DATASET_SUFFIX, CSV_SUFFIX)


def _is_data_set(path: PathLike) -> bool:
    return Path(path).suffix == DATASET_SUFFIX or has_accelerations(path)
