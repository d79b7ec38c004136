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
UNKNOWN_UNITS = dict.fromkeys(POSITION_UNITS, 'rad or m')
"""Units of positions where the types of the joints are not known."""

MOST_LINES = 2
"""Findings of one kind that are written out; of more, the first is."""

MOST_NAMES = 12
"""Recordings of a group in one sentence, at most."""


class RecordingHealth:
    """
    Examines the raw samples of every recording, as `describe` reads them.

    `recording`: joint types, and the meaning of efforts. `keep_samples`: whether `seen` keeps
    samples and health for plots, which needs all of them in memory.
    """

    def __init__(
        self, recording: RecordingSettings | None = None, keep_samples: bool = False
    ) -> None:
        self._recording = recording
        self._keep_samples = keep_samples
        self.seen: list[tuple[Evidence, dict[str, Any]]] = []

    def __call__(self, samples: JointSamples) -> dict[str, Any]:
        """Examine a recording; returns the addition to its description."""
        evidence = evidence_of(samples, _settings_for(samples, self._recording))
        found = health(evidence)
        if samples.n_samples and self._keep_samples:
            self.seen.append((evidence, found))
        return {'health': found}

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


def _text(name: str, value: float | None) -> str:
    if value is None:
        return '-'
    return f'{100 * value:.3g} %' if name == 'effort_explained' else f'{value:.3g}'


def finding_lines(findings: Iterable[Mapping[str, Any]]) -> list[str]:
    """
    Return a line for each finding, with its recording where it has one.

    Of more than two with one code the first is written out, then the other joints, and recordings.
    """
    kinds: dict[str, list[Mapping[str, Any]]] = {}
    for finding in findings:
        kinds.setdefault(finding['code'], []).append(finding)
    return [line for alike in kinds.values() for line in _alike(alike)]


def _alike(alike: Sequence[Mapping[str, Any]]) -> list[str]:
    texts = [f'{each["severity"]} {each["code"]}: {each["text"]}' for each in alike]
    sources = list(dict.fromkeys(each['source'] for each in alike if 'source' in each))
    if len(texts) <= MOST_LINES:
        where = [f' In {each["source"]}.' if sources else '' for each in alike]
        return [text + place for text, place in zip(texts, where, strict=True)]
    joints = dict.fromkeys(each['joint'] for each in alike)
    others = [joint for joint in joints if joint != alike[0]['joint']]
    more = [f'Likewise {", ".join(others)}.'] if others else []
    if sources:
        more.append(f'In {listed(sources)}.')
    elif len(joints) < len(alike):
        more.append(f'In all recordings: {len(alike)} times.')
    return [' '.join([texts[0], *more])]


def listed(names: Sequence[str]) -> str:
    """Return names in one phrase: the first ones, and how many more there are."""
    more = f' and {len(names) - MOST_NAMES} more' * (len(names) > MOST_NAMES)
    return f'{", ".join(names[:MOST_NAMES])}{more}'
