"""Judge a model by samples that were held out of its fit, and note it in the model."""

from __future__ import annotations

from lip_id_ros.dataset import Dataset
from lip_id_ros.evaluation.metrics import evaluate, Evaluation, matched
from lip_id_ros.identification.folds import new_motion_s
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.model.proof import with_held_out
from lip_id_ros.progress import Progress, silent


def judged(
    model: InverseDynamicsModel, training: Dataset, held_out: Dataset, progress: Progress = silent
) -> tuple[InverseDynamicsModel, Evaluation]:
    """Return the model with its errors on held-out samples in the summary, and those errors."""
    evaluation = evaluate(model, held_out, progress)
    new_s = new_motion_s(matched(training, model), matched(held_out, model))
    return with_held_out(model, evaluation.nmse_percent, new_s), evaluation
