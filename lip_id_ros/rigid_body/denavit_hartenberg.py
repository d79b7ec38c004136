"""
Link frames and parameters by the convention of Denavit and Hartenberg.

In the modified form (Craig, Introduction to Robotics, 3.4); it chooses what no torque depends on,
where a frame lies along its axis and how it is turned about it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body.chain import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.pseudo_inertia import in_other_frames

PARALLEL = np.sin(np.radians(10.0))
"""
Sine of the angle below which two axes count as parallel: their common normal may be far away.
"""
COINCIDENT = 1e-3
"""Distance [m] below which two parallel axes count as one: the direction between is uncertain."""


STEP = 1e-6
"""Of central differences [rad, m]."""


PARAMETERS, UNITS = ('twist', 'length', 'angle', 'offset'), ('deg', 'm', 'deg', 'm')
"""Those that are reported, and their units; a tilt is seldom there."""


class DenavitHartenberg(NamedTuple):
    """
    Rot_x(twist) Trans_x(length) Rot_y(tilt) Rot_z(angle) Trans_z(offset), for each joint, (n,).

    Twist and length are about and along the common normal from the axis before, angle and offset
    about and along the joint's own. The tilt is zero but where neighbouring axes are parallel
    within ten degrees, and the common normal is replaced (Hayati 1983).
    """

    twist: Array  # [rad]
    length: Array  # [m]
    angle: Array  # at position zero [rad]
    offset: Array  # at position zero [m]
    tilt: Array  # [rad]

    @property
    def reported(self) -> Array:
        """`PARAMETERS` in their `UNITS`, shape (n, 4)."""
        columns = np.degrees(self.twist), self.length, np.degrees(self.angle), self.offset
        return np.column_stack(columns)


_ANGLES = [DenavitHartenberg._fields.index(name) for name in ('twist', 'angle', 'tilt')]


class Pose(NamedTuple):
    """Frames in the base: their axes, columns of (..., 3, 3), and their origins, (..., 3)."""

    axes: Array
    origin: Array


def with_standard_frames(chain: Chain, parameters: Array) -> tuple[Chain, Array]:
    """
    Re-express an arm in frames by the convention; no torque and no difference of energies changes.

    The base is turned so that gravity points down its z axis, and its origin lies in that of the
    first link, since torques do not depend on the turn of the base about gravity and on its place.
    The axis of a prismatic joint is a direction only: it is put through the frame before. Of an
    arm and its mirror image, which have the same torques, one is taken (`handedness`).
    """
    old = poses(chain)
    base, new = _standard_poses(chain, old)
    moved = chain_of(chain, base, new)
    if moved.translations[:, 0].sum() < -COINCIDENT:  # all x axes may point the other way
        base.axes[:, :2] *= -1.0
        new.axes[:, :, :2] *= -1.0
        moved = chain_of(chain, base, new)
    turns = old.axes.transpose(0, 2, 1) @ new.axes
    shifts = np.einsum('iba,ib->ia', old.axes, new.origin - old.origin)
    links = in_other_frames(parameters, turns, shifts)
    image = mirrored(moved, links)
    return (moved, links) if handedness(moved, image[0]) > 0.0 else image


def handedness(chain: Chain, image: Chain) -> float:
    """
    Return what has another sign in the mirror image of an arm; 1 if nothing has.

    The height of the first axis, or else the first number of the chain that is not near zero.
    """
    own, other = (
        np.concatenate([x.rotations[0, 2:, 2], x.rotations.ravel(), x.translations.ravel()])
        for x in (chain, image)
    )
    differ = np.where(np.abs(own + other) < 1e-9, np.abs(own), 0.0)
    first = int(np.argmax(differ > min(PARALLEL, 0.5 * differ.max())))
    return float(own[first]) if differ[first] > 0.0 else 1.0


def mirrored(chain: Chain, parameters: Array) -> tuple[Chain, Array]:
    """
    Return the mirror image of an arm in the plane y = 0 of its base; no torque changes.

    A rotation about an axis becomes one about the opposite of the axis' image, a translation along
    an axis one along its image. So joints keep their signs, and gravity must have no y component.
    """
    slides = chain.prismatic[:, None]
    signs = np.where(slides, [1.0, -1.0, 1.0], [1.0, 1.0, -1.0])
    before = np.vstack([[1.0, -1.0, 1.0], signs[:-1]])
    image = chain._replace(
        rotations=before[:, :, None] * chain.rotations * signs[:, None, :],
        translations=before * chain.translations,
    )
    x, y, z = signs.T
    one = np.ones_like(x)
    factors = np.stack([one, x, y, z, one, x * y, x * z, one, y * z, one, one], axis=1)
    return image, factors * parameters


def table(chain: Chain) -> DenavitHartenberg:
    """Return the parameters of a chain whose frames follow the convention."""
    r, p = chain.rotations, chain.translations
    tilt = np.arcsin(np.clip(r[:, 0, 2], -1.0, 1.0))
    offset = (p[:, 1:] * r[:, 1:, 2]).sum(axis=1) / np.cos(tilt) ** 2
    return DenavitHartenberg(
        twist=np.arctan2(-r[:, 1, 2], r[:, 2, 2]),
        length=p[:, 0],  # a tilted frame has no offset
        angle=np.arctan2(-r[:, 0, 1], r[:, 0, 0]),
        offset=offset,
        tilt=tilt,
    )


def table_std(chain: Chain, root: Array) -> DenavitHartenberg:
    """
    Return standard deviations of the parameters of a chain in frames by the convention.

    Differentiated by central differences, since the frames follow the axes. `root`, shape (6 n,
    r), is a square root of the covariance of small rotations about the axes of each joint's own
    frame and of translations in its parent, joint by joint.
    """
    n = len(chain.prismatic)
    jacobian = np.empty((len(DenavitHartenberg._fields), n, 6 * n))
    for k, step in enumerate(STEP * np.eye(6 * n)):
        ahead, behind = (_standard_table(displaced(chain, by)) for by in (step, -step))
        change = np.array(ahead) - np.array(behind)
        change[_ANGLES] = np.angle(np.exp(1j * change[_ANGLES]))
        jacobian[:, :, k] = change / (2.0 * STEP)
    return DenavitHartenberg(*np.linalg.norm(jacobian @ root, axis=2))


def _standard_table(chain: Chain) -> DenavitHartenberg:
    return table(with_standard_frames(chain, np.zeros((len(chain.prismatic), LINK_PARAMETERS)))[0])


def displaced(chain: Chain, by: Array) -> Chain:
    """Return a chain with steps of its placements, (6 n,), in the coordinates of `table_std`."""
    turns, shifts = by.reshape(-1, 2, 3).transpose(1, 0, 2)
    return chain._replace(
        rotations=chain.rotations @ Rotation.from_rotvec(turns).as_matrix(),
        translations=chain.translations + shifts,
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


def chain_of(old: Chain, base: Pose, links: Pose) -> Chain:
    """Return the chain whose frames are at given poses in the old base."""
    axes = np.concatenate([base.axes[None], links.axes])
    origins = np.concatenate([base.origin[None], links.origin])
    to_parent = axes[:-1].transpose(0, 2, 1)
    translations = (to_parent @ np.diff(origins, axis=0)[:, :, None])[:, :, 0]
    gravity = base.axes.T @ old.gravity
    return old._replace(rotations=to_parent @ axes[1:], translations=translations, gravity=gravity)


def up_of(chain: Chain, old: Pose) -> Array:
    """Return the unit vector against gravity, or along the first axis where there is none."""
    size = np.linalg.norm(chain.gravity)
    return np.asarray(-chain.gravity / size if size > 0.0 else old.axes[0, :, 2])


def _standard_poses(chain: Chain, old: Pose) -> tuple[Pose, Pose]:
    """Return the frames of the base and of all links, in the old base."""
    z, n = old.axes[:, :, 2], len(chain.prismatic)
    up = up_of(chain, old)
    normal = np.cross(up, z[0])
    vertical = np.linalg.norm(normal) <= PARALLEL
    x = None if vertical else normal / np.linalg.norm(normal)
    base_x, at = x, old.origin[0]
    axes, origins = np.empty((n, 3, 3)), np.empty((n, 3))
    before = up
    for i in range(n):
        anywhere = i == 0 or chain.prismatic[i]
        through = at if anywhere else _near(old.origin[i], z[i], at, before)
        next_line = None
        if i + 1 < n:
            next_line = (None if chain.prismatic[i + 1] else old.origin[i + 1]), z[i + 1]
        at, x = _frame(through, z[i], x, next_line)
        axes[i], origins[i], before = _right_handed(x, z[i]), at, z[i]
    base_x = _perpendicular(axes[0, :, 0], up) if base_x is None else base_x
    return Pose(_right_handed(base_x, up), origins[0]), Pose(axes, origins)


def _frame(
    through: Array, z: Array, before: Array | None, next_line: tuple[Array | None, Array] | None
) -> tuple[Array, Array]:
    """Return origin and x axis of a link's frame; an origin at `through` leaves no offset."""
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
    aside = _near(point, direction, through, z) - through if point is not None else np.zeros(3)
    if np.linalg.norm(aside) <= COINCIDENT:
        return through, fallback
    return through, _along(aside / np.linalg.norm(aside), before)


def _along(x: Array, before: Array | None) -> Array:
    """Return that of the two directions of a normal which needs the smaller turn."""
    return -x if before is not None and x @ before < 0.0 else x


def _near(point: Array, direction: Array, at: Array, z: Array) -> Array:
    """
    Return a point of a line that is near the origin `at` of a frame with the axis z.

    The nearest one, or that in the frame's x-y plane where the line is nearly parallel to z.
    """
    if np.linalg.norm(np.cross(z, direction)) > PARALLEL:
        return point + direction * (direction @ (at - point))
    return point + direction * (z @ (at - point)) / (z @ direction)


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
