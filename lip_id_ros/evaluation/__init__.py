"""The quality of a model on a data set: figures, tables, plots and cautions."""

from lip_id_ros.evaluation.cautions import (
    data_remarks,
    evaluation_cautions,
    fit_cautions,
)
from lip_id_ros.evaluation.metrics import evaluate, Evaluation, score
from lip_id_ros.evaluation.prediction import matched, Outcome, run

__all__ = [
    'Evaluation',
    'Outcome',
    'data_remarks',
    'evaluate',
    'evaluation_cautions',
    'fit_cautions',
    'matched',
    'run',
    'score',
]
