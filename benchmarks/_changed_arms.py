"""Copies of simulated arms that are not quite the right ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.simulation import SimulatedArm
from lip_id_ros.simulation.arm import Dynamics


@dataclass(frozen=True)
class JointFriction:
    """
    Viscous [N m s/rad or N s/m] and Coulomb friction [N m or N], none at rest; shapes (n,).

    Over velocities of `sign_width` [rad/s or m/s] the sign changes, as equations of motion need
    it; 0 for a jump.
    """

    viscous: Array
    coulomb: Array
    sign_width: float = 0.0

    def torque(self, dq: Array) -> Array:
        """Torque [N m or N], shape (N, n) or (n,), that a motion of velocity `dq` needs."""
        sign = np.tanh(dq / self.sign_width) if self.sign_width > 0.0 else np.sign(dq)
        return np.asarray(self.viscous * dq + self.coulomb * sign)


class FrictionalArm:
    """An arm and the friction in its joints; its energies stay what they are."""

    def __init__(self, arm: Dynamics, friction: JointFriction) -> None:
        self.joint_names, self.joint_types = arm.joint_names, arm.joint_types
        self.kinetic, self.potential = arm.kinetic, arm.potential
        self._arm, self._friction = arm, friction

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m or N], shape (N, n), with friction."""
        return self._arm.inverse_dynamics(q, dq, ddq) + self._friction.torque(dq)


def with_wrong_masses(
    arm: SimulatedArm, mass_share: float, centre_shift: float, rng: np.random.Generator
) -> SimulatedArm:
    """
    Copy an arm with other bodies: what a poor data sheet would give.

    Each mass, and its inertia with it, changes by a share drawn uniformly from [-mass_share,
    mass_share], each coordinate of a centre of mass by a distance from [-centre_shift,
    centre_shift] [m].
    """
    import pinocchio

    def spoil(model: Any) -> None:
        for joint in range(1, model.njoints):
            body = model.inertias[joint]
            factor = 1.0 + rng.uniform(-mass_share, mass_share)
            centre = body.lever + rng.uniform(-centre_shift, centre_shift, 3)
            model.inertias[joint] = pinocchio.Inertia(
                factor * body.mass, centre, factor * body.inertia
            )

    return arm.changed(spoil)


def with_payload(arm: SimulatedArm, mass: float, at: Array) -> SimulatedArm:
    """Copy an arm with a point mass [kg] on the last body, at a place in its frame (3,) [m]."""
    import pinocchio

    def load(model: Any) -> None:
        body = pinocchio.Inertia(mass, np.asarray(at, np.float64), np.zeros((3, 3)))
        model.inertias[model.njoints - 1] += body

    return arm.changed(load)


def with_gravity(arm: SimulatedArm, gravity: Array) -> SimulatedArm:
    """Copy an arm in another field of gravity (3,) [m/s^2], as on a base that is tilted."""

    def turn(model: Any) -> None:
        model.gravity.linear = np.array(gravity, dtype=np.float64)

    return arm.changed(turn)
