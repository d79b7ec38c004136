"""What a comparison asks of a method and of what it learned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.config import FitSettings
from lip_id_ros.dataset import Dataset
from lip_id_ros.progress import Progress

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Answer:
    """
    Estimates at N joint states.

    Attributes
    ----------
    tau : ndarray, shape (N, n)
        Torques [N m or N].
    kinetic, potential : ndarray, shape (N,), or None
        Energies [J], the potential one up to a constant; None where the method has none.

    """

    tau: Floats
    kinetic: Floats | None = None
    potential: Floats | None = None


class Estimator(Protocol):
    """What a method learned."""

    @property
    def size(self) -> int:
        """How many numbers it keeps in order to answer."""

    def predict(self, q: Floats, dq: Floats, ddq: Floats) -> Answer:
        """Estimate torques, and energies where it has them, of motions of shape (N, n)."""


class Method(Protocol):
    """A way to learn inverse dynamics."""

    def fit(self, dataset: Dataset, settings: FitSettings, progress: Progress) -> Estimator:
        """
        Learn from a data set.

        Of the settings, every method heeds `subset`, `max_samples`, `friction` and `seed` as far
        as they mean anything to it.

        Raises
        ------
        DataError
            If the data do not suffice.
        FitError
            If fitting fails for numerical reasons.

        """
