"""Feedback of position and velocity errors: the PD part of computed torque."""

from __future__ import annotations

from dataclasses import dataclass

from lip_id_ros.arrays import Array


@dataclass(frozen=True)
class Gains:
    """
    Diagonals of the feedback's matrices.

    `stiffness`, shape (n,): K_p: torque per position error [N m/rad or N/m]. `damping`, shape
    (n,): K_d: torque per velocity error [N m s/rad or N s/m].

    """

    stiffness: Array
    damping: Array

    def feedback(self, q_error: Array, dq_error: Array) -> Array:
        """Torques [N m or N], shape (n,), against errors of position and velocity."""
        return self.stiffness * q_error + self.damping * dq_error
