"""The numbers behind the findings, as JSON knows them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.examination import examine


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
