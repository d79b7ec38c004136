"""Two methods that a comparison can be checked with by hand."""

from __future__ import annotations

import numpy as np

from benchmarks.baselines import Baseline
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.model import TorquePrediction
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings


class Scaled:
    """Answers with a multiple of q and an energy, and counts its fits."""

    def __init__(self, factor: float) -> None:
        self.factor = factor
        self.fits = 0

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Baseline:
        self.fits += 1
        progress('a stage', 1, 1)
        return Multiple(dataset, self.factor)


class Multiple(Baseline):
    size = 1

    def __init__(self, dataset: Dataset, factor: float) -> None:
        super().__init__(dataset.joint_names, dataset.joint_types)
        self._factor = factor

    def predict(self, q: Array, dq: Array, ddq: Array) -> TorquePrediction:
        kinetic = self._factor * np.square(dq).sum(axis=1)
        return TorquePrediction(self._factor * q, kinetic, None)


class Refusing:
    """Never has enough data."""

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Baseline:
        raise DataError('more is needed.')
