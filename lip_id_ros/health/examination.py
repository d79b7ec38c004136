"""Examine a recording: findings of all checks, and the figures behind them, as JSON."""

from __future__ import annotations

from dataclasses import replace
import math
from typing import Any

import numpy as np

from lip_id_ros.health import (
    effort_checks,
    excitation_checks,
    signal_checks,
    velocity_checks,
)
from lip_id_ros.health.evidence import Evidence, Joint
from lip_id_ros.health.finding import Check, Finding, Severity
from lip_id_ros.joint_types import is_prismatic, REVOLUTE
from lip_id_ros.preprocessing.continuity import unwrapped
from lip_id_ros.preprocessing.segment import per_joint, torque
from lip_id_ros.preprocessing.smoothing import longest_step
from lip_id_ros.recording import JointSamples
from lip_id_ros.settings import PreprocessingSettings, RecordingSettings

CHECKS: tuple[Check, ...] = tuple(
    each
    for module in (signal_checks, velocity_checks, effort_checks, excitation_checks)
    for each in vars(module).values()
    if isinstance(each, Check)
)
"""Every kind of finding, in the order of health.md."""

_ORDER = tuple(severity.value for severity in Severity)


def evidence_of(samples: JointSamples, recording: RecordingSettings | None = None) -> Evidence:
    """
    Prepare a recording for the checks: joint types, efforts scaled, whole turns undone.

    ConfigError if a setting per joint has another length than there are joints.
    """
    recording = recording or RecordingSettings()
    kinds = per_joint(samples, 'joint_types', recording.joint_types, REVOLUTE)
    if samples.has_effort:
        samples = replace(samples, effort=torque(samples, recording))
    longest_s = longest_step(samples.t, PreprocessingSettings().cutoff)
    return Evidence(unwrapped(samples, ~is_prismatic(kinds), longest_s), kinds)


def examine(evidence: Evidence) -> tuple[Finding, ...]:
    """Return everything that the checks find, what matters most first."""
    with np.errstate(all='ignore'):  # what is not a number fails every comparison
        found = [finding for check in CHECKS for finding in check.findings(evidence)]
    return tuple(sorted(found, key=lambda finding: _ORDER.index(finding.severity)))


def health(evidence: Evidence) -> dict[str, Any]:
    """Return findings (code, severity, joint, text) and figures of a recording and its joints."""
    with np.errstate(all='ignore'):
        lags = evidence.lags
        return {
            'findings': [finding.to_json() for finding in examine(evidence)],
            'joints': {joint.name: _figures(joint) for joint in evidence.joints},
            'stale_share': evidence.stale_share,
            'effort_lag_s': None if lags is None else _number(lags.lag_s),
            'effort_lag_gain': None if lags is None else _number(lags.gain),
        }


def _figures(joint: Joint) -> dict[str, float | None]:
    figures = {
        'range': joint.reach,
        'velocity_rms': joint.speed,
        'acceleration_p99': joint.acceleration,
        'velocity_scale': joint.velocity_scale,
        'velocity_correlation': joint.velocity_correlation,
        'velocity_lag_s': joint.velocity_lag_s,
        'effort_explained': joint.effort_explained,
    }
    figures |= {f'{name}_step': signal.step for name, signal in joint.signals.items()}
    return {name: _number(value) for name, value in figures.items()}


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
