"""What an evaluation asks of a predictor; any object that answers will do."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.serving import Deviation, Prediction, Query

Floats = NDArray[np.float64]


class Estimator(Protocol):
    """Answers many samples; q, dq and ddq have shape (N, n)."""

    def predict(self, q: Floats, dq: Floats, ddq: Floats) -> Prediction:
        """Torques with their parts, and energies."""

    def inertia_matrix(self, q: Floats) -> Floats:
        """Inertia matrices, shape (N, n, n)."""


class Uncertain(Protocol):
    """Knows how sure it is."""

    def standard_deviation(self, q: Floats, dq: Floats, ddq: Floats) -> Deviation:
        """Return standard deviations of torques and energies at N samples."""


class Answering(Protocol):
    """Answers one sample or many, fast."""

    @property
    def training_range(self) -> tuple[Floats, Floats]:
        """Lowest and highest q, dq and ddq of the training data, each of shape (3, n)."""

    def query(self, q: Floats, dq: Floats, ddq: Floats) -> Query:
        """Answer one sample, arrays of shape (n,)."""

    def predict(self, q: Floats, dq: Floats, ddq: Floats) -> Prediction:
        """Answer N samples."""


class Described(Protocol):
    """Says which arm it is for."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints from base to tip."""

    @property
    def joint_types(self) -> tuple[str, ...]:
        """Revolute or prismatic, per joint."""
