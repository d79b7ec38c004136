"""Simulated arms: of random links, with friction, and copies that are not quite the right ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, scale_of
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.simulation import SimulatedArm
from lip_id_ros.simulation.arm import Dynamics

WIDTH = 0.05
"""Of a sign of friction [rad/s]."""


@dataclass(frozen=True, eq=False)
class RandomArm:
    """Rigid links (n, 11) in random places."""

    chain: Chain
    links: Array

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the torques of the links, shape (N, n) [N m]."""
        return np.asarray(torque_regressor(self.chain, q, dq, ddq) @ self.links.ravel())


def random_arm(n_joints: int, seed: int) -> RandomArm:
    """Draw links of about 2 kg and 0.2 m."""
    rng = np.random.default_rng(seed)
    chain = Chain(
        Rotation.random(n_joints, random_state=rng).as_matrix(),
        0.25 * rng.standard_normal((n_joints, 3)),
        np.zeros(n_joints, dtype=bool),
        np.array([0.0, 0.0, -9.81]),
    )
    numbers = 0.4 * rng.standard_normal((n_joints, LINK_PARAMETERS))
    return RandomArm(chain, link_parameters(numbers, scale_of(2.0, 0.2)))


def sines(
    rng: np.random.Generator, t: Array, n_joints: int, count: int, reach: float
) -> tuple[Array, Array, Array]:
    """Return sums of so many sines for each joint, within the reach, with their derivatives."""
    w = 2.0 * np.pi * rng.uniform(0.05, 0.5, (n_joints, count))
    a = rng.standard_normal(w.shape) / (1.0 + 2.0 * w)
    phase = t[:, None, None] * w + rng.uniform(0.0, 2.0 * np.pi, w.shape)
    parts = (a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase))
    q, dq, ddq = (each.sum(axis=2) for each in parts)
    scale = reach / np.abs(q).max(axis=0)
    return scale * q, scale * dq, scale * ddq


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
