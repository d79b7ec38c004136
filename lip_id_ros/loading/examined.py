"""Load recordings as `load` does, and keep what is wrong with them for the cautions of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lip_id_ros.dataset import Dataset
from lip_id_ros.dataset.provenance import FINDINGS, N_NOTES
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
    Load bags and data sets as `lip_id_ros.loading.load.load_dataset` does, and examine recordings.

    Errors and warnings of `lip_id inspect` are in the provenance, and cautions of a fit to the
    data. The other parameters, and the errors, are those of that function.

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
