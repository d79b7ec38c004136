"""Joint friction, which no energy describes, and an arm that has it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.simulation.arm import Dynamics


@dataclass(frozen=True)
class FrictionTorque:
    """
    Viscous and Coulomb friction.

    Attributes
    ----------
    viscous : ndarray, shape (n,)
        Torque per velocity [N m s/rad or N s/m].
    coulomb : ndarray, shape (n,)
        Torque against the direction of motion [N m or N]; none at rest.

    """

    viscous: Array
    coulomb: Array

    def torque(self, dq: Array) -> Array:
        """Torque [N m or N], shape (N, n), that a motion of velocity `dq` (N, n) needs."""
        return self.viscous * dq + self.coulomb * np.sign(dq)


@dataclass(frozen=True)
class SmoothFrictionTorque:
    """
    Viscous and Coulomb friction whose direction turns gradually, as equations of motion need it.

    Attributes
    ----------
    viscous, coulomb : ndarray, shape (n,)
        As in `FrictionTorque`.
    turning : float
        Velocity [rad/s or m/s] at which three quarters of the Coulomb friction act.

    """

    viscous: Array
    coulomb: Array
    turning: float

    def torque(self, dq: Array) -> Array:
        """Torque [N m or N], shape (N, n) or (n,), that a motion of velocity `dq` needs."""
        return self.viscous * dq + self.coulomb * np.tanh(dq / self.turning)


class JointFriction(Protocol):
    """Any friction that depends on velocity."""

    def torque(self, dq: Array) -> Array:
        """Torque [N m or N] that a motion of velocity `dq` needs, of the shape of `dq`."""


class FrictionalArm:
    """
    An arm and the friction in its joints.

    Parameters
    ----------
    arm : Dynamics
        The frictionless arm; its energies stay what they are.
    friction : JointFriction

    """

    def __init__(self, arm: Dynamics, friction: JointFriction) -> None:
        self.arm = arm
        self.friction = friction
        self.joint_names = arm.joint_names
        self.joint_types = arm.joint_types

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (N, n), with friction."""
        return self.arm.inverse_dynamics(q, dq, ddq) + self.friction.torque(dq)

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Kinetic energy [J], shape (N,)."""
        return self.arm.kinetic(q, dq)

    def potential(self, q: Array) -> Array:
        """Potential energy [J], shape (N,)."""
        return self.arm.potential(q)
