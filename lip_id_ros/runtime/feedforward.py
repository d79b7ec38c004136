"""From a reference to torques and energies, by joint name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.runtime.references import JointOrder, Point, Reason, RefusedError, stack

Array = NDArray[np.float64]


class Torques(Protocol):
    """What a prediction must give."""

    @property
    def tau(self) -> Array:
        """Torques [N m or N], shape (n,) or (N, n)."""


class TorquesAndEnergies(Torques, Protocol):
    """What the prediction of one sample must give."""

    @property
    def kinetic(self) -> float:
        """Kinetic energy [J]."""

    @property
    def potential(self) -> float:
        """Potential energy [J], nan where it cannot be identified."""


class Estimator(Protocol):
    """The part of `lip_id_ros.serving.Predictor` that is used."""

    def query(self, q: Array, dq: Array, ddq: Array) -> TorquesAndEnergies:
        """Torques and energies of one sample, arrays of shape (n,)."""

    def predict(self, q: Array, dq: Array, ddq: Array) -> Torques:
        """Torques of N samples, arrays of shape (N, n)."""


@dataclass(frozen=True)
class Answer:
    """
    What one reference sample needs.

    Attributes
    ----------
    tau : ndarray, shape (n,)
        Torques [N m or N] in the model's order.
    kinetic, potential : float
        Energies [J]; potential is nan where it cannot be identified.

    """

    tau: Array
    kinetic: float
    potential: float


class Feedforward:
    """
    Answer reference samples and plans with one model.

    Parameters
    ----------
    predictor : Estimator
        Of the model.
    joint_names : sequence of str
        The model's joints.

    """

    def __init__(self, predictor: Estimator, joint_names: Sequence[str]) -> None:
        self._predictor = predictor
        self._order = JointOrder(joint_names)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The model's joints, base to tip."""
        return self._order.joint_names

    def sample(self, names: Sequence[str], points: Sequence[Point]) -> Answer:
        """
        Answer one reference sample; joints that the model does not know are left out.

        Parameters
        ----------
        names : sequence of str
            Joints of the message.
        points : sequence of Point
            Its one point.

        Raises
        ------
        RefusedError
            If it cannot be answered.

        """
        columns = self._order.columns(names)
        q, dq, ddq = stack(points, len(names))[:, 0].take(columns, axis=1)
        query = self._predictor.query(q, dq, ddq)
        return Answer(query.tau, query.kinetic, query.potential)

    def plan(self, names: Sequence[str], points: Sequence[Point]) -> Array:
        """
        Answer a plan, which must move the model's joints and no others.

        Parameters
        ----------
        names : sequence of str
            Joints of the message.
        points : sequence of Point
            Its points.

        Returns
        -------
        ndarray, shape (number of points, n)
            Torques [N m or N] in the model's order.

        Raises
        ------
        RefusedError
            If it cannot be answered.

        """
        columns = self._order.columns(names)
        if len(columns) != len(names):
            raise RefusedError(Reason.FOREIGN_JOINT)
        q, dq, ddq = stack(points, len(names))[:, :, columns]
        return self._predictor.predict(q, dq, ddq).tau

    def in_message_order(self, names: Sequence[str], tau: Array) -> Array:
        """
        Bring torques of an answered plan into the order of its message.

        Parameters
        ----------
        names : sequence of str
            Joints of the message.
        tau : ndarray, shape (N, n)
            Torques in the model's order.

        """
        ordered = np.empty_like(tau)
        ordered[:, self._order.columns(names)] = tau
        return ordered
