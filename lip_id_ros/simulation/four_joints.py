"""A simulated arm of four joints with friction, which needs neither a URDF nor pinocchio."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain, STANDARD_GRAVITY
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.simulation.trajectories import MotionLimits

MOTION = MotionLimits(
    q_min=np.array([-2.5, -2.2, -2.0, -2.5]),
    q_max=np.array([2.5, 0.2, 2.0, 2.5]),
    dq_max=np.array([2.0, 2.0, 2.5, 3.0]),
    ddq_max=np.array([8.0, 8.0, 12.0, 20.0]),
)
VISCOUS = np.array([4.0, 5.0, 2.0, 0.5])  # N m s/rad
COULOMB = np.array([3.0, 4.0, 2.0, 0.6])  # N m
SIGN_WIDTH = 0.01  # rad/s


def _link(mass: float, centre: Array, gyration: float, rotor: float) -> list[float]:
    """Return the 11 parameters of a link [kg, m]: a body whose inertia is that of a ball."""
    outer = np.outer(centre, centre)
    inertia = mass * ((gyration**2 + np.trace(outer)) * np.eye(3) - outer)
    return [mass, *(mass * centre), *inertia[np.triu_indices(3)], rotor]


LINKS = np.array(
    [
        _link(6.0, np.array([0.0, 0.0, -0.1]), 0.12, 0.5),
        _link(5.0, np.array([0.2, 0.0, 0.05]), 0.14, 0.6),
        _link(3.0, np.array([0.02, 0.18, 0.0]), 0.11, 0.3),
        _link(1.2, np.array([0.06, 0.02, 0.1]), 0.06, 0.05),
    ]
)
LEVEL = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # turns z into y
CHAIN = Chain(
    np.array([np.eye(3), LEVEL, np.eye(3), LEVEL]),
    np.array([[0.0, 0.0, 0.33], [0.0, 0.0, 0.0], [0.42, 0.0, 0.0], [0.03, 0.36, 0.0]]),
    np.zeros(4, dtype=bool),
    np.array([0.0, 0.0, -STANDARD_GRAVITY]),
)


class FourJoints:
    """Rigid links, rotors, and viscous and Coulomb friction of each joint."""

    joint_names: tuple[str, ...] = ('base', 'shoulder', 'elbow', 'wrist')
    joint_types: tuple[str, ...] = ('revolute',) * 4

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m], shape (N, n)."""
        links = torque_regressor(CHAIN, q, dq, ddq) @ LINKS.ravel()
        return np.asarray(links + VISCOUS * dq + COULOMB * np.tanh(dq / SIGN_WIDTH))

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Kinetic energy [J], shape (N,)."""
        return np.asarray(kinetic_regressor(CHAIN, q, dq) @ LINKS.ravel())

    def potential(self, q: Array) -> Array:
        """Potential energy [J], shape (N,)."""
        return np.asarray(potential_regressor(CHAIN, q) @ LINKS.ravel())
