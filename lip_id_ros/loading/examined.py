"""Load recordings as `load` does, and keep what is wrong with them for the cautions of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lip_id_ros.dataset import Dataset
from lip_id_ros.health import evidence_of, examine, Severity
from lip_id_ros.loading import load
from lip_id_ros.loading.load import PathLike, Watch
from lip_id_ros.progress import Progress, silent
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import Config

FINDINGS = 'findings'
"""Provenance: errors and warnings of `lip_id_ros.health`, as JSON."""

SHORT = 'short'


def load_dataset(
    sources: PathLike | Sequence[PathLike],
    settings: Config | None = None,
    progress: Progress = silent,
    watch: Watch = lambda samples: None,
    training_share: float = 1.0,
) -> Dataset:
    """
    Load bags and data sets as `lip_id_ros.loading.load.load_dataset` does, and examine recordings.

    Errors and warnings of `lip_id inspect` are in the provenance, and cautions of a fit to the
    data. The other parameters, and the errors, are those of that function.

    """
    found: list[dict[str, str]] = []
    count = 0

    def examined(samples: JointSamples) -> None:
        nonlocal count
        count += 1
        watch(samples)
        recording = settings.recording if isinstance(settings, Config) else None
        findings = examine(evidence_of(samples, recording))
        found.extend(each.to_json() for each in findings if each.severity != Severity.NOTE)

    data = load.load_dataset(sources, settings, progress, examined, training_share)
    serious = [each for each in found if count == 1 or each['code'] != SHORT]
    if not serious:
        return data
    return replace(data, provenance={**data.provenance, FINDINGS: serious})
