"""Whether a model's inertia matrix makes physical sense where the model was fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lip_id_ros.evaluation.metrics import not_positive_definite_percent
from lip_id_ros.model import TrainedModel
from lip_id_ros.serving import Predictor


def with_inertia_check(model: TrainedModel) -> TrainedModel:
    """
    Note in a model's summary how far its inertia matrix M(q) is from positive definite.

    Adds `inertia_not_pd_percent`, the share of the model's own samples at which M(q) is not, and
    `inertia_min_eigenvalue`, the smallest eigenvalue at any of them [kg m^2 or kg].

    """
    smallest = np.linalg.eigvalsh(Predictor(model).inertia_matrix(model.states.q))[:, 0]
    check = {
        'inertia_not_pd_percent': not_positive_definite_percent(smallest),
        'inertia_min_eigenvalue': float(smallest.min()),
    }
    return replace(model, summary={**model.summary, **check})
