"""Random serial arms of rigid bodies, with torques and energies by the links' own regressors."""

from __future__ import annotations

from dataclasses import dataclass

from gp.arms import Arm
import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)

R, P = 'revolute', 'prismatic'
UPPER = np.triu_indices(3)


@dataclass(frozen=True)
class ChainArm(Arm):
    """An arm whose joints are anywhere; pinocchio says the same (test_rigid_links)."""

    joint_types: tuple[str, ...]
    chain: Chain
    parameters: Array

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return np.asarray(
            torque_regressor(self.chain, *contiguous(q, dq, ddq)) @ self.parameters.ravel()
        )

    def kinetic(self, q: Array, dq: Array) -> Array:
        return np.asarray(
            kinetic_regressor(self.chain, *contiguous(q, dq)) @ self.parameters.ravel()
        )

    def potential(self, q: Array) -> Array:
        return np.asarray(
            potential_regressor(self.chain, *contiguous(q)) @ self.parameters.ravel()
        )

    def gravity(self, q: Array) -> Array:
        return self.torque(q, np.zeros_like(q), np.zeros_like(q))

    def coriolis(self, q: Array, dq: Array) -> Array:
        return self.torque(q, dq, np.zeros_like(q)) - self.gravity(q)

    def inertia(self, q: Array) -> Array:
        still, rest = np.zeros_like(q), self.gravity(q)
        units = (np.broadcast_to(unit, q.shape) for unit in np.eye(q.shape[1]))
        return np.stack([self.torque(q, still, unit) - rest for unit in units], axis=2)

    def motion(self, n_samples: int, seed: int) -> tuple[Array, Array, Array]:
        rng = np.random.default_rng(seed)
        reach = np.where([kind == P for kind in self.joint_types], 0.3, 2.0)
        shape = (n_samples, len(self.joint_types))
        return (
            reach * rng.uniform(-1.0, 1.0, shape),
            reach * rng.standard_normal(shape),
            4.0 * reach * rng.standard_normal(shape),
        )


def random_arm(joint_types: tuple[str, ...], seed: int, gravity: float = 9.81) -> ChainArm:
    rng = np.random.default_rng(seed)
    n = len(joint_types)
    chain = Chain(
        Rotation.random(n, random_state=rng).as_matrix().reshape(n, 3, 3),
        0.25 * rng.standard_normal((n, 3)),
        np.array([kind == P for kind in joint_types]),
        np.array([0.0, 0.0, -gravity]),
    )
    bodies = np.stack([random_body(rng) for _ in joint_types])
    return ChainArm(joint_types, chain, bodies)


def random_body(rng: np.random.Generator) -> Array:
    """Return the parameters of a body that exists, shape (11,)."""
    mass, centre = rng.uniform(0.5, 3.0), 0.1 * rng.standard_normal(3)
    points = 0.1 * rng.standard_normal((3, 3))
    second = points @ points.T + mass * np.outer(centre, centre)
    inertia = np.trace(second) * np.eye(3) - second
    body = np.array([mass, *(mass * centre), *inertia[UPPER], 0.1 * rng.random()])
    assert body.shape == (LINK_PARAMETERS,)
    return body


def contiguous(*arrays: Array) -> tuple[Array, ...]:
    return tuple(np.ascontiguousarray(x, dtype=np.float64) for x in arrays)
