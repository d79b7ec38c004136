"""What an evaluation asks of a predictor; any object that answers will do."""

from __future__ import annotations

from typing import Protocol

from lip_id_ros.arrays import Array
from lip_id_ros.model import Prediction, Query, StandardDeviation


class Estimator(Protocol):
    """Answers many samples; q, dq and ddq have shape (N, n)."""

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        """Torques with their parts, and energies."""

    def inertia_matrix(self, q: Array) -> Array:
        """Inertia matrices, shape (N, n, n)."""


class Uncertain(Protocol):
    """Knows how sure it is."""

    def standard_deviation(self, q: Array, dq: Array, ddq: Array) -> StandardDeviation:
        """Return standard deviations of torques and energies at N samples."""


class Answering(Protocol):
    """Answers one sample or many, fast."""

    @property
    def training_range(self) -> tuple[Array, Array]:
        """Lowest and highest q, dq and ddq of the training data, each of shape (3, n)."""

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        """Answer one sample, arrays of shape (n,)."""

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        """Answer N samples."""


class Described(Protocol):
    """Says which arm it is for."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints from base to tip."""

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Revolute or prismatic, per joint."""
