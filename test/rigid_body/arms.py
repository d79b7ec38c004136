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


PARALLEL = np.sin(np.radians(3.0))
"""
Sine of the angle below which two axes count as parallel: torques identify a small angle poorly,
and do not identify where such axes cross.
"""


def angles_between(chain: Chain) -> Array:
    """Return the angle of each axis to that of the joint before it, shape (n - 1,) [rad]."""
    along = chain.rotations[1:, 2, 2]
    across = np.hypot(chain.rotations[1:, 0, 2], chain.rotations[1:, 1, 2])
    return np.arctan2(across, along)


def distances_between(chain: Chain) -> Array:
    """
    Return the shortest distance of each joint's axis to that of the joint before it.

    Returns
    -------
    array, shape (n - 1,)
        [m]; not a number where one of the two is prismatic, whose axis is but a direction, and
        where there is no gravity, without which torques identify lengths up to a factor.

    """
    axes, origins = chain.rotations[1:, :, 2], chain.translations[1:]
    normals = np.cross((0.0, 0.0, 1.0), axes)
    sines = np.linalg.norm(normals, axis=1)
    skew = np.abs((origins * normals).sum(axis=1)) / np.where(sines > 0.0, sines, 1.0)
    side_by_side = np.hypot(origins[:, 0], origins[:, 1])
    distances = np.where(sines > PARALLEL, skew, side_by_side)
    unknown = chain.prismatic[1:] | chain.prismatic[:-1] | ~chain.gravity.any()
    return np.where(unknown, np.nan, distances)
