"""Sources of any kind to one data set: what the command line and the nodes call."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby
import os
from pathlib import Path

from lip_id_ros.csv_table import CSV_SUFFIX, has_accelerations
from lip_id_ros.dataset import concatenate, Dataset, DATASET_SUFFIX
from lip_id_ros.errors import SourceError
from lip_id_ros.preprocessing.pipeline import preprocess
from lip_id_ros.preprocessing.selection import at_most
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples, read_sources
from lip_id_ros.recording.csv_log import read_log
from lip_id_ros.settings import Config

PathLike = str | os.PathLike[str]
Watch = Callable[[JointSamples], object]


def load_dataset(
    sources: PathLike | Sequence[PathLike],
    settings: Config | None = None,
    progress: Progress = silent,
    watch: Watch = lambda samples: None,
) -> Dataset:
    """
    Load bags and data sets and join them, each with segments of its own.

    Parameters
    ----------
    sources : path or sequence of paths
        Bags and CSV logs are preprocessed as the settings say; data sets (.npz, or .csv with
        accelerations) are taken as they are, but for the choice of joints and `max_samples`.
    settings : Config
        Sections `recording` and `preprocessing` are used.
    progress : callable
        Told how many messages are read.
    watch : callable
        Shown the raw samples of every recording before they are preprocessed.

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
    data = concatenate(list(_loaded(paths, settings, progress, watch)))
    return at_most(data, settings.preprocessing)


def _loaded(
    paths: Sequence[PathLike], settings: Config, progress: Progress, watch: Watch
) -> Iterator[Dataset]:
    """Yield data sets in the order of the sources; bags side by side may give one together."""
    for is_bag, some in groupby(paths, _is_bag):
        if not is_bag:
            yield from (_of_file(path, settings, progress, watch) for path in some)
            continue
        for samples in read_sources(list(some), settings.recording, progress):
            yield _prepared(samples, settings, progress, watch)


def _is_bag(path: PathLike) -> bool:
    return Path(path).suffix not in (DATASET_SUFFIX, CSV_SUFFIX)


def _of_file(path: PathLike, settings: Config, progress: Progress, watch: Watch) -> Dataset:
    if Path(path).suffix == DATASET_SUFFIX:
        return _with_joints(Dataset.load(path), settings)
    if has_accelerations(path):
        return _with_types(_with_joints(Dataset.load(path), settings), settings)
    return _prepared(read_log(path, settings.recording.joints), settings, progress, watch)


def _prepared(
    samples: JointSamples, settings: Config, progress: Progress, watch: Watch
) -> Dataset:
    watch(samples)
    progress('preprocessing', 0, 0)
    return preprocess(samples, replace(settings.preprocessing, max_samples=0), settings.recording)


def _with_joints(data: Dataset, settings: Config) -> Dataset:
    joints = settings.recording.joints
    return data.with_joints(joints) if joints else data


def _with_types(data: Dataset, settings: Config) -> Dataset:
    kinds = settings.recording.joint_types or data.joint_types
    compensated = settings.recording.gravity_compensated
    return replace(data, joint_types=kinds, gravity_compensated=compensated)
