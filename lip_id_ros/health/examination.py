"""All findings of a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import Finding, Severity
from lip_id_ros.health.table import CHECKS
from lip_id_ros.preprocessing.cleaning import per_joint, torque
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings

_ORDER = tuple(severity.value for severity in Severity)


def evidence_of(samples: JointSamples, recording: RecordingSettings | None = None) -> Evidence:
    """
    Prepare a recording for the checks.

    Parameters
    ----------
    samples : JointSamples
    recording : RecordingSettings, optional
        Joint types, and scale and offset of the efforts.

    Raises
    ------
    ConfigError
        If a setting per joint has another length than there are joints.

    """
    recording = recording or RecordingSettings()
    kinds = per_joint(samples, 'joint_types', recording.joint_types, 'revolute')
    if samples.has_effort:
        samples = replace(samples, effort=torque(samples, recording))
    return Evidence(samples, kinds)


def examine(evidence: Evidence) -> tuple[Finding, ...]:
    """Return everything that the checks find, what matters most first."""
    with np.errstate(all='ignore'):  # what is not a number fails every comparison
        found = [finding for check in CHECKS for finding in check.findings(evidence)]
    return tuple(sorted(found, key=lambda finding: _ORDER.index(finding.severity)))


def serious(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings that are more than notes."""
    return [finding for finding in findings if finding.severity != Severity.NOTE]
