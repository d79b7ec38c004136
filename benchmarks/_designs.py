"""Designed motions of arms by their URDFs, looked at 200 times a second by pinocchio and coal."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
import time

import numpy as np
import pinocchio

from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.planning import design_motion, ExcitingMotion
from lip_id_ros.excitation.settings import ExcitationConfig, MotionSettings, SearchSettings
from lip_id_ros.excitation.shapes import outline, without_meshes
from lip_id_ros.simulation.arm import panda_urdf

RATE_HZ, DRAWS = 200.0, 300
APART_M = 0.1
"""Links that are never so far apart keep less than the usual distance."""

ROBOTS = panda_urdf().parents[2]
ARMS = {
    'UR5': (ROBOTS / 'ur_description/urdf/ur5_robot.urdf', 'base_link', ()),
    'Panda': (panda_urdf(), 'panda_link0', tuple(f'panda_joint{i}' for i in range(1, 8))),
    'xArm7': (ROBOTS / 'xarm_description/urdf/xarm7.urdf', 'link_base', ()),
    'LWR': (Path('urdf/kuka_lwr4_flobaroid.urdf'), 'lwr_base_link', ()),
}  # URDF, link that carries the first joint, joints; the last one in the folder of the data


@dataclass(frozen=True)
class Seen:
    """
    Least height above the base plane of all links but the first, and least distances [m].

    `beyond`: the height of those from the third on.
    """

    height: float
    link: str
    beyond: float
    distance: float
    always_near: float


LEAST = 'beyond', 'distance', 'always_near'


class Look:
    """An arm as pinocchio has it, with the hulls of its links; lost meshes are left out."""

    def __init__(self, path: Path, base: str, joints: tuple[str, ...]) -> None:
        whole, kind = pinocchio.buildModelFromUrdf(str(path)), pinocchio.GeometryType.COLLISION
        folders = [str(each) for each in path.parents]
        try:
            shapes = pinocchio.buildGeomFromUrdf(whole, str(path), kind, package_dirs=folders)
        except ValueError as error:
            print(f'{path.name}: {error}')
            text = without_meshes(path.read_text())
            shapes = pinocchio.buildGeomFromUrdfString(whole, text, kind)
        names = [name for name in whole.names[1:] if name not in joints] if joints else []
        locked = [whole.getJointId(name) for name in names]
        self._model = whole
        if locked:
            rest = pinocchio.neutral(whole)
            self._model, (shapes,) = pinocchio.buildReducedModel(whole, [shapes], locked, rest)
        self._data, self._shapes = self._model.createData(), shapes
        pinocchio.framesForwardKinematics(self._model, self._data, pinocchio.neutral(self._model))
        self._base = self._data.oMf[self._model.getFrameId(base)].translation[2]
        objects = shapes.geometryObjects
        for each in objects:
            if hasattr(each.geometry, 'buildConvexHull'):
                each.geometry.buildConvexHull(True, 'Qt')
                each.geometry = each.geometry.convex
        self._outlines = [outline(each.geometry) for each in objects]
        for b, second in enumerate(objects):
            for a, first in enumerate(objects[:b]):
                if abs(second.parentJoint - first.parentJoint) > 1:
                    shapes.addCollisionPair(pinocchio.CollisionPair(a, b))
        self._found = shapes.createData()
        rng = np.random.default_rng(1)
        low, high = self._model.lowerPositionLimit, self._model.upperPositionLimit
        farthest = np.max(
            [self._distances(q) for q in rng.uniform(low, high, (DRAWS, len(low)))], 0
        )
        self._touching, self._near = farthest <= 0.002, farthest < APART_M

    def at(self, found: ExcitingMotion) -> Seen:
        """Look at a motion."""
        heights, distances = [], []
        q = found.motion.derivative(found.motion.times(RATE_HZ), 0)
        objects = self._shapes.geometryObjects
        arm = [k for k, each in enumerate(objects) if each.parentJoint > 1]
        for row in q:
            distances.append(self._distances(row))
            heights.append([self._lowest(k) for k in arm])
        lowest = np.min(heights, axis=0) - self._base
        apart = np.min(distances, axis=0)
        usual, near = ~self._near, self._near & ~self._touching
        return Seen(
            float(lowest.min()),
            objects[arm[int(lowest.argmin())]].name,
            float(min(z for k, z in zip(arm, lowest, strict=True) if objects[k].parentJoint > 2)),
            float(apart[usual].min()),
            float(apart[near].min(initial=np.inf)),
        )

    def _distances(self, q: Array) -> Array:
        pinocchio.computeDistances(self._model, self._data, self._shapes, self._found, q)
        return np.array([each.min_distance for each in self._found.distanceResults])

    def _lowest(self, number: int) -> float:
        (points, radius), place = self._outlines[number], self._found.oMg[number]
        return float((points @ place.rotation[2]).min() + place.translation[2] - radius)


def designs(count: int, arms: list[str], data: Path) -> None:
    """Print a row for each arm: designs with the usual settings, each with another seed."""
    header = (
        *('Arm', 'Designs', 'Refused', 'CPU s each', 'Lowest point [m]', 'of'),
        *('from the third link on [m]', 'Links apart [m]', 'always near [m]', 'Way in the range'),
    )
    print(f'| {" | ".join(header)} |\n|{"---|" * len(header)}', flush=True)
    for name in arms:
        path, base, joints = ARMS[name]
        path = path if path.is_absolute() else data / path
        look, seen, ways, refused = Look(path, base, joints), list[Seen](), list[float](), 0
        started = time.process_time()
        for seed in range(count):
            config = ExcitationConfig(MotionSettings(joints), search=SearchSettings(seed=seed))
            try:
                found = design_motion(config, path)
            except ConfigError as error:
                refused += 1
                print(error)
                continue
            seen.append(look.at(found))
            limits = found.limits
            ways.append(
                float(np.mean(np.ptp(found.trajectory.q, 0) / (limits.upper - limits.lower)))
            )
        seconds = (time.process_time() - started) / count
        lowest = min(seen, key=lambda each: each.height)
        least = [min(getattr(each, key) for each in seen) for key in LEAST]
        figures = [f'{x:.4f}' for x in least]
        row = [
            name,
            f'{count}',
            f'{refused}',
            f'{seconds:.1f}',
            f'{lowest.height:.4f}',
            lowest.link,
        ]
        print(f'| {" | ".join([*row, *figures, f"{np.median(ways):.2f}"])} |', flush=True)
