"""
Designed motions of random arms, looked at 10,000 times a second (excitation.md).

Places are those of pinocchio, and collisions those of coal with the meshes themselves; the design
has the chain and hulls.

"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
import time
from typing import Any
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio

from benchmarks.excitation import arm_of, random_motion
from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError
from lip_id_ros.excitation.planning import design_motion, ExcitingMotion
from lip_id_ros.excitation.self_collision import DRAWS
from lip_id_ros.excitation.settings import (
    ExcitationConfig,
    MotionSettings,
    SearchSettings,
    SpaceSettings,
)
from lip_id_ros.identification import fit
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.simulation.arm import panda_urdf

RATE_HZ = 1e4
QUICK = SearchSettings(draws=3, starts=1, steps=3)
MARGIN_M, DISTANCE_M, DEVIATIONS = 0.05, 0.02, 3.0
WITH_SHAPES = (
    'ur_description/urdf/ur5_robot.urdf',
    'panda_description/urdf/panda.urdf',
    'xarm_description/urdf/xarm7.urdf',
    'z1_description/urdf/z1.urdf',
)
GRIPPERS = ('panda_finger_joint1', 'panda_finger_joint2', 'jointGripper')
KINDS = ('limits of joints', 'floor and wall', 'self-collision', 'torques')

Shares = dict[str, float]
"""The most that a motion uses of each limit; more than 1 is beyond it."""


@dataclass(frozen=True)
class Case:
    """A motion to design, and what looks at it."""

    config: ExcitationConfig
    urdf: str | Path
    model: InverseDynamicsModel | None
    shares: Callable[[ExcitingMotion], Shares]


def main(arguments: list[str]) -> int:
    """Design and look; exit status 1 where a limit is passed."""
    parser = argparse.ArgumentParser(prog='benchmarks motion_limits', description=__doc__)
    parser.add_argument('--kinds', nargs='+', choices=KINDS, default=list(KINDS))
    parser.add_argument('--counts', nargs='+', type=int, default=[1000, 300, 100, 100])
    options = parser.parse_args(arguments)
    print(
        '| Limit | Motions | Refused postures | Beyond | Most of the limit | CPU s |\n|'
        + '---|' * 6
    )
    beyond = [_looked_at(*each) for each in zip(options.kinds, options.counts, strict=False)]
    return int(any(beyond))


def _looked_at(kind: str, count: int) -> bool:
    """Print a row of the table for each limit; return whether one was passed."""
    cases, refused = _cases(kind), 0
    found: list[Shares] = []
    started = time.process_time()
    while len(found) < count:
        case = next(cases)
        try:
            motion = design_motion(case.config, case.urdf, case.model)
        except ConfigError as error:
            if 'posture' not in str(error):
                raise
            refused += 1
            continue
        found.append(case.shares(motion))
    seconds = time.process_time() - started
    for name in found[0]:
        shares = np.array([each[name] for each in found])
        row = name, count, refused, np.sum(shares > 1.0), f'{shares.max():.6f}', f'{seconds:.0f}'
        print(f'| {" | ".join(map(str, row))} |', flush=True)
    return any(max(each.values()) > 1.0 for each in found)


def _cases(kind: str) -> Iterator[Case]:
    rng = np.random.default_rng(KINDS.index(kind))
    makers = dict(zip(KINDS, (_of_joints, _of_space, _of_shapes, _of_torques), strict=True))
    return makers[kind](rng)


def _of_joints(rng: np.random.Generator) -> Iterator[Case]:
    while True:
        config, urdf = _random_motion(rng)
        yield Case(config, urdf, None, _shares_of_joints)


def _random_motion(rng: np.random.Generator) -> tuple[ExcitationConfig, str]:
    """Draw an arm, limits of which now one and now another comes first, and a posture."""
    n = int(rng.integers(1, 8))
    lower = rng.uniform(-3.0, 1.0, n)
    upper = lower + 10.0 ** rng.uniform(-2.0, 0.8, n)
    largest = 10.0 ** rng.uniform(-1.0, [[1.0], [1.5], [2.5]], (3, n))
    posture = lower + np.clip(rng.beta(0.5, 0.5, n), 0.01, 0.99) * (upper - lower)
    motion = MotionSettings(
        posture=tuple(posture),
        duration_s=rng.uniform(0.3, 3.0),
        harmonics=int(rng.integers(2, 9)),
        rate_hz=1000.0,
        lower=tuple(lower),
        upper=tuple(upper),
        velocity=tuple(largest[0]),
        acceleration=tuple(largest[1]),
        jerk=tuple(largest[2]),
    )
    search = replace(QUICK, seed=int(rng.integers(1 << 30)))
    return ExcitationConfig(motion, search=search), _random_urdf(rng, n)


def _random_urdf(rng: np.random.Generator, n: int) -> str:
    """Draw a chain of turns and some slides."""
    robot = ET.Element('robot', name='random')
    ET.SubElement(robot, 'link', name='link_0')
    for i in range(n):
        kind = 'prismatic' if rng.uniform() < 0.2 else 'revolute'
        joint = ET.SubElement(robot, 'joint', name=f'joint_{i}', type=kind)
        ET.SubElement(joint, 'parent', link=f'link_{i}')
        ET.SubElement(joint, 'child', link=f'link_{i + 1}')
        xyz, rpy = rng.normal(0.0, 0.25, 3), rng.uniform(-np.pi, np.pi, 3)
        ET.SubElement(joint, 'origin', xyz=' '.join(map(str, xyz)), rpy=' '.join(map(str, rpy)))
        ET.SubElement(joint, 'axis', xyz='0 0 1')
        ET.SubElement(joint, 'limit', lower='-9', upper='9', velocity='9', effort='9')
        ET.SubElement(robot, 'link', name=f'link_{i + 1}')
    return ET.tostring(robot, encoding='unicode')


def _shares_of_joints(found: ExcitingMotion) -> Shares:
    t, limits = found.motion.times(RATE_HZ), found.limits
    q, *others = (found.motion.derivative(t, order) for order in range(4))
    middle, half = 0.5 * (limits.lower + limits.upper), 0.5 * (limits.upper - limits.lower)
    shares = {'position': float((np.abs(q - middle) / half).max())}
    names = ('velocity', 'acceleration', 'jerk')
    for name, values, largest in zip(names, others, limits.derivatives, strict=True):
        shares[name] = float((np.abs(values) / largest).max())
    return shares


def _of_space(rng: np.random.Generator) -> Iterator[Case]:
    """Put a floor and a wall near the posture of a random arm."""
    while True:
        config, urdf = _random_motion(rng)
        if len(config.motion.lower) < 2:
            continue
        model = pinocchio.buildModelFromXML(urdf)
        at_posture = _places(model, np.array([config.motion.posture]))
        floor = float(at_posture[..., 2].min() - MARGIN_M - 10.0 ** rng.uniform(-3.0, 0.0))
        wall = float(at_posture[..., 0].max() + MARGIN_M + 10.0 ** rng.uniform(-3.0, 0.0))
        space = SpaceSettings(
            floor_m=floor, boxes=(wall, -99.0, -99.0, wall + 0.1, 99.0, 99.0), margin_m=MARGIN_M
        )

        def shares(
            found: ExcitingMotion, model: Any = model, floor: float = floor, wall: float = wall
        ) -> Shares:
            places = _places(model, found.motion.derivative(found.motion.times(RATE_HZ), 0))
            high, near = places[..., 2].min() - floor, wall - places[..., 0].max()
            return {'floor': MARGIN_M / max(high, 1e-9), 'wall': MARGIN_M / max(near, 1e-9)}

        yield Case(replace(config, space=space), urdf, None, shares)


def _places(model: Any, q: Array) -> Array:
    """Return the origins of all joints but the first, and of the tool, (N, n, 3)."""
    data, out = model.createData(), []
    for row in q:
        pinocchio.forwardKinematics(model, data, row)
        origins = [
            data.oMi[model.parents[k]].act(model.jointPlacements[k].translation)
            for k in range(2, model.njoints)
        ]
        out.append([*origins, data.oMi[model.njoints - 1].translation.copy()])
    return np.array(out)


def _of_shapes(rng: np.random.Generator) -> Iterator[Case]:
    """Take arms whose links have meshes, from random postures."""
    paths = [panda_urdf().parents[2] / each for each in WITH_SHAPES]
    looks = [_Collisions(path) for path in paths]
    while True:
        arm = int(rng.integers(len(paths)))
        low, high = looks[arm].middle_range
        motion = MotionSettings(
            joints=looks[arm].names,
            posture=tuple(rng.uniform(low, high).tolist()),
            duration_s=rng.uniform(1.0, 2.0),
            velocity=(float(rng.uniform(1.0, 6.0)),),
        )
        space = SpaceSettings(self_distance_m=DISTANCE_M)
        search = replace(QUICK, seed=int(rng.integers(1 << 30)))
        config = ExcitationConfig(motion, space, search)
        yield Case(config, paths[arm], None, looks[arm].shares)


class _Collisions:
    """Meshes of an arm, all pairs but neighbours and those that touch wherever it is."""

    def __init__(self, path: Path) -> None:
        whole = pinocchio.buildModelFromUrdf(str(path))
        meshes = pinocchio.buildGeomFromUrdf(
            whole, str(path), pinocchio.GeometryType.COLLISION,
            package_dirs=[str(each) for each in path.parents],
        )  # fmt: skip
        locked = [whole.getJointId(each) for each in GRIPPERS if whole.existJointName(each)]
        self._model, self._meshes = whole, meshes
        if locked:
            self._model, (self._meshes,) = pinocchio.buildReducedModel(
                whole, [meshes], locked, pinocchio.neutral(whole)
            )
        self.names = tuple(self._model.names)[1:]
        low, high = self._model.lowerPositionLimit, self._model.upperPositionLimit
        self.middle_range = 0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high
        parents = [each.parentJoint for each in self._meshes.geometryObjects]
        for b, a in zip(*np.tril_indices(len(parents), -1), strict=True):
            if abs(parents[a] - parents[b]) > 1:
                self._meshes.addCollisionPair(pinocchio.CollisionPair(int(a), int(b)))
        self._data = self._model.createData()
        rng, touches = np.random.default_rng(0), []
        for _ in range(DRAWS):
            touches.append(self._touching(rng.uniform(low, high)))
        for pair in np.flatnonzero(np.all(touches, axis=0))[::-1]:
            self._meshes.removeCollisionPair(self._meshes.collisionPairs[int(pair)])

    def shares(self, found: ExcitingMotion) -> Shares:
        """Return 2 where links touch at some time, else 0."""
        q = found.motion.derivative(found.motion.times(RATE_HZ), 0)
        return {'self-collision': 2.0 * any(self._touching(row).any() for row in q)}

    def _touching(self, q: Array) -> Array:
        found = self._meshes.createData()
        pinocchio.computeCollisions(self._model, self._data, self._meshes, found, q, False)
        return np.array([each.isCollision() for each in found.collisionResults])


def _of_torques(rng: np.random.Generator) -> Iterator[Case]:
    """Limit the torques that the model of a Panda predicts, from random postures."""
    arm = arm_of('Panda', 'mild')
    model = fit(arm.record(random_motion(arm, 0), rng))
    low, high = arm.limits.lower, arm.limits.upper
    while True:
        limit = (0.9 * rng.uniform(0.2, 1.0) * arm.noise / 0.004).tolist()
        motion = replace(
            arm.motion,
            posture=tuple(rng.uniform(0.75 * low + 0.25 * high, 0.25 * low + 0.75 * high)),
            duration_s=rng.uniform(1.0, 3.0),
            torque_limits=tuple(limit),
            jerk=(1e4,),
            acceleration=(60.0,),
        )

        def shares(found: ExcitingMotion, limit: list[float] = limit) -> Shares:
            states = found.motion.sample(found.motion.times(RATE_HZ))
            size = np.abs(model.predict(*states).tau) + DEVIATIONS * model.torque_std(*states)
            return {'torque': float((size / limit).max())}

        search = replace(QUICK, seed=int(rng.integers(1 << 30)))
        yield Case(ExcitationConfig(motion, search=search), arm.urdf, model, shares)
