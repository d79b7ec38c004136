"""From a reference to torques and energies, by joint name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError
from lip_id_ros.signals.trajectories import Point, stack


class Parts(Protocol):
    """The prediction of N samples, each array of shape (N, n) [N m or N]."""

    @property
    def tau(self) -> Array:
        """The sum of the parts."""

    @property
    def inertial(self) -> Array:
        """Of accelerations."""

    @property
    def coriolis(self) -> Array:
        """Of products of velocities."""

    @property
    def gravity(self) -> Array:
        """Of positions."""

    @property
    def friction(self) -> Array:
        """What is not Lagrangian."""


class Query(Protocol):
    """The prediction of one sample."""

    @property
    def tau(self) -> Array:
        """Torques [N m or N], shape (n,)."""

    @property
    def kinetic(self) -> float:
        """Kinetic energy [J]."""

    @property
    def potential(self) -> float:
        """Potential energy [J], nan where it cannot be identified."""

    @property
    def gravity(self) -> Array:
        """The part of tau that is gravity [N m or N], shape (n,)."""


class Estimator(Protocol):
    """The part of `lip_id_ros.serving.Predictor` that is used."""

    def query(self, q: Array, dq: Array, ddq: Array) -> Query:
        """Torques and energies of one sample, arrays of shape (n,)."""

    def predict(self, q: Array, dq: Array, ddq: Array) -> Parts:
        """Torques of N samples, arrays of shape (N, n)."""


@dataclass(frozen=True, eq=False)
class Answer:
    """
    What one reference sample needs.

    Attributes
    ----------
    tau : ndarray, shape (n,)
        Torques [N m or N] in the model's order.
    kinetic, potential : float
        Energies [J]; potential is nan where it cannot be identified.
    gravity : ndarray, shape (n,)
        The part of tau that is gravity [N m or N].
    state : ndarray, shape (3, n)
        Positions, velocities, accelerations in the model's order.

    """

    tau: Array
    kinetic: float
    potential: float
    gravity: Array
    state: Array


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
        return self.at(stack(points, len(names))[:, 0].take(columns, axis=1))

    def at(self, state: Array) -> Answer:
        """Answer one state of shape (3, n), in the model's order, without checks."""
        query = self._predictor.query(*state)
        return Answer(query.tau, query.kinetic, query.potential, query.gravity, state)

    def gravity(self, q: Array) -> Array:
        """Return the torques of gravity [N m or N] at positions of shape (n,)."""
        still = np.zeros_like(q)
        return self._predictor.query(q, still, still).gravity

    def parts(self, state: Array) -> Parts:
        """Return the parts of the torque at one state of shape (3, n)."""
        return self._predictor.predict(*state[:, np.newaxis])

    def plan(self, names: Sequence[str], points: Sequence[Point]) -> tuple[Parts, Array]:
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
        Parts, ndarray
            Torques in the model's order, and the states, shape (3, number of points, n).

        Raises
        ------
        RefusedError
            If it cannot be answered.

        """
        columns = self._order.columns(names)
        if len(columns) != len(names):
            raise RefusedError(Refusal.FOREIGN_JOINT)
        states = stack(points, len(names))[:, :, columns]
        return self._predictor.predict(*states), states

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
