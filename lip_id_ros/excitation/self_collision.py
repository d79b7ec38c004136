"""
Links that keep a distance from each other, by the collision geometry of a URDF.

Meshes are replaced by their convex hulls, which contain them. Distances are those of coal, through
pinocchio. From one time to the next that is looked at, no two links approach by more than they are
apart: they move no faster relative to each other than the sum over the joints between them of
their speed times the length of the arm beyond.
"""

from __future__ import annotations

from collections.abc import Sequence
import os
from pathlib import Path
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import FourierMotion, peaks

COARSE_HZ = 10.0
WEIGHT = 300.0
"""Of the penalty of two links that are one metre too near each other."""

DRAWS, TOUCHING = 300, 0.002
"""Random positions; links that are this near at all of them are built to touch [m]."""

NEAR = 0.5
"""Links that are always near keep this share of the most that they are apart there."""


class SelfCollision:
    """
    The links of a URDF (text, place), which keep a distance [m] from each other.

    `matrix`, shape (n, n): joints move by it times the reported positions. ConfigError if the URDF
    has no collision geometry, a mesh is not found, or pinocchio is not installed.
    """

    settings = 'space.self_distance_m'

    def __init__(
        self, urdf: tuple[str, str], limits: JointLimits, matrix: Array, distance: float
    ) -> None:
        self._matrix = matrix
        self._pin = pin = _pinocchio()
        model, geometry = _geometry(pin, urdf, limits.joint_names)
        self._model, self._data, self._geometry = model, model.createData(), geometry
        joints = [model.joints[model.getJointId(name)] for name in limits.joint_names]
        self._joints = [(each.id, each.idx_q, each.nq, each.idx_v) for each in joints]
        farthest = np.abs(matrix) @ np.maximum(np.abs(limits.lower), np.abs(limits.upper))
        self._beyond = self._lengths(farthest)
        self._choose_pairs(limits, distance)

    def distances(self, q: Array) -> Array:
        """Return how far each pair of links is apart at reported positions (n,) [m]."""
        position = self._pin.neutral(self._model)
        for (_, at, size, _), value in zip(self._joints, self._matrix @ q, strict=True):
            position[at : at + size] = value if size == 1 else (np.cos(value), np.sin(value))
        self._pin.computeJointJacobians(self._model, self._data, position)
        self._pin.computeDistances(self._model, self._data, self._geometry, self._found, position)
        return np.array([each.min_distance for each in self._found.distanceResults])

    def approach(self, speeds: Array) -> Array:
        """Return how fast each pair approaches at most, by speeds of reported positions (n,)."""
        return np.asarray(self._speeds @ speeds)

    def require_posture(self, posture: Array) -> None:
        """Refuse a posture at which two links are too near each other, by a ConfigError."""
        distances = self.distances(posture)
        lacking = self._least - distances
        if lacking.size and lacking.max() > 0.0:
            worst = int(np.argmax(lacking))
            raise ConfigError(
                f'{" and ".join(self._names(worst))} must be {self._least[worst]:.2g} m apart at '
                f'the posture, but are {distances[worst]:.2g} m; choose another posture, or a '
                'smaller space.self_distance_m.'
            )

    def is_kept(self, motion: FourierMotion, fine: bool) -> bool:
        """Whether a motion keeps the distance: surely, with none at no time, if `fine`."""
        t, end, speeds = 0.0, motion.duration, self.approach(peaks(motion)[1])
        while t < end:
            distances = self.distances(motion.derivative(np.array([t]), 0)[0])
            if np.any(distances < self._least):
                return False
            sure = float(np.min(distances / np.maximum(speeds, 1e-12), initial=end))
            t += sure if fine else max(sure, 1.0 / COARSE_HZ)
        return True

    def penalty(self, q: Array, dq: Array, ddq: Array) -> tuple[float, Array]:
        """Return what links that are too near cost, and its gradient, shape (3, N, n)."""
        weight, value, by_q = WEIGHT / len(q), 0.0, np.zeros_like(q)
        for row, slope in zip(q, by_q, strict=True):
            lacking = np.maximum(self._least - self.distances(row), 0.0)
            value += weight * float(np.sum(lacking**2))
            for pair in np.flatnonzero(lacking):
                slope -= 2.0 * weight * lacking[pair] * self._slope(int(pair))
        return value, np.array([by_q, np.zeros_like(dq), np.zeros_like(ddq)])

    def _slope(self, pair: int) -> Array:
        """Differentiate the distance of a pair by reported positions, (n,), where it was found."""
        result = self._found.distanceResults[pair]
        points = (result.getNearestPoint1(), result.getNearestPoint2())
        jacobians = [
            self._point_jacobian(self._parent(each), point)
            for each, point in zip(self._pair(pair), points, strict=True)
        ]
        by_joints = np.asarray(result.normal) @ (jacobians[1] - jacobians[0])
        return np.asarray(by_joints[[at for *_, at in self._joints]] @ self._matrix)

    def _point_jacobian(self, joint: int, point: Array) -> Array:
        """Return the velocity (3, n) of a point of a joint's link by the joints' velocities."""
        if joint == 0:
            return np.zeros((3, self._model.nv))
        frame = self._pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = self._pin.getJointJacobian(self._model, self._data, joint, frame)
        arm = np.asarray(point) - self._data.oMi[joint].translation
        return np.asarray(jacobian[:3] + np.cross(jacobian[3:], arm, axis=0))

    def _lengths(self, farthest: Array) -> Array:
        """Return how far each joint is from the one before at most, in pinocchio's order [m]."""
        lengths = np.array(
            [np.linalg.norm(each.translation) for each in self._model.jointPlacements]
        )
        for (number, *_), most in zip(self._joints, farthest, strict=True):
            if 'P' in self._model.joints[number].shortname():
                lengths[number] += most
        return lengths

    def _choose_pairs(self, limits: JointLimits, distance: float) -> None:
        """Look at all pairs of links but neighbours, and those that are built to touch."""
        objects, parents = self._geometry.geometryObjects, self._model.parents
        self._geometry.removeAllCollisionPairs()
        for b, second in enumerate(objects):
            for a, first in enumerate(objects[:b]):
                low, high = sorted((first.parentJoint, second.parentJoint))
                if low != high and parents[high] != low:
                    self._geometry.addCollisionPair(self._pin.CollisionPair(a, b))
        self._found = self._geometry.createData()
        rng = np.random.default_rng(0)
        draws = rng.uniform(limits.lower, limits.upper, (DRAWS, limits.lower.size))
        farthest = np.max([self.distances(q) for q in draws], axis=0, initial=0.0)
        for pair in np.flatnonzero(farthest <= TOUCHING)[::-1]:
            self._geometry.removeCollisionPair(self._geometry.collisionPairs[int(pair)])
        self._least = np.minimum(distance, NEAR * farthest[farthest > TOUCHING])
        self._found = self._geometry.createData()
        count = len(self._geometry.collisionPairs)
        self._speeds = np.array([self._speed(pair) for pair in range(count)])
        self._speeds = self._speeds.reshape(count, len(self._joints))

    def _speed(self, pair: int) -> Array:
        """Return how fast two links approach at most by each reported unit speed, (n,)."""
        first, last = sorted(self._pair(pair), key=self._parent)
        radius = _radius(self._geometry.geometryObjects[last])
        near, joint = self._parent(first), self._parent(last)
        reach, by_joint = radius, np.zeros(self._model.njoints)
        while joint != near and joint != 0:
            slides = 'P' in self._model.joints[joint].shortname()
            by_joint[joint] = 1.0 if slides else reach
            reach += self._beyond[joint]
            joint = self._model.parents[joint]
        own = by_joint[[number for number, *_ in self._joints]]
        return np.asarray(own @ np.abs(self._matrix))

    def _pair(self, pair: int) -> tuple[int, int]:
        found = self._geometry.collisionPairs[pair]
        return found.first, found.second

    def _parent(self, number: int) -> int:
        return int(self._geometry.geometryObjects[number].parentJoint)

    def _names(self, pair: int) -> Sequence[str]:
        return [self._geometry.geometryObjects[k].name for k in self._pair(pair)]


def _pinocchio() -> Any:
    try:
        import pinocchio  # optional: only this check and simulations need it
    except ImportError as error:
        raise ConfigError(
            f'space.self_distance_m needs pinocchio, which is not installed ({error}); '
            "pip install 'lip_id_ros[sim]', or set it to none."
        ) from error
    return pinocchio


def _geometry(pin: Any, urdf: tuple[str, str], names: Sequence[str]) -> tuple[Any, Any]:
    """Return pinocchio's model of the joints, all others locked, and its hulls."""
    text, place = urdf
    whole = pin.buildModelFromXML(text)
    try:
        meshes = pin.buildGeomFromUrdfString(
            whole, text, pin.GeometryType.COLLISION, package_dirs=_package_folders(place)
        )
    except ValueError as error:
        raise ConfigError(
            f'space.self_distance_m needs the meshes that {place} names, but {error}; source the '
            'workspace that has them, or set it to none.'
        ) from error
    for each in meshes.geometryObjects:
        if hasattr(each.geometry, 'buildConvexHull'):
            each.geometry.buildConvexHull(True, 'Qt')
            each.geometry = each.geometry.convex
    if len({each.parentJoint for each in meshes.geometryObjects}) < 2:
        raise ConfigError(
            f'space.self_distance_m needs the shapes of links, but {place} has no collision '
            'geometry of two of them; set it to none.'
        )
    locked = [k for k in range(1, whole.njoints) if whole.names[k] not in names]
    if not locked:  # pinocchio refuses to reduce a model that has a link named as a joint
        return whole, meshes
    model, (geometry,) = pin.buildReducedModel(whole, [meshes], locked, pin.neutral(whole))
    return model, geometry


def _package_folders(place: str) -> list[str]:
    """Return where packages of meshes may be: in ROS workspaces, and around the file."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    paths = os.environ.get('ROS_PACKAGE_PATH', '').split(os.pathsep)
    around = [str(each) for each in Path(place).absolute().parents] if Path(place).exists() else []
    found = [*(f'{each}/share' for each in prefixes if each), *(each for each in paths if each)]
    return [*found, *around]


def _radius(body: Any) -> float:
    """Return the largest distance of a shape's points from the origin of its joint [m]."""
    body.geometry.computeLocalAABB()
    centre = np.asarray(body.placement.act(np.asarray(body.geometry.aabb_center)))
    return float(np.linalg.norm(centre) + body.geometry.aabb_radius)
