"""Simulated arms of six joints, as of industry, some of whose reported positions are coupled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.couplings import Coupling, rows_of
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, scale_of
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.simulation.datasets import make_dataset
from lip_id_ros.simulation.trajectories import MotionLimits, SinusoidTrajectory

N_JOINTS, RATE_HZ, SECONDS, PERIOD_S, FASTEST_HZ = 6, 20.0, 60.0, 12.0, 0.6
NOISE = 0.01
"""Of the torques, in their standard deviations."""

ARMS: dict[str, tuple[Coupling, ...]] = {
    'none': (),
    'parallelogram': (Coupling(2, 1, -1.0),),
    'wrist': (Coupling(5, 4, 1.0),),
    'wrist, geared': (Coupling(4, 3, -0.5),),
    'parallelogram and wrist': (Coupling(2, 1, -1.0), Coupling(5, 4, 1.0)),
}

SIZES = (0.4, 0.5, 0.45, 0.15, 0.12, 0.08)
"""Of the links [m]."""
MASSES = (15.0, 12.0, 7.0, 3.0, 1.5, 0.8)
"""[kg]"""
TWISTS = (0.0, 90.0, 0.0, 90.0, -90.0, 90.0)
"""Of the axes [degrees]: the second and the third are parallel, as those of most arms."""


@dataclass(frozen=True, eq=False)
class CoupledArm:
    """
    Links, rotors and friction of an arm.

    `viscous`, `coulomb`, shape (n,): friction of the drives, which turn with reported positions.

    """

    chain: Chain
    links: Array
    viscous: Array
    coulomb: Array

    joint_names = tuple(f'joint_{i + 1}' for i in range(N_JOINTS))
    joint_types = ('revolute',) * N_JOINTS

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Torques [N m], shape (N, n)."""
        friction = self.viscous * dq + self.coulomb * np.tanh(dq / 0.02)
        return np.asarray(torque_regressor(self.chain, q, dq, ddq) @ self.links.ravel() + friction)

    def kinetic(self, q: Array, dq: Array) -> Array:
        """Kinetic energy [J], shape (N,)."""
        return np.asarray(kinetic_regressor(self.chain, q, dq) @ self.links.ravel())

    def potential(self, q: Array) -> Array:
        """Potential energy [J], shape (N,)."""
        return np.asarray(potential_regressor(self.chain, q) @ self.links.ravel())


def coupled_arm(couplings: tuple[Coupling, ...], seed: int) -> CoupledArm:
    """Draw an arm; a seed has the same links and friction whatever the couplings."""
    rng = np.random.default_rng(seed)
    twists = Rotation.from_euler('x', np.array(TWISTS)[:, None], degrees=True).as_matrix()
    lengths = np.array([0.0, *SIZES[:-1]])[:, None] * rng.uniform(0.7, 1.3, (N_JOINTS, 1))
    along = np.array([[0, 0, 1], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 1, 0]])
    turns = Rotation.from_euler('z', rng.choice((0.0, 90.0, -90.0), (N_JOINTS, 1)), degrees=True)
    chain = Chain(
        np.ascontiguousarray(twists @ turns.as_matrix()),
        np.ascontiguousarray(lengths * along),
        np.zeros(N_JOINTS, dtype=bool),
        np.array([0.0, 0.0, -9.81]),
        rows_of(couplings),
    )
    numbers = 0.4 * rng.standard_normal((N_JOINTS, LINK_PARAMETERS))
    links = np.concatenate(
        [
            link_parameters(row[None], scale_of(mass, size / 2.0))
            for row, mass, size in zip(numbers, MASSES, SIZES, strict=True)
        ]
    )
    viscous = np.array([8.0, 8.0, 5.0, 1.5, 1.0, 0.5]) * rng.uniform(0.5, 1.5, N_JOINTS)
    coulomb = np.array([8.0, 8.0, 5.0, 1.5, 1.0, 0.5]) * rng.uniform(0.5, 1.5, N_JOINTS)
    return CoupledArm(chain, links, viscous, coulomb)


def recorded(arm: CoupledArm, periodic: bool, seed: int) -> tuple[Dataset, Dataset]:
    """Return a minute of motion with noise, random or periodic, and another minute."""
    rng = np.random.default_rng([seed, periodic])
    reach = np.array([1.5, 0.8, 0.8, 1.5, 1.2, 2.0])
    limits = MotionLimits(-reach, reach, np.full(N_JOINTS, 2.0), np.full(N_JOINTS, 5.0))
    t = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ

    def drawn(period: float) -> SinusoidTrajectory:
        return SinusoidTrajectory.random(limits, rng, round(FASTEST_HZ * period), 1.0 / period)

    unseen, seen = drawn(SECONDS), drawn(PERIOD_S if periodic else SECONDS)
    std = NOISE * arm.inverse_dynamics(*unseen.sample(t)).std(axis=0)
    train, test = (make_dataset(arm, each, t, std, rng) for each in (seen, unseen))
    return train, test
