"""Random kernels, weights and joint states for the tests of this folder."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import EnergyKernel, FAMILY, JointBasis, Weights
from lip_id_ros.kernels.program import unit_weights
from lip_id_ros.rigid_body import Chain

R, P = 'revolute', 'prismatic'
ARMS = ((R,), (P,), (R, R), (P, R), (R, P, R), (R, R, P, R))
MEMBERS = tuple(FAMILY)


def random_weights(kernel: EnergyKernel, rng: np.random.Generator) -> Weights:
    return Weights(*(np.exp(0.4 * rng.normal(size=w.shape) - 0.7) for w in unit_weights(kernel)))


def random_states(n_samples: int, n: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    q, dq, ddq = rng.normal(size=(3, n_samples, n))
    return q, dq, ddq


def random_basis(types: tuple[str, ...], rng: np.random.Generator) -> JointBasis:
    n = len(types)
    return JointBasis(types, rng.normal(size=n), 0.5 + rng.random(n))


def random_chain(types: tuple[str, ...], rng: np.random.Generator) -> Chain:
    n = len(types)
    return Chain(
        rotations=Rotation.random(n, random_state=rng).as_matrix().reshape(n, 3, 3),
        translations=0.5 * rng.normal(size=(n, 3)),
        prismatic=np.array([kind == P for kind in types]),
        gravity=rng.normal(size=3),
    )
