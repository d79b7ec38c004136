"""Sources of any kind to one data set: what the command line and the nodes call."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
import os
from pathlib import Path
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.csv_table import CSV_SUFFIX, has_accelerations
from lip_id_ros.dataset import concatenate, Dataset, DATASET_SUFFIX
from lip_id_ros.errors import DataError, SourceError
from lip_id_ros.preprocessing.cleaning import RepeatedSamples
from lip_id_ros.preprocessing.pipeline import preprocess
from lip_id_ros.preprocessing.selection import at_most
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples, read_sources
from lip_id_ros.recording.reading import read_log
from lip_id_ros.settings import Config

PathLike = str | os.PathLike[str]
Watch = Callable[[JointSamples], object]

COPIES = 'copies'
"""Provenance: source, samples and repeated samples where an earlier source has them too."""


def load_dataset(
    sources: PathLike | Sequence[PathLike],
    settings: Config | None = None,
    progress: Progress = silent,
    watch: Watch = lambda samples: None,
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
        Sections `recording` and `preprocessing` are used.
    progress : callable
        Called with the number of messages read.
    watch : callable
        Called with the raw samples of every recording before they are preprocessed.

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
    settings = settings or Config()
    paths = [sources] if isinstance(sources, (str, os.PathLike)) else list(sources)
    if not paths:
        raise SourceError('at least one recording or data set is needed, but none was named.')
    loading = _Loading(settings, progress, watch, is_alone=len(paths) == 1)
    data = concatenate(list(loading.datasets(paths)))
    if loading.copies:
        data = replace(data, provenance={**data.provenance, COPIES: loading.copies})
    return at_most(data, settings.preprocessing)


class _Loading:
    """Loads sources one after another and leaves out what an earlier one holds already."""

    def __init__(
        self, settings: Config, progress: Progress, watch: Watch, *, is_alone: bool
    ) -> None:
        self._settings, self._progress, self._watch = settings, progress, watch
        self._is_alone = is_alone  # nothing to compare with
        self._seen = RepeatedSamples()
        self.copies: list[dict[str, Any]] = []

    def datasets(self, paths: Sequence[PathLike]) -> Iterator[Dataset]:
        """Yield data sets in the order of the sources; bags side by side may give one together."""
        recording = self._settings.recording
        for is_bag, some in groupby(paths, _is_bag):
            if is_bag:
                for samples in read_sources(list(some), recording, self._progress):
                    yield from self._prepared(samples)
                continue
            for path in some:
                if _is_data_set(path):
                    yield from self._data_set(path)
                else:
                    yield from self._prepared(read_log(path, recording.joints))

    def _prepared(self, samples: JointSamples) -> Iterator[Dataset]:
        self._watch(samples)
        self._progress('preprocessing', 0, 0)
        signals = samples.position, samples.effort
        fresh = self._fresh(samples.source, samples.joint_names, *signals)
        settings = replace(self._settings.preprocessing, max_samples=0)
        try:
            yield preprocess(samples.select(fresh), settings, self._settings.recording)
        except DataError:
            if fresh.all():
                raise

    def _data_set(self, path: PathLike) -> Iterator[Dataset]:
        data, recording = Dataset.load(path), self._settings.recording
        if recording.joints:
            data = data.with_joints(recording.joints)
        if Path(path).suffix == CSV_SUFFIX:  # which holds neither
            data = replace(
                data,
                joint_types=recording.joint_types or data.joint_types,
                gravity_compensated=recording.gravity_compensated,
            )
        fresh = self._fresh(os.fspath(path), data.joint_names, data.q, data.tau)
        if fresh.any():
            yield data if fresh.all() else data.select(np.flatnonzero(fresh))

    def _fresh(self, source: str, joint_names: Sequence[str], *signals: Array) -> BoolArray:
        if self._is_alone:
            return np.ones(len(signals[0]), dtype=bool)
        repeated = self._seen.repeated(joint_names, *signals)
        if repeated.any():
            count = int(repeated.sum())
            self.copies.append({'source': source, 'samples': len(repeated), 'repeated': count})
        fresh: BoolArray = ~repeated
        return fresh


def _is_bag(path: PathLike) -> bool:
    return Path(path).suffix not in (DATASET_SUFFIX, CSV_SUFFIX)


def _is_data_set(path: PathLike) -> bool:
    return Path(path).suffix == DATASET_SUFFIX or has_accelerations(path)
