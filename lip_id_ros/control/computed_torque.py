"""Computed torque (paper, eq. `CT_control`): feedforward plus PD."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, TYPE_CHECKING

import numpy as np

from lip_id_ros.arrays import Array

if TYPE_CHECKING:  # numba, which the node starts without
    from lip_id_ros.model import DynamicsModel


class Feedforward(Protocol):
    """Inverse dynamics of one state; q, dq and ddq have shape (n,)."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""


class NoFeedforward:
    """Leave all the work to the feedback."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return zeros."""
        return np.zeros_like(q)


class LearnedFeedforward:
    """Torques of a learned model."""

    def __init__(self, model: DynamicsModel) -> None:
        self._model = model

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""
        return self._model.query(q, dq, ddq).tau


@dataclass(frozen=True)
class Gains:
    """
    Diagonals of the feedback's matrices.

    Attributes
    ----------
    stiffness : ndarray, shape (n,)
        K_p: torque per position error [N m/rad or N/m].
    damping : ndarray, shape (n,)
        K_d: torque per velocity error [N m s/rad or N s/m].

    """

    stiffness: Array
    damping: Array

    def feedback(self, q_error: Array, dq_error: Array) -> Array:
        """Torques [N m or N], shape (n,), against errors of position and velocity."""
        return self.stiffness * q_error + self.damping * dq_error


@dataclass(frozen=True)
class Torques:
    """The two parts of a command, each of shape (n,) [N m or N]."""

    feedforward: Array
    feedback: Array

    @property
    def command(self) -> Array:
        """Their sum."""
        return self.feedforward + self.feedback


class ComputedTorque:
    """Torques that follow a reference."""

    def __init__(self, feedforward: Feedforward, gains: Gains) -> None:
        self._feedforward = feedforward
        self._gains = gains

    def torques(self, reference: tuple[Array, Array, Array], q: Array, dq: Array) -> Torques:
        """
        Compute the command of one control period.

        Parameters
        ----------
        reference : tuple of ndarray, each of shape (n,)
            Positions, velocities and accelerations to follow.
        q, dq : ndarray, shape (n,)
            Measured.

        """
        feedback = self._gains.feedback(reference[0] - q, reference[1] - dq)
        return Torques(self._feedforward.torque(*reference), feedback)
