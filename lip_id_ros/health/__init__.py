"""Is a recording sound: findings, each with what was found and what to do."""

from lip_id_ros.health.evidence import Evidence
from lip_id_ros.health.examination import evidence_of, examine, serious
from lip_id_ros.health.figures import health
from lip_id_ros.health.finding import Check, Finding, Severity
from lip_id_ros.health.table import CHECKS

__all__ = [
    'CHECKS',
    'Check',
    'Evidence',
    'Finding',
    'Severity',
    'evidence_of',
    'examine',
    'health',
    'serious',
]
