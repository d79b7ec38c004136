"""What a comparison asks of a method and of what it learned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.progress import Progress
from lip_id_ros.settings import FitSettings


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

    tau: Array
    kinetic: Array | None = None
    potential: Array | None = None


class Estimator(Protocol):
    """What a method learned."""

    @property
    def size(self) -> int:
        """How many numbers it keeps in order to answer."""

    def predict(self, q: Array, dq: Array, ddq: Array) -> Answer:
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
