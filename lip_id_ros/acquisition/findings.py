"""What is suspicious in the recordings of a job."""

from __future__ import annotations

from typing import Any

from lip_id_ros.evaluation.health_text import notable
from lip_id_ros.health import evidence_of, health
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings


class Findings:
    """
    Looks at the raw samples of every recording.

    Parameters
    ----------
    recording : RecordingSettings
        Joint types, and what efforts are.

    """

    def __init__(self, recording: RecordingSettings) -> None:
        self._recording = recording
        self._found: list[dict[str, Any]] = []

    def __call__(self, samples: JointSamples) -> None:
        """Examine a recording."""
        self._found.append(health(evidence_of(samples, self._recording)))

    @property
    def sentences(self) -> list[str]:
        """A line for each kind of finding; notes only by their number."""
        return notable(self._found)
