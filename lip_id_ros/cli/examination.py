"""The health of what is read, gathered while it is read."""

from __future__ import annotations

from typing import Any

from lip_id_ros.errors import SourceError
from lip_id_ros.health import Evidence, evidence_of, health
from lip_id_ros.progress import Progress
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings


class Examination:
    """
    Looks at the samples of every recording.

    Parameters
    ----------
    recording : RecordingSettings, optional
        Joint types, and what efforts are.

    Attributes
    ----------
    found : list of dict
        Health of each recording, in the order of reading.

    """

    def __init__(self, recording: RecordingSettings | None = None) -> None:
        self._recording = recording
        self._seen: list[Evidence] = []
        self.found: list[dict[str, Any]] = []

    def __call__(self, samples: JointSamples) -> dict[str, Any]:
        """Examine a recording; returns what is to be added to its description."""
        evidence = evidence_of(samples, self._recording)
        self._seen.append(evidence)
        self.found.append(health(evidence))
        return {'health': self.found[-1]}

    def report(self, folder: str, source: str, progress: Progress) -> None:
        """
        Write plots and one web page of all recordings seen.

        Raises
        ------
        SourceError
            If there is none.
        OSError
            If the folder cannot be written.

        """
        from lip_id_ros.evaluation.report.recording_report import write_recording_report

        pairs = [
            (evidence, health)
            for evidence, health in zip(self._seen, self.found, strict=True)
            if evidence.samples.n_samples
        ]
        if not pairs:
            raise SourceError(
                f'{source} must be a recording with joint samples to be drawn, but has none; '
                'leave --report out, or evaluate a model with it.'
            )
        write_recording_report(folder, source, pairs, progress)
