"""How good a model is on a data set: figures, tables and plots."""

from lip_id_ros.evaluation.consistency import with_inertia_check
from lip_id_ros.evaluation.evaluation import evaluate, Evaluation, judged, score
from lip_id_ros.evaluation.outcome import matched, Outcome, run

__all__ = [
    'Evaluation',
    'Outcome',
    'evaluate',
    'judged',
    'matched',
    'run',
    'score',
    'with_inertia_check',
]
