"""Load recordings as `load` does, and keep what is wrong with them for the cautions of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lip_id_ros.dataset import Dataset
from lip_id_ros.dataset.formats import FINDINGS, N_NOTES
from lip_id_ros.health import evidence_of, examine, Severity
from lip_id_ros.loading import load
from lip_id_ros.loading.load import PathLike
from lip_id_ros.preprocessing.description import Assess
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import Config, RecordingSettings


def load_dataset(
    sources: PathLike | Sequence[PathLike],
    settings: Config | None = None,
    progress: Progress = silent,
    training_share: float = 1.0,
) -> Dataset:
    """
    Load bags and data sets and join them, each with segments of its own, and examine recordings.

    Errors and warnings of `lip_id inspect` are in the provenance, and cautions of a fit to the
    data. Samples that an earlier source holds too are left out and noted there as well: a copy of
    a recording must not be on both sides of a split.

    Parameters
    ----------
    sources : path or sequence of paths
        Bags and CSV logs are preprocessed by the settings; data sets (.npz) are taken as they are,
        but for the choice of joints and `max_samples`.
    settings : Config
        Sections `recording` and `preprocessing` are used. With `cutoff_hz: -1` all recordings
        are read before the first is preprocessed.
    progress : callable
        Called with the number of messages read.
    training_share : float
        First share of the recordings that `cutoff_hz: -1` may look at; the rest is held out.

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
    recording = settings.recording if isinstance(settings, Config) else None
    return load.load_dataset(sources, settings, progress, findings_of(recording), training_share)


def findings_of(recording: RecordingSettings | None) -> Assess:
    """Return a function from raw samples to the findings about them, for the provenance."""

    def assessed(samples: JointSamples) -> dict[str, Any]:
        found = examine(evidence_of(samples, recording))
        serious = [each.to_json() for each in found if each.severity != Severity.NOTE]
        entries = {FINDINGS: serious, N_NOTES: len(found) - len(serious)}
        return {name: value for name, value in entries.items() if value}

    return assessed
