"""Sources of any kind to one data set: what the command line and the nodes call."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import os
from pathlib import Path

from lip_id_ros.config import Config
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.errors import SourceError
from lip_id_ros.preprocessing.pipeline import preprocess
from lip_id_ros.preprocessing.selection import at_most
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import DATASET_SUFFIX, read_bag

PathLike = str | os.PathLike[str]


def load_dataset(
    sources: PathLike | Sequence[PathLike],
    config: Config | None = None,
    progress: Progress = silent,
) -> Dataset:
    """
    Load bags and data sets and join them, each with segments of its own.

    Parameters
    ----------
    sources : path or sequence of paths
        Bags are preprocessed as `config` says; data sets (.npz) are taken as they are, but for
        the choice of joints and `max_samples`.
    config : Config
        Sections `recording` and `preprocessing` are used.
    progress : callable
        Told how many messages are read.

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
    config = config or Config()
    paths = [sources] if isinstance(sources, (str, os.PathLike)) else list(sources)
    if not paths:
        raise SourceError('at least one recording or data set is needed, but none was named.')
    data = concatenate([_load(path, config, progress) for path in paths])
    return at_most(data, config.preprocessing)


def _load(path: PathLike, config: Config, progress: Progress) -> Dataset:
    if Path(path).suffix == DATASET_SUFFIX:
        data = Dataset.load(path)
        joints = config.recording.joints
        return data.with_joints(joints) if joints else data
    samples = read_bag(path, config.recording, progress)
    progress('preprocessing', 0, 0)
    return preprocess(samples, replace(config.preprocessing, max_samples=0), config.recording)
