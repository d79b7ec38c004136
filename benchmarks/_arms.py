"""Simulated arms of random links, and motions of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, scale_of
from lip_id_ros.rigid_body.regressor import torque_regressor

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
