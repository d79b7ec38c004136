"""Chains and links to try things on."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.pseudo_inertia import from_pseudo_inertia
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)

ARMS = ('RRRRRRR', 'RPRPRR', 'PPR', 'PRP', 'R', 'P')
UP = np.array([0.0, 0.0, -9.81])


def random_chain(arm: str, rng: np.random.Generator, gravity: Array = UP) -> Chain:
    """Draw a chain, some of whose axes are parallel, coincident or at right angles."""
    n = len(arm)
    rotations = Rotation.random(n, random_state=rng).as_matrix().reshape(n, 3, 3)
    special = Rotation.from_euler('xz', [[0, 1], [90, 2], [180, 3], [0, 0]], degrees=True)
    for i in range(n):
        if rng.random() < 0.6:
            rotations[i] = special[int(rng.integers(4))].as_matrix()
    translations = 0.5 * rng.standard_normal((n, 3)) * (rng.random((n, 3)) < 0.7)
    return Chain(rotations, translations, np.array([kind == 'P' for kind in arm]), gravity)


def torques_and_energies(
    chain: Chain, parameters: Array, state: Array
) -> tuple[Array, Array, Array]:
    rotations, translations = (np.ascontiguousarray(x) for x in chain[:2])
    chain = chain._replace(rotations=rotations, translations=translations)
    q, dq, ddq = state
    p = parameters.ravel()
    potential = potential_regressor(chain, q) @ p
    return (
        torque_regressor(chain, q, dq, ddq) @ p,
        kinetic_regressor(chain, q, dq) @ p,
        potential - potential[0],
    )


def random_bodies(n: int, rng: np.random.Generator) -> Array:
    """Draw links from clouds of points with positive masses."""
    factors = 0.2 * rng.standard_normal((n, 4, 6))
    factors[:, 3] = 1.0
    masses = rng.uniform(0.1, 1.0, (n, 6))
    pseudo = np.einsum('iak,ik,ibk->iab', factors, masses, factors)
    rotors = rng.uniform(0.01, 0.1, (n, 1))
    return np.concatenate([from_pseudo_inertia(pseudo), rotors], axis=1)


def links_of(model: Any) -> tuple[Chain, Array]:
    """Return chain and parameters of a model of pinocchio whose joints turn about their z axes."""
    joints = range(1, model.njoints)
    order = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # its inertias are xx xy yy xz yz zz
    bodies = np.stack([model.inertias[i].toDynamicParameters()[order] for i in joints])
    chain = Chain(
        np.stack([model.jointPlacements[i].rotation for i in joints]),
        np.stack([model.jointPlacements[i].translation for i in joints]),
        np.array(['P' in model.joints[i].shortname()[10:] for i in joints]),
        model.gravity.linear.copy(),
    )
    return chain, np.column_stack([bodies, model.armature])
