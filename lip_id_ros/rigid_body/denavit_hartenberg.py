"""
Link frames by the convention of Denavit and Hartenberg, and what they say of an arm.

Torques do not depend on where a link's frame lies along its axis nor on how it is turned about it,
so that a fit leaves both to chance. The convention (in the modified form of Craig, Introduction to
Robotics, section 3.4: the frame of a link has the axis of its own joint as z axis) puts the x axis
on the common normal to the next axis; most numbers of most arms are then zero or a quarter turn.

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body.axes import PARALLEL
from lip_id_ros.rigid_body.chain import Chain
from lip_id_ros.rigid_body.pseudo_inertia import in_other_frames

COINCIDENT = 1e-3
"""Distance [m] below which two parallel axes count as one: the direction between is uncertain."""


class DenavitHartenberg(NamedTuple):
    """
    Parameters of each joint: Rot_x(twist) Trans_x(length) Rot_z(angle) Trans_z(offset).

    Attributes
    ----------
    twist : array, shape (n,)
        Angle from the axis of the joint before to this one, about their common normal [rad].
    length : array, shape (n,)
        Distance of the two axes along the common normal [m].
    angle : array, shape (n,)
        Turn about the joint's axis at position zero [rad].
    offset : array, shape (n,)
        Shift along the joint's axis at position zero [m].
    tilt : array, shape (n,)
        Angle about the y axis that the four leave (Hayati 1983) [rad]: zero but where neighbouring
        axes are parallel within three degrees.

    """

    twist: Array
    length: Array
    angle: Array
    offset: Array
    tilt: Array


class Pose(NamedTuple):
    """Frames in the base: their axes, columns of (..., 3, 3), and their origins, (..., 3)."""

    axes: Array
    origin: Array


def with_standard_frames(chain: Chain, parameters: Array) -> tuple[Chain, Array]:
    """
    Re-express an arm in frames by the convention; no torque and no difference of energies changes.

    The base is turned so that gravity points down its z axis, and its origin lies in that of the
    first link, since torques say nothing of the turn of the base about gravity and of its place.
    The axis of a prismatic joint is a direction only: it is put through the frame before.

    Parameters
    ----------
    chain : Chain
    parameters : array, shape (n, 11)
        Of the links.

    Returns
    -------
    Chain, array of shape (n, 11)

    """
    old = poses(chain)
    base, new = _standard_poses(chain, old)
    moved = _chain(chain, base, new)
    if moved.translations[:, 0].sum() < -COINCIDENT:  # all x axes may point the other way
        base.axes[:, :2] *= -1.0
        new.axes[:, :, :2] *= -1.0
        moved = _chain(chain, base, new)
    turns = old.axes.transpose(0, 2, 1) @ new.axes
    shifts = np.einsum('iba,ib->ia', old.axes, new.origin - old.origin)
    return moved, in_other_frames(parameters, turns, shifts)


def table(chain: Chain) -> DenavitHartenberg:
    """Return the parameters of a chain whose frames follow the convention."""
    r, p = chain.rotations, chain.translations
    return DenavitHartenberg(
        twist=np.arctan2(-r[:, 1, 2], r[:, 2, 2]),
        length=p[:, 0].copy(),
        angle=np.arctan2(-r[:, 0, 1], r[:, 0, 0]),
        offset=np.einsum('ia,ia->i', p, r[:, :, 2]),
        tilt=np.arcsin(np.clip(r[:, 0, 2], -1.0, 1.0)),
    )


def poses(chain: Chain) -> Pose:
    """Return the frames of all links in the base at position zero."""
    axes, origins = np.empty_like(chain.rotations), np.empty_like(chain.translations)
    turn, at = np.eye(3), np.zeros(3)
    for i, (rotation, translation) in enumerate(
        zip(chain.rotations, chain.translations, strict=True)
    ):
        at = at + turn @ translation
        turn = turn @ rotation
        axes[i], origins[i] = turn, at
    return Pose(axes, origins)


def _chain(old: Chain, base: Pose, links: Pose) -> Chain:
    """Return the chain whose frames are at given poses in the old base."""
    axes = np.concatenate([base.axes[None], links.axes])
    origins = np.concatenate([base.origin[None], links.origin])
    to_parent = axes[:-1].transpose(0, 2, 1)
    translations = (to_parent @ np.diff(origins, axis=0)[:, :, None])[:, :, 0]
    gravity = base.axes.T @ old.gravity
    return Chain(to_parent @ axes[1:], translations, old.prismatic, gravity)


def _standard_poses(chain: Chain, old: Pose) -> tuple[Pose, Pose]:
    """Return the frames of the base and of all links, in the old base."""
    z, n = old.axes[:, :, 2], len(chain.prismatic)
    size = np.linalg.norm(chain.gravity)
    up = -chain.gravity / size if size > 0.0 else z[0]
    normal = np.cross(up, z[0])
    vertical = np.linalg.norm(normal) <= PARALLEL
    x = None if vertical else normal / np.linalg.norm(normal)
    base_x, at = x, old.origin[0]
    axes, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    for i in range(n):
        through = at if i == 0 or chain.prismatic[i] else _nearest(old.origin[i], z[i], at)
        next_line = None
        if i + 1 < n:
            next_line = (None if chain.prismatic[i + 1] else old.origin[i + 1]), z[i + 1]
        at, x = _frame(through, z[i], x, next_line)
        axes[i], origins[i] = _right_handed(x, z[i]), at
    base_x = _perpendicular(axes[0, :, 0], up) if base_x is None else base_x
    return Pose(_right_handed(base_x, up), origins[0]), Pose(axes, origins)


def _frame(
    through: Array, z: Array, before: Array | None, next_line: tuple[Array | None, Array] | None
) -> tuple[Array, Array]:
    """
    Return origin and x axis of a link's frame.

    Parameters
    ----------
    through : array, shape (3,)
        Point of the axis that leaves no offset.
    z : array, shape (3,)
        The axis.
    before : array, shape (3,), or None
        The x axis of the frame before.
    next_line : tuple or None
        A point (none where only the direction matters) and the direction of the next axis.

    """
    fallback = _any_perpendicular(z) if before is None else _perpendicular(before, z)
    if next_line is None:
        return through, fallback
    point, direction = next_line
    normal = np.cross(z, direction)
    sine = np.linalg.norm(normal)
    if sine > PARALLEL:
        x, foot = normal / sine, through
        if point is not None:
            along = np.cross(direction, normal) @ (point - through) / sine**2
            foot = through + along * z
        return foot, _along(x, before)
    aside = _perpendicular_part(point - through, z) if point is not None else np.zeros(3)
    if np.linalg.norm(aside) <= COINCIDENT:
        return through, fallback
    return through, _along(aside / np.linalg.norm(aside), before)


def _along(x: Array, before: Array | None) -> Array:
    """Return that of the two directions of a normal which needs the smaller turn."""
    return -x if before is not None and x @ before < 0.0 else x


def _nearest(point: Array, direction: Array, to: Array) -> Array:
    """Return the point of a line that is nearest to another point."""
    return point + direction * (direction @ (to - point))


def _perpendicular_part(a: Array, z: Array) -> Array:
    return np.asarray(a - z * (z @ a))


def _perpendicular(a: Array, z: Array) -> Array:
    """Return the unit vector normal to z that is nearest to a; any one where a lies along z."""
    part = _perpendicular_part(a, z)
    size = np.linalg.norm(part)
    return part / size if size > PARALLEL else _any_perpendicular(z)


def _any_perpendicular(z: Array) -> Array:
    return _perpendicular(np.eye(3)[np.argmin(np.abs(z))], z)


def _right_handed(x: Array, z: Array) -> Array:
    return np.stack([x, np.cross(z, x), z], axis=1)
