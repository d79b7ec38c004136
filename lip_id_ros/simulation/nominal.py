"""Feedforward from a rigid-body model, as a maker's data sheet gives it."""

from __future__ import annotations

from lip_id_ros.arrays import Array
from lip_id_ros.simulation.arm import Dynamics


class NominalFeedforward:
    """
    Torques of a rigid-body model, for `lip_id_ros.control.ComputedTorque`.

    Parameters
    ----------
    arm : Dynamics

    """

    def __init__(self, arm: Dynamics) -> None:
        self._arm = arm

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (n,), that the motion needs."""
        tau: Array = self._arm.inverse_dynamics(q[None], dq[None], ddq[None])[0]
        return tau
