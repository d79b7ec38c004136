"""Health of recordings: examined while they are read, shown as tables and lines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from lip_id_ros.evaluation.tables import Table
from lip_id_ros.health import Evidence, evidence_of, health
from lip_id_ros.joint_types import POSITION_UNITS, REVOLUTE
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings

COLUMNS = {
    'velocity_rms': 'RMS velocity',
    'acceleration_p99': 'acceleration, 99 %',
    'velocity_scale': 'dq / differentiated q',
    'effort_explained': 'effort explained',
}
TITLE = 'Motion [rad or m, s], and how much of each effort a regression on it explains'
MOST_LINES = 2
UNKNOWN_UNITS = dict.fromkeys(POSITION_UNITS, 'rad or m')
"""Units of positions where the types of the joints are not known."""
SHORT = 'short'
ENOUGH_S = 60.0
"""Length of all recordings together from which the length of each one is no concern [s]."""


class RecordingHealth:
    """
    Examines the raw samples of every recording, as `load_dataset` reads them.

    Parameters
    ----------
    recording : RecordingSettings, optional
        Joint types, and the meaning of efforts.
    keep_samples : bool
        Whether the samples are plotted later, which needs all of them in memory.

    Attributes
    ----------
    found : list of dict
        Health of each recording, in the order of reading.
    seen : list of (Evidence, dict)
        Samples and health of each recording, where they are kept.

    """

    def __init__(
        self, recording: RecordingSettings | None = None, keep_samples: bool = False
    ) -> None:
        self._recording = recording
        self._keep_samples = keep_samples
        self.seen: list[tuple[Evidence, dict[str, Any]]] = []
        self._seconds = 0.0
        self.found: list[dict[str, Any]] = []

    def __call__(self, samples: JointSamples) -> dict[str, Any]:
        """Examine a recording; returns the addition to its description."""
        evidence = evidence_of(samples, _settings_for(samples, self._recording))
        self.found.append(health(evidence))
        if samples.n_samples:
            self._seconds += float(samples.t[-1] - samples.t[0])
            if self._keep_samples:
                self.seen.append((evidence, self.found[-1]))
        return {'health': self.found[-1]}

    @property
    def lines(self) -> list[str]:
        """A line for each kind of warning and error, and the number of the notes."""
        findings = [finding for each in self.found for finding in each['findings']]
        if len(self.found) > 1 and self._seconds >= ENOUGH_S:
            findings = [finding for finding in findings if finding['code'] != SHORT]
        return serious_lines(findings)

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of the positions for each joint type."""
        known = self._recording is not None and bool(self._recording.joint_types)
        return POSITION_UNITS if known else UNKNOWN_UNITS

    @property
    def are_torques(self) -> bool:
        """Whether efforts are known to be torques, by a scale of the settings."""
        return self._recording is not None and bool(self._recording.effort_scale)


def _settings_for(
    samples: JointSamples, recording: RecordingSettings | None
) -> RecordingSettings | None:
    """Return the settings for all recorded joints, from those for the joints that they name."""
    if recording is None or recording.joints in ((), samples.joint_names):
        return recording
    defaults = {'joint_types': REVOLUTE, 'effort_scale': 1.0, 'effort_offset': 0.0}
    per_joint = {
        name: dict(zip(recording.joints, getattr(recording, name), strict=False))
        for name in defaults
    }
    values: dict[str, Any] = {
        name: tuple(given.get(joint, defaults[name]) for joint in samples.joint_names)
        for name, given in per_joint.items()
    }
    return replace(recording, joints=samples.joint_names, **values)


def health_table(joints: Mapping[str, Mapping[str, float | None]]) -> Table:
    """Return the figures of each joint, as `lip_id_ros.health.health` gives them."""
    some = {name for each in joints.values() for name, x in each.items() if x is not None}
    known = [name for name in COLUMNS if name in some]
    rows = [
        (joint, *(_text(name, figures.get(name)) for name in known))
        for joint, figures in joints.items()
    ]
    return Table(TITLE, ('', *(COLUMNS[name] for name in known)), rows)


def finding_lines(findings: Iterable[Mapping[str, Any]]) -> list[str]:
    """
    Return a line for each finding.

    Where more than two have one code, only the first is written out, followed by the other joints,
    and by the number of findings where some are on the same joint, in several recordings.

    """
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for finding in findings:
        kinds.setdefault(finding['code'], []).append(finding)
    return [line for alike in kinds.values() for line in _lines(alike)]


def serious_lines(findings: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a line for each kind of warning and error, and the number of the notes."""
    n_notes = sum(finding['severity'] == 'note' for finding in findings)
    texts = finding_lines(finding for finding in findings if finding['severity'] != 'note')
    if n_notes:
        how = 'see them with lip_id inspect of the recording.'
        texts.append(f'Notes not shown here: {n_notes}; {how}')
    return texts


def _lines(alike: Sequence[Mapping[str, Any]]) -> list[str]:
    texts = [f'{each["severity"]} {each["code"]}: {each["text"]}' for each in alike]
    if len(texts) <= MOST_LINES:
        return texts
    joints = dict.fromkeys(each['joint'] for each in alike)
    others = [joint for joint in joints if joint != alike[0]['joint']]
    more = [f'Likewise {", ".join(others)}.'] if others else []
    if len(joints) < len(alike):
        more.append(f'In all recordings: {len(alike)} times.')
    return [' '.join([texts[0], *more])]


def _text(name: str, value: float | None) -> str:
    if value is None:
        return '-'
    return f'{100 * value:.3g} %' if name == 'effort_explained' else f'{value:.3g}'
