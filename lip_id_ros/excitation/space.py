"""
The space in which an arm may move: a floor, boxes to stay out of, and one to stay in.

The origins of all joints but the first, and the tool, keep a distance to them at every time. None
moves faster than the sum over the joints before it of their speed times the length of the arm
between, so that what is at a distance at one sample is at nearly the same until the next. Where
reported positions are coupled, the joints are where the couplings put them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import FourierMotion, peaks
from lip_id_ros.excitation.settings import NONE, SpaceSettings
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.couplings import coupling_matrix

COARSE_HZ, FINE_HZ = 50.0, 500.0
WEIGHT = 300.0
"""Of the penalty of a point one metre beyond a limit."""

NUMBERS = 6
"""Of a box: lowest x, y, z and highest x, y, z."""


class Space:
    """
    Limits of the places of joints and tool; ConfigError if a box is none.

    `reach`, shape (n, n): the largest speed of each point by each joint's unit speed [m].
    """

    settings = 'space.floor_m, space.boxes or space.keep_in'

    def __init__(self, settings: SpaceSettings, chain: Chain, limits: JointLimits) -> None:
        self._chain, self._margin = chain, settings.margin_m
        self._matrix = coupling_matrix(chain)
        self._floor = None if settings.floor_m == NONE else float(settings.floor_m)
        self._boxes = _boxes(settings.boxes, 'space.boxes')
        self._inside = _boxes(settings.keep_in, 'space.keep_in')
        if settings.tool and len(settings.tool) != 3:
            raise ConfigError(
                f'space.tool needs x, y and z of the tool, but has {len(settings.tool)} numbers.'
            )
        self._tool = np.array(settings.tool or (0.0, 0.0, 0.0))
        self._names = [*(f'joint {name!r}' for name in limits.joint_names[1:]), 'the tool']
        self.reach = _reach(chain, self._tool, limits)

    def points(self, q: Array) -> tuple[Array, Array]:
        """
        Return the places of the joints but the first, and of the tool, in the frame of the base.

        `q`, shape (N, n): reported positions. Shapes (N, n, 3), and (N, n, n, 3) of their
        derivatives, point by joint.
        """
        count, n = q.shape
        q = q @ self._matrix.T
        rotation, origin = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
        axes, centres = np.empty((count, n, 3)), np.empty((count, n, 3))
        points = np.empty((count, n, 3))
        for j in range(n):
            origin = origin + rotation @ self._chain.translations[j]
            rotation = rotation @ self._chain.rotations[j]
            axes[:, j], centres[:, j] = rotation[:, :, 2], origin
            if j > 0:
                points[:, j - 1] = origin
            if self._chain.prismatic[j]:
                origin = origin + q[:, j, None] * axes[:, j]
            else:
                rotation = rotation @ _about_z(q[:, j])
        points[:, n - 1] = origin + rotation @ self._tool
        slopes = np.zeros((count, n, n, 3))
        for j in range(n):
            arms = points[:, j:] - centres[:, j, None]
            turned = np.cross(axes[:, j, None], arms)
            slid = np.broadcast_to(axes[:, j, None], arms.shape)
            slopes[:, j:, j] = slid if self._chain.prismatic[j] else turned
        return points, np.einsum('tpjx,jk->tpkx', slopes, self._matrix)

    def clearance(self, points: Array) -> tuple[Array, Array]:
        """Return how far points (..., 3) are from the nearest limit [m], and the gradients."""
        found = []
        if self._floor is not None:
            up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
            found.append((points[..., 2] - self._floor, up))
        found += [_outside(points, *box) for box in self._boxes]
        found += [_within(points, *box) for box in self._inside]
        distances = np.array([each for each, _ in found])
        nearest = np.argmin(distances, axis=0)
        gradients = np.array([each for _, each in found])
        at = np.take_along_axis(gradients, nearest[None, ..., None], axis=0)[0]
        return np.min(distances, axis=0) - self._margin, at

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture with a joint or the tool beyond a limit, by a ConfigError."""
        points = self.points(posture[None])[0][0]
        distances = self.clearance(points)[0]
        worst = int(np.argmin(distances))
        if distances[worst] <= 0.0:
            x, y, z = points[worst]
            raise ConfigError(
                f'{self._names[worst]} is at ({x:.3g}, {y:.3g}, {z:.3g}) m at the posture, which '
                f'lacks {-distances[worst]:.3g} m to space.margin_m from the floor, a box or the '
                'end of space.keep_in; choose another posture, or correct the space.'
            )

    def is_kept(self, motion: FourierMotion, fine: bool) -> bool:
        """Whether a motion keeps the distance: at every time if `fine`, else at some times."""
        t = motion.times(FINE_HZ if fine else COARSE_HZ)
        distances = self.clearance(self.points(motion.derivative(t, 0))[0])[0]
        if not fine:
            return bool(distances.min() > 0.0)
        half = 0.5 * (t[1] - t[0])
        speeds = np.abs(motion.derivative(t, 1)) + half * peaks(motion)[2]
        return bool(np.all(distances > half * speeds @ self.reach.T))

    def penalty(self, q: Array, dq: Array, ddq: Array) -> tuple[float, Array]:
        """Return what places beyond a limit cost, and its gradient, shape (3, N, n)."""
        points, slopes = self.points(q)
        distances, gradients = self.clearance(points)
        lacking = np.maximum(self._margin - distances, 0.0)
        weight = WEIGHT / len(q)
        by_points = -2.0 * weight * lacking[..., None] * gradients
        by_q = np.einsum('tpx,tpjx->tj', by_points, slopes)
        return weight * float(np.sum(lacking**2)), np.array([by_q, 0.0 * by_q, 0.0 * by_q])


def is_limited(settings: SpaceSettings) -> bool:
    """Whether settings limit the space at all."""
    return settings.floor_m != NONE or bool(settings.boxes or settings.keep_in)


def _boxes(numbers: Sequence[float], name: str) -> list[tuple[Array, Array]]:
    if len(numbers) % NUMBERS:
        raise ConfigError(
            f'{name} needs {NUMBERS} numbers for each box, lowest and highest x, y, z, but '
            f'has {len(numbers)}; correct it.'
        )
    boxes = [(each[:3], each[3:]) for each in np.reshape(numbers, (-1, NUMBERS)).astype(float)]
    if any(np.any(low >= high) for low, high in boxes):
        raise ConfigError(f'{name} has a box whose lowest corner is not below its highest one.')
    return boxes


def _reach(chain: Chain, tool: Array, limits: JointLimits) -> Array:
    """Return the largest speed of each point by each joint's unit speed, shape (n, n) [m]."""
    n, matrix = len(chain.translations), np.abs(coupling_matrix(chain))
    farthest = matrix @ np.maximum(np.abs(limits.lower), np.abs(limits.upper))
    slides = np.where(chain.prismatic, farthest, 0.0)
    lengths = np.append(np.linalg.norm(chain.translations, axis=1)[1:], np.linalg.norm(tool))
    out = np.zeros((n, n))
    for j in range(n):
        out[j:, j] = 1.0 if chain.prismatic[j] else np.cumsum(lengths[j:] + slides[j:])
    return np.asarray(out @ matrix)


def _outside(points: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return distances to a box, negative inside it, and their gradients."""
    beyond = np.maximum(low - points, points - high)
    sign = np.where(low - points > points - high, -1.0, 1.0)
    out = np.maximum(beyond, 0.0)
    distance = np.linalg.norm(out, axis=-1)
    nearest = np.eye(3)[np.argmax(beyond, axis=-1)]
    is_inside = distance == 0.0
    direction = np.where(
        is_inside[..., None], nearest, out / np.where(is_inside, 1.0, distance)[..., None]
    )
    return np.where(is_inside, beyond.max(axis=-1), distance), sign * direction


def _within(points: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Return distances to the sides of a box, negative outside it, and their gradients."""
    gaps = np.concatenate([points - low, high - points], axis=-1)
    nearest = np.argmin(gaps, axis=-1)
    directions = np.concatenate([np.eye(3), -np.eye(3)])
    return gaps.min(axis=-1), directions[nearest]


def _about_z(angles: Array) -> Array:
    c, s = np.cos(angles), np.sin(angles)
    zero, one = np.zeros_like(c), np.ones_like(c)
    rows = [[c, -s, zero], [s, c, zero], [zero, zero, one]]
    return np.array(rows).transpose(2, 0, 1)
