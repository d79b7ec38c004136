"""The estimators of this package, as a comparison wants them."""

from __future__ import annotations

from dataclasses import replace

from lip_id_ros.arrays import Array
from lip_id_ros.baselines.interface import Answer
from lip_id_ros.dataset import Dataset
from lip_id_ros.gp import fit
from lip_id_ros.model import TrainedModel
from lip_id_ros.progress import Progress
from lip_id_ros.serving import Predictor
from lip_id_ros.settings import FitSettings


class Ours:
    """
    Energies with polynomial priors, learned through the Euler-Lagrange equations.

    Parameters
    ----------
    kernel : str
        As in `fit.kernel`.

    """

    def __init__(self, kernel: str) -> None:
        self._kernel = kernel

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Trained:
        """Learn as `lip_id fit --kernel` does."""
        return Trained(fit(dataset, replace(settings, kernel=self._kernel), progress))


class Trained:
    """
    A trained model of this package.

    Parameters
    ----------
    model : TrainedModel

    """

    def __init__(self, model: TrainedModel) -> None:
        states = model.states
        self.size = int(states.q.size + states.dq.size + states.ddq.size + model.alpha.size)
        self._predictor = Predictor(model)

    def predict(self, q: Array, dq: Array, ddq: Array) -> Answer:
        """Estimate torques and both energies."""
        found = self._predictor.predict(q, dq, ddq)
        return Answer(found.tau, found.kinetic, found.potential)
