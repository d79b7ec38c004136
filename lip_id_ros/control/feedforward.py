"""Where the torques of a reference come from."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.model import Query


class Feedforward(Protocol):
    """Inverse dynamics of one state; q, dq and ddq have shape (n,)."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""


class Answering(Protocol):
    """A model that answers one state, such as a `Predictor`."""

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        """Answer one state, arrays of shape (n,)."""


class NoFeedforward:
    """Leave all the work to the feedback."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return zeros."""
        return np.zeros_like(q)


class LearnedFeedforward:
    """
    Torques of a learned model.

    Parameters
    ----------
    model : Answering
        Such as a `Predictor`.

    """

    def __init__(self, model: Answering) -> None:
        self._model = model

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""
        return self._model.query(q, dq, ddq).tau
