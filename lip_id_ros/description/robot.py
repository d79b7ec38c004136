"""Joints, links and friction of an arm as a robot description has them."""

from __future__ import annotations

from dataclasses import dataclass
import hashlib

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import from_pseudo_inertia, pseudo_inertia

DIGITS = 9
"""Of placements, by which two descriptions are compared."""


@dataclass(frozen=True, eq=False)
class Body:
    """A link of the file, fixed to a link of the chain."""

    name: str
    placement: Array  # (4, 4), of its frame in that link's
    parameters: Array  # (10,), about its own frame; 0 without inertia


@dataclass(frozen=True, eq=False)
class RobotDescription:
    """Joints, links and friction of an arm as a URDF has them."""

    place: str  # file or topic, for messages
    text: str
    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    chain: Chain  # frames turned so that z is the joint's axis
    bodies: tuple[tuple[Body, ...], ...]  # that move with each joint, its own link first
    damping: Array  # (n,), viscous coefficient of `<dynamics>`
    friction: Array  # (n,), Coulomb, likewise
    to_axis: Array  # (n, 3, 3), from the chain's frames to the file's
    before: Array  # (n, 4, 4), frames of joints in the link before

    @property
    def links(self) -> Array:
        """Parameters of the links in the chain's frames, shape (n, 11); the rotors have none."""
        out = np.zeros((len(self.bodies), LINK_PARAMETERS))
        for row, bodies in zip(out, self.bodies, strict=True):
            row[:-1] = sum(moved(body.parameters, body.placement) for body in bodies)
        return out

    @property
    def fingerprint(self) -> str:
        """Digest of the placements: equal where two files place their joints alike."""
        numbers = np.concatenate([x.ravel() for x in (self.chain[0], self.chain[1], self.to_axis)])
        return hashlib.sha256((np.round(numbers, DIGITS) + 0.0).tobytes()).hexdigest()


def moved(parameters: Array, placement: Array) -> Array:
    """Re-express the ten parameters of a body in the frame in which it has a placement."""
    return np.asarray(from_pseudo_inertia(placement @ pseudo_inertia(parameters) @ placement.T))


def transform(rotation: Array, translation: Array) -> Array:
    """Return a homogeneous matrix, shape (4, 4)."""
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation, translation
    return out


def rotation_to(axis: Array) -> Array:
    """Return the smallest rotation that takes z to a unit vector, shape (3, 3)."""
    x, y, z = axis
    if z < 0.0:  # the smallest one is not unique near -z: turn about x first
        return rotation_to(-axis) @ np.diag([1.0, -1.0, -1.0])
    k = 1.0 / (1.0 + z)
    return np.array(
        [[1.0 - k * x * x, -k * x * y, x], [-k * x * y, 1.0 - k * y * y, y], [-x, -y, z]]
    )
