"""All findings of a recording, and the numbers behind them, as JSON knows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
import math
from typing import Any

import numpy as np

from lip_id_ros.health import effort_checks as effort
from lip_id_ros.health import excitation_checks as excitation
from lip_id_ros.health import signal_checks as signal
from lip_id_ros.health import velocity_checks as velocity
from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.finding import Check, Finding, Severity
from lip_id_ros.preprocessing.cleaning import per_joint, torque
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import RecordingSettings

CHECKS: tuple[Check, ...] = (
    signal.short,
    signal.low_rate,
    signal.jitter,
    signal.gaps,
    signal.dropped,
    signal.stale,
    signal.outliers,
    excitation.far,
    velocity.missing,
    velocity.constant,
    velocity.turned,
    velocity.scaled,
    velocity.unlike,
    velocity.late,
    effort.missing,
    effort.constant,
    effort.clipped,
    effort.turned,
    effort.unrelated,
    effort.late,
    effort.small,
    effort.huge,
    signal.coarse,
    signal.frozen,
    signal.position_frozen,
    excitation.still,
    excitation.little_range,
    excitation.slow,
    excitation.gentle,
    excitation.one_way,
    excitation.together,
    excitation.resting,
    excitation.order,
    excitation.gripper,
)
"""Every kind of finding, in the order of docs/health.md."""

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


def health(evidence: Evidence) -> dict[str, Any]:
    """
    Return findings and figures of a recording.

    Returns
    -------
    dict
        `findings` (code, severity, joint, text), `joints` (figures of each, null where unknown),
        `stale_share`, `effort_lag_s` and `effort_lag_gain`.

    """
    with np.errstate(all='ignore'):
        explanation = evidence.explanation
        return {
            'findings': [finding.to_json() for finding in examine(evidence)],
            'joints': {name: _joint(evidence, joint) for joint, name in enumerate(evidence.names)},
            'stale_share': evidence.stale_share,
            'effort_lag_s': None if explanation is None else _number(explanation.lag_s),
            'effort_lag_gain': None if explanation is None else _number(explanation.lag_gain),
        }


def _joint(evidence: Evidence, joint: int) -> dict[str, Any]:
    figures: dict[str, Any] = {
        'range': evidence.reach[joint],
        'velocity_rms': evidence.speed[joint],
        'acceleration_p99': evidence.acceleration[joint],
    }
    agreement, explanation = evidence.agreement, evidence.explanation
    if agreement is not None:
        figures |= {
            'velocity_scale': agreement.scale[joint],
            'velocity_correlation': agreement.correlation[joint],
            'velocity_lag_s': agreement.lag_s[joint],
        }
    if explanation is not None:
        figures['effort_explained'] = explanation.explained[joint]
    figures |= {f'{signal}_step': quanta[joint] for signal, quanta in evidence.quanta.items()}
    return {name: _number(value) for name, value in figures.items()}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
