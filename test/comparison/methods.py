"""Two methods that a comparison can be checked with by hand."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.baselines import Answer, Estimator
from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings


class Scaled:
    """Answers with a multiple of q and an energy, and counts its fits."""

    def __init__(self, factor: float) -> None:
        self.factor = factor
        self.fits = 0

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Estimator:
        self.fits += 1
        progress('a stage', 1, 1)
        return Multiple(self.factor)


class Multiple:
    def __init__(self, factor: float) -> None:
        self.size = 1
        self._factor = factor

    def predict(self, q: Array, dq: Array, ddq: Array) -> Answer:
        return Answer(self._factor * q, self._factor * np.square(dq).sum(axis=1))


class Refusing:
    """Never has enough data."""

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Estimator:
        raise DataError('more is needed.')
