"""
Simple geometry.

Neighbouring axes that are parallel, at right angles, or meet (maths.md, 13).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS

PARALLEL = 1e-9
"""Sine of the angle below which axes are parallel, as constraints make them."""

MOST_DEVIATIONS = 3.0
"""Standard deviations from simple geometry within which a twist or length is a candidate."""

NEAR_PARALLEL = np.sin(np.radians(10.0))
"""Sine of the angle below which where two axes are nearest means nothing."""

FARTHEST_TWIST, FARTHEST_LENGTH = np.radians(30.0), 0.1
"""Farthest from simple geometry that a twist [rad] and a length [m] may be for that."""


@dataclass(frozen=True, eq=False)
class Geometry:
    """
    What of the placements is fixed, or all where rigid.

    Twists are to the axis before, or of the first to the vertical.
    """

    twists: Array  # (n,) [rad]; not a number where free
    meets: BoolArray  # (n,), whether the axis meets the one before
    rigid: bool = False

    @classmethod
    def free(cls, n_joints: int) -> Geometry:
        """Return what fixes nothing."""
        return cls(np.full(n_joints, np.nan), np.zeros(n_joints, dtype=bool))

    def projected(self, chain: Chain) -> Chain:
        """Return the nearest chain that has this geometry."""
        rotations, translations = chain.rotations.copy(), chain.translations.copy()
        for i in np.flatnonzero(~np.isnan(self.twists)):
            rotations[i] = _with_twist(rotations[i], self.twists[i])
        for i in np.flatnonzero(self.meets):
            normal, sine = _common_normal(rotations[i])
            if sine > PARALLEL:
                translations[i] -= normal * (normal @ translations[i])
        return chain._replace(rotations=rotations, translations=translations)

    def projector(self, chain: Chain) -> Array:
        """Return the projection of steps on those that keep it, shape (6 n, 6 n)."""
        n = len(self.twists)
        if self.rigid:
            return np.zeros((DIRECTIONS * n, DIRECTIONS * n))
        out = np.eye(DIRECTIONS * n)
        for i in np.flatnonzero(~np.isnan(self.twists) | self.meets):
            gradients = np.array(self._fixed(int(i), chain), dtype=np.float64)
            _, sizes, rows = np.linalg.svd(gradients, full_matrices=False)
            fixed = rows[sizes > 1e-9 * sizes.max()]
            place = slice(DIRECTIONS * i, DIRECTIONS * (i + 1))
            out[place, place] -= fixed.T @ fixed
        return out

    def _fixed(self, i: int, chain: Chain) -> list[Array]:
        """Return the gradients of what is fixed of joint i, k of shape (6,)."""
        rotation, translation = chain.rotations[i], chain.translations[i]
        rows: list[Array] = []
        if not np.isnan(self.twists[i]):
            if np.sin(self.twists[i]) < PARALLEL:
                rows += list(np.eye(2, DIRECTIONS))
            else:
                rows.append(_twist_gradient(rotation))
        if self.meets[i]:
            rows.append(_length_gradient(rotation, translation))
        return rows


def candidates(chain: Chain, covariance_root: Array) -> list[tuple[float, Geometry]]:
    """
    Return what may be set to simple geometry, nearest first, at most `MOST_DEVIATIONS` off.

    Distances are in deviations by the covariance root (6 n or more, r) of `ArmPosterior`.
    """
    n = len(chain.prismatic)
    found = []
    for i in range(n):
        rotation, translation = chain.rotations[i], chain.translations[i]
        root = covariance_root[DIRECTIONS * i : DIRECTIONS * (i + 1)]
        for fixed, away, std in _offers(i, chain, rotation, translation, root):
            deviations = away / max(std, 1e-12)
            if deviations <= MOST_DEVIATIONS:
                found.append((deviations, fixed))
    return sorted(found, key=lambda each: each[0])


def _offers(
    i: int, chain: Chain, rotation: Array, translation: Array, root: Array
) -> list[tuple[Geometry, float, float]]:
    free = Geometry.free(len(chain.prismatic))
    twist = _twist_of(rotation)
    target = 0.5 * np.pi * np.round(twist / (0.5 * np.pi))
    away = abs(twist - target)
    offers = []
    if away <= FARTHEST_TWIST and (i > 0 or chain.gravity.any()):
        twists = free.twists.copy()
        twists[i] = target
        std = _spread(_twist_gradient(rotation), root)
        offers.append((replace(free, twists=twists), float(away), std))
    length = _length_of(rotation, translation)
    revolute = i > 0 and not (chain.prismatic[i] or chain.prismatic[i - 1])
    if revolute and np.sin(twist) > NEAR_PARALLEL and abs(length) <= FARTHEST_LENGTH:
        meets = free.meets.copy()
        meets[i] = True
        std = _spread(_length_gradient(rotation, translation), root)
        offers.append((replace(free, meets=meets), abs(length), std))
    return offers


def together(geometries: list[Geometry], n_joints: int) -> Geometry:
    """Return what fixes all that any of some geometries fixes."""
    free = Geometry.free(n_joints)
    twists, meets = free.twists, free.meets
    for each in geometries:
        twists = np.where(np.isnan(each.twists), twists, each.twists)
        meets = meets | each.meets
    return Geometry(twists, meets)


def _twist_of(rotation: Array) -> float:
    z = rotation[:, 2]
    return float(np.arctan2(np.hypot(z[0], z[1]), z[2]))


def _length_of(rotation: Array, translation: Array) -> float:
    normal, _ = _common_normal(rotation)
    return float(normal @ translation)


def _common_normal(rotation: Array) -> tuple[Array, float]:
    """Return the direction that is normal to both axes, and the sine of the twist."""
    normal = np.array([-rotation[1, 2], rotation[0, 2], 0.0])
    sine = float(np.linalg.norm(normal))
    return (normal / sine if sine > 0.0 else np.array([1.0, 0.0, 0.0])), sine


def _with_twist(rotation: Array, twist: float) -> Array:
    normal, _ = _common_normal(rotation)
    change = twist - _twist_of(rotation)
    return np.asarray(Rotation.from_rotvec(change * normal).as_matrix() @ rotation)


def _twist_gradient(rotation: Array) -> Array:
    """Differentiate the twist by a step of the placement, shape (6,)."""
    z, (normal, sine) = rotation[:, 2], _common_normal(rotation)
    # the unit vector normal to z in which z moves as the twist grows
    upward = np.cross(normal, z) if sine > 0.0 else np.array([0.0, -1.0, 0.0])
    out = np.zeros(DIRECTIONS)
    out[0], out[1] = -upward @ rotation[:, 1], upward @ rotation[:, 0]
    return out


def _length_gradient(rotation: Array, translation: Array) -> Array:
    """Differentiate the length by a step of the placement, shape (6,)."""
    normal, sine = _common_normal(rotation)
    aside = (translation - normal * (normal @ translation)) / max(sine, PARALLEL)
    # turning by d moves z by the cross product R d x z, and (-z_y, z_x, 0) with it
    moved = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]) @ rotation
    out = np.zeros(DIRECTIONS)
    out[0], out[1] = -aside @ moved[:, 1], aside @ moved[:, 0]
    out[3:] = normal
    return out


def _spread(gradient: Array, root: Array) -> float:
    return float(np.linalg.norm(gradient @ root))
