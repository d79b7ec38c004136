"""Three pendulums that do not feel each other: an arm whose every formula is in a textbook."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.simulation import make_dataset, MotionLimits, SinusoidTrajectory

NAMES = ('shoulder', 'elbow', 'wrist')
INERTIA = np.array([0.5, 0.3, 0.2])  # kg m^2
WEIGHT = np.array([4.0, 2.0, 1.0])  # N m
LIMITS = MotionLimits(-np.ones(3), np.ones(3), 2 * np.ones(3), 15 * np.ones(3))


class Pendulums:
    """Inertia times acceleration, and weight times the sine of the angle."""

    joint_names: tuple[str, ...] = NAMES
    joint_types: tuple[str, ...] = ('revolute',) * 3

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        return np.asarray(INERTIA * ddq + WEIGHT * np.sin(q))

    def kinetic(self, q: Array, dq: Array) -> Array:
        return np.asarray(dq**2 @ INERTIA / 2)

    def potential(self, q: Array) -> Array:
        return np.asarray(-np.cos(q) @ WEIGHT)


def swing(seed: int, duration: float = 20.0, rate: float = 20.0, noise: float = 0.01) -> Dataset:
    """Return a random motion with noise on the torques, and the truth."""
    rng = np.random.default_rng(seed)
    trajectory = SinusoidTrajectory.random(LIMITS, rng, n_sinusoids=20, fundamental_hz=0.05)
    t = np.arange(0, duration, 1 / rate)
    return make_dataset(Pendulums(), trajectory, t, noise, rng)
