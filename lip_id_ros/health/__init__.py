"""Findings about a recording: defects, with evidence and remedy."""

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.examination import CHECKS, evidence_of, examine, health
from lip_id_ros.health.finding import Check, Finding, Severity

__all__ = [
    'CHECKS',
    'Check',
    'Evidence',
    'Finding',
    'Severity',
    'evidence_of',
    'examine',
    'health',
]
