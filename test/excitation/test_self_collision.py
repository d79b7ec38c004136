"""Links are kept apart from each other at every time, or a posture is refused by name."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path
import sys

from excitation.cases import SEEDS
from hypothesis import given
import numpy as np
import pytest

import lip_id_ros as lip
from lip_id_ros.arrays import Array
from lip_id_ros.excitation.joint_limits import JointLimits, limits_from
from lip_id_ros.excitation.planning import design_motion
from lip_id_ros.excitation.self_collision import SelfCollision
from lip_id_ros.excitation.settings import (
    ExcitationConfig,
    MotionSettings,
    SearchSettings,
    SpaceSettings,
)

pinocchio = pytest.importorskip('pinocchio', reason='needs the extra sim')

NAMES = ('a', 'b', 'c')
SHAPE = """
  <link name="link_{name}">
    <collision>
      <origin xyz="0.2 0 0" rpy="0 1.5708 0"/>
      <geometry><cylinder radius="0.04" length="0.32"/></geometry>
    </collision>
  </link>
"""
SPHERE = """
  <link name="link_{name}"><collision>
    <origin xyz="0.2 0 0"/><geometry><sphere radius="0.1"/></geometry>
  </collision></link>
"""
JOINT = """
  <joint name="{name}" type="revolute">
    <parent link="{parent}"/><child link="link_{name}"/>
    <origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2.9" upper="2.9" velocity="2" effort="50"/>
  </joint>
"""
FEW = SearchSettings(draws=6, starts=1, steps=5)


def planar_arm(shape: str = SHAPE) -> str:
    """Return three links in a plane: the last one can fold onto the first."""
    links = ''.join(shape.format(name=name) for name in NAMES)
    parents = ('base', 'link_a', 'link_b')
    joints = ''.join(
        JOINT.format(name=name, parent=parent, x=0.4 * (k > 0))
        for k, (name, parent) in enumerate(zip(NAMES, parents, strict=True))
    )
    return f'<robot name="planar"><link name="base"/>{links}{joints}</robot>'


def limits() -> JointLimits:
    return limits_from(MotionSettings(), NAMES, (planar_arm(), 'planar'))


def checked(distance: float = 0.05, matrix: Array | None = None) -> SelfCollision:
    urdf = planar_arm(), 'planar'
    return SelfCollision(urdf, limits(), np.eye(3) if matrix is None else matrix, distance)


def settings(
    distance: float | str, posture: tuple[float, ...] = (0.0, 1.75, 1.75)
) -> ExcitationConfig:
    return ExcitationConfig(
        MotionSettings(posture=posture, duration_s=15.0),
        SpaceSettings(self_distance_m=distance),
        FEW,
    )


def nearest(motion: lip.ExcitingMotion, rate: float) -> float:
    """Return how near the first and the last link come, by pinocchio alone [m]."""
    model = pinocchio.buildModelFromXML(planar_arm())
    shapes = pinocchio.buildGeomFromUrdfString(
        model, planar_arm(), pinocchio.GeometryType.COLLISION
    )
    shapes.addCollisionPair(pinocchio.CollisionPair(0, 2))
    data, found = model.createData(), shapes.createData()
    q = motion.motion.derivative(motion.motion.times(rate), 0)
    distances = []
    for row in q:
        pinocchio.computeDistances(model, data, shapes, found, row)
        distances.append(found.distanceResults[0].min_distance)
    return float(min(distances))


def test_a_motion_keeps_the_links_apart() -> None:
    alone = design_motion(settings('none'), planar_arm())
    assert nearest(alone, 200.0) < 0.0
    apart = design_motion(settings(0.05), planar_arm())
    assert nearest(apart, 1000.0) > 0.0
    assert nearest(apart, 10.0) > 0.03
    # it is still a motion
    assert np.ptp(apart.trajectory.q, axis=0).min() > 0.3


@given(SEEDS)
def test_links_approach_no_faster_than_is_taken(seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = np.eye(3) + np.diag(rng.choice([0.0, -1.0, 0.5], 2), -1)
    links = checked(matrix=matrix)
    q, step = rng.uniform(-2.0, 2.0, 3), rng.uniform(-0.3, 0.3, 3)
    change = np.abs(links.distances(q + step) - links.distances(q))
    assert np.all(change <= links.approach(np.abs(step)) + 1e-6)


@given(SEEDS)
def test_the_penalty_has_its_gradient(seed: int) -> None:
    urdf = planar_arm(SPHERE), 'planar'  # with cylinders it has corners
    links, rng = SelfCollision(urdf, limits(), np.eye(3), 0.3), np.random.default_rng(seed)
    q = np.array([0.0, 1.9, 1.9]) + rng.uniform(-0.2, 0.2, (4, 3))
    still = np.zeros_like(q)

    def value(x: Array) -> float:
        return links.penalty(x.reshape(q.shape), still, still)[0]

    slopes = links.penalty(q, still, still)[1]
    steps = 1e-4 * np.eye(q.size)
    expected = [(value(q.ravel() + h) - value(q.ravel() - h)) / 2e-4 for h in steps]
    assert value(q.ravel()) > 0.0
    assert not slopes[1:].any()
    np.testing.assert_allclose(slopes[0].ravel(), expected, atol=1e-4 * np.abs(expected).max())


def test_a_posture_in_which_links_are_too_near_is_refused_by_their_names() -> None:
    with pytest.raises(lip.ConfigError, match=r'link_a_0 and link_c_0 must be 0\.05 m apart'):
        design_motion(settings(0.05, (0.0, 2.2, 2.2)), planar_arm())


def test_a_fixed_joint_may_have_the_name_of_its_link() -> None:
    """Between two that move, as in the URDF of a Unitree Z1."""
    between = '<link name="between"/><joint name="between" type="fixed"><parent link="link_b"/>'
    urdf = planar_arm().replace('<parent link="link_b"/>', '<parent link="between"/>')
    urdf = urdf.replace('</robot>', f'{between}<child link="between"/></joint></robot>')
    links = SelfCollision((urdf, 'planar'), limits(), np.eye(3), 0.05)
    np.testing.assert_allclose(links.distances(np.ones(3)), checked().distances(np.ones(3)))


@pytest.mark.parametrize(('radius', 'count'), [(0.45, 0), (0.39, 1)])
def test_links_that_are_built_to_touch_are_left_out(radius: float, count: int) -> None:
    """Spheres around the joints: those of the first and the last are 0.8 m apart at most."""
    shape = SPHERE.replace('0.2 0 0', '0 0 0').replace('0.1"', f'{radius}"')
    config = settings(0.01, (0.0, 0.1, 0.1))
    motion = design_motion(config, planar_arm(shape))
    assert motion.trajectory.q.any()
    links = SelfCollision((planar_arm(shape), 'planar'), limits(), np.eye(3), 0.01)
    assert links.distances(np.zeros(3)).size == count


def test_what_is_lacking_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(lip.ConfigError, match='needs the shapes of the links, but there is no'):
        design_motion(without_urdf())
    with pytest.raises(lip.ConfigError, match='no collision geometry of two of them'):
        design_motion(settings(0.05), planar_arm('<link name="link_{name}"/>'))
    mesh = '<mesh filename="package://lost/{name}.stl"/>'
    shape = f'<collision><geometry>{mesh}</geometry></collision>'
    path = tmp_path / 'arm.urdf'
    path.write_text(planar_arm(f'<link name="link_{{name}}">{shape}</link>'))
    with pytest.raises(lip.ConfigError, match=r'needs the meshes that .*arm\.urdf names'):
        design_motion(settings(0.05), path)
    monkeypatch.setitem(sys.modules, 'pinocchio', None)
    with pytest.raises(lip.ConfigError, match='needs pinocchio, which is not installed'):
        design_motion(settings(0.05), planar_arm())


def without_urdf() -> ExcitationConfig:
    """Return settings that need no URDF but for the shapes."""
    motion = MotionSettings(
        joints=NAMES, posture=(0.0,), lower=(-1.0,), upper=(1.0,), velocity=(1.0,)
    )
    return ExcitationConfig(motion, SpaceSettings(self_distance_m=0.05), FEW)


@pytest.mark.slow
def test_meshes_count_as_their_hulls() -> None:
    """The hulls of a UR5's links, in folders around the file."""
    files = metadata.files('example-robot-data') or []
    (found,) = (each for each in files if str(each).endswith('urdf/ur5_robot.urdf'))
    path = Path(str(found.locate())).resolve()
    config = ExcitationConfig(
        MotionSettings(posture=(0.0, -1.2, 1.0, -1.0, -1.5, 0.0), duration_s=10.0, share=0.5),
        SpaceSettings(self_distance_m=0.02),
        FEW,
    )
    motion = design_motion(config, path)
    model = pinocchio.buildModelFromUrdf(str(path))
    folders = [str(each) for each in path.parents]
    meshes = pinocchio.buildGeomFromUrdf(
        model, str(path), pinocchio.GeometryType.COLLISION, package_dirs=folders
    )
    for b in range(len(meshes.geometryObjects)):
        for a in range(b):
            parents = [meshes.geometryObjects[k].parentJoint for k in (a, b)]
            if abs(parents[0] - parents[1]) > 1:
                meshes.addCollisionPair(pinocchio.CollisionPair(a, b))
    data, result = model.createData(), meshes.createData()
    for q in motion.motion.derivative(motion.motion.times(200.0), 0):
        assert not pinocchio.computeCollisions(model, data, meshes, result, q, True)
