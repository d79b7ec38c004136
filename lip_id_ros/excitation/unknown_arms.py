"""
Arms of which nothing is known: what a first motion is designed for.

Where no model says what is worth knowing, a motion should teach whatever arm it moves. So some
chains are drawn as robots have them, with links and friction of any size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.excitation.expected_error import States
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.joint_types import is_prismatic
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS, STANDARD_GRAVITY
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.rigid_body.regressor_pullback import regressor_pullback

LINK_STD = np.array([3.0, *[0.5] * 3, *[0.1] * 6, 0.2])
"""Of mass, first moments, inertias and rotor [kg, kg m, kg m^2]."""

FRICTION_STD = np.array([0.2, 0.2, 0.05])
"""Torque of viscous friction at full speed, of Coulomb friction and of an offset, in the root mean
square torque of the links."""

NOISE = 0.03
"""In the root mean square torque of the links."""

SIGN_WIDTH = 0.02
"""Of the smooth sign, in the largest velocity."""

PARALLEL = 0.3
"""Share of axes that are parallel to the one before; the others are at right angles."""

LENGTH = 0.25
"""Standard deviation of the components of translations between axes [m]."""


@dataclass(frozen=True, eq=False)
class UnknownArm:
    """
    A chain with links and friction that may have any size.

    Coordinates: parameters of the links (11 n); viscous and Coulomb friction and an offset of each
    joint (3 n). `sign_widths`, shape (n,).
    """

    chain: Chain
    root: Array
    noise: Array
    sign_widths: Array

    def jacobian(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the torques by the coordinates, shape (N, n, 14 n)."""
        links = torque_regressor(self.chain, *map(np.ascontiguousarray, (q, dq, ddq)))
        signs = np.tanh(dq / self.sign_widths)
        own = [_on_diagonal(column) for column in (dq, signs, np.ones_like(dq))]
        return np.concatenate([links, *own], axis=2)

    def pullback(self, weights: Array, q: Array, dq: Array, ddq: Array) -> Array:
        """Differentiate the sum of weights (N, n, 14 n) times the Jacobian, shape (3, N, n)."""
        n = q.shape[1]
        states = map(np.ascontiguousarray, (q, dq, ddq))
        of_links = np.ascontiguousarray(weights[..., : LINK_PARAMETERS * n])
        out = regressor_pullback(self.chain, of_links, *states)
        viscous, coulomb, _ = np.split(weights[..., LINK_PARAMETERS * n :], 3, axis=2)
        signs = np.tanh(dq / self.sign_widths)
        out[1] += np.einsum('tjj->tj', viscous)
        out[1] += np.einsum('tjj->tj', coulomb) * (1.0 - signs**2) / self.sign_widths
        return np.asarray(out)


def unknown_arm(
    limits: JointLimits, joint_types: Sequence[str], targets: States, rng: np.random.Generator
) -> UnknownArm:
    """Draw an arm; its friction and noise follow from the torques of its links at targets."""
    chain = random_chain(joint_types, rng)
    n = len(joint_types)
    of_links = np.tile(LINK_STD, n)
    regressor = torque_regressor(chain, *map(np.ascontiguousarray, targets))
    size = np.sqrt(np.mean(np.sum((regressor * of_links) ** 2, axis=2), axis=0))
    friction = FRICTION_STD[:, None] * size
    friction[0] /= limits.velocity
    root = np.diag(np.concatenate([of_links, friction.ravel()]))
    return UnknownArm(chain, root, NOISE * size, SIGN_WIDTH * limits.velocity)


def random_chain(joint_types: Sequence[str], rng: np.random.Generator) -> Chain:
    """Draw a chain on an upright base, with axes that are parallel or at right angles."""
    n = len(joint_types)
    rotations = np.tile(np.eye(3), (n, 1, 1))
    for i in range(1, n):
        if rng.uniform() > PARALLEL:
            turn = rng.uniform(0.0, 2.0 * np.pi)
            about_z = np.array(
                [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
            )
            rotations[i] = about_z @ np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    translations = LENGTH * rng.standard_normal((n, 3))
    gravity = np.array([0.0, 0.0, -STANDARD_GRAVITY])
    return Chain(rotations, translations, is_prismatic(joint_types), gravity)


def _on_diagonal(columns: Array) -> Array:
    return np.asarray(columns[:, :, None] * np.eye(columns.shape[1]))
