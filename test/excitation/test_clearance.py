"""Links keep their distances at every time, or a posture is refused by name."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib import metadata
from pathlib import Path
import sys

from excitation.cases import ARM, SEEDS
from hypothesis import assume, given
from hypothesis import settings as tries
import numpy as np
import pytest

import lip_id_ros as lip
from lip_id_ros.arrays import Array
from lip_id_ros.description.urdf import moving_joints, parse_description
from lip_id_ros.excitation.clearance import Clearance, clearance_of
from lip_id_ros.excitation.joint_limits import JointLimits, limits_from
from lip_id_ros.excitation.planning import design_motion
from lip_id_ros.excitation.series import FourierMotion
from lip_id_ros.excitation.settings import (
    ExcitationConfig,
    MotionSettings,
    SearchSettings,
    SpaceSettings,
)
from lip_id_ros.excitation.shapes import described_shapes

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
    <origin xyz="0 0 0"/><geometry><sphere radius="0.1"/></geometry>
  </collision></link>
"""
JOINT = """
  <joint name="{name}" type="revolute">
    <parent link="{parent}"/><child link="link_{name}"/>
    <origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2.9" upper="2.9" velocity="2" effort="50"/>
  </joint>
"""
FEW = SearchSettings(draws=6)
APART = SpaceSettings(floor_m='none', radius_m=0.01)  # of the base, which has no shape
UNCHECKED = replace(APART, self_distance_m='none')
EVERYTHING = SpaceSettings(
    floor_m=-0.5,
    boxes=(0.6, -0.1, 0.6, 0.9, 0.1, 0.9, -2.0, -0.2, 0.1, -1.0, 0.2, 0.5),
    keep_in=(-1.2, -1.0, -1.0, 1.5, 1.0, 1.1),
    tool=(0.5, 0.0, 0.1),
    margin_m=0.02,
)


def planar_arm(shape: str = SHAPE) -> str:
    """Return three links in a plane: the last one can fold onto the first."""
    links = ''.join(shape.format(name=name) for name in NAMES)
    parents = ('base', 'link_a', 'link_b')
    joints = ''.join(
        JOINT.format(name=name, parent=parent, x=0.4 * (k > 0))
        for k, (name, parent) in enumerate(zip(NAMES, parents, strict=True))
    )
    return f'<robot name="planar"><link name="base"/>{links}{joints}</robot>'


UPRIGHT = planar_arm().replace('<axis xyz="0 0 1"/>', '<axis xyz="0 1 0"/>')


def limits() -> JointLimits:
    return limits_from(MotionSettings(), NAMES, (planar_arm(), 'planar'))


def checked(space: SpaceSettings = APART, urdf: str = '') -> Clearance:
    description = parse_description(urdf or planar_arm(), 'planar', NAMES, ('revolute',) * 3)
    found, _ = clearance_of(space, description, limits(), None)
    assert found is not None
    return found


def settings(
    space: SpaceSettings, posture: tuple[float, ...] = (0.0, 1.75, 1.75)
) -> ExcitationConfig:
    motion = MotionSettings(posture=posture, duration_s=15.0, size=1.0)
    return ExcitationConfig(motion, space, FEW)


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


def test_motions_keep_the_links_apart() -> None:
    alone, apart = (
        [
            design_motion(
                replace(settings(space), search=SearchSettings(draws=1, seed=seed)), planar_arm()
            )
            for seed in range(6)
        ]
        for space in (UNCHECKED, APART)
    )
    assert min(nearest(each, 200.0) for each in alone) < 0.0
    assert alone[0].unchecked.startswith(
        'Nobody has checked the floor and self-collision: the settings say so.'
    )
    distances = [nearest(each, 200.0) for each in apart]
    assert 0.05 <= min(distances) < 0.08
    # they are still motions
    assert min(np.ptp(each.trajectory.q, axis=0).min() for each in apart) > 0.1


@cache
def coupled(urdf: str, *couplings: float) -> tuple[Clearance, JointLimits]:
    """Return links with everything around them, whose joints follow the one before."""
    names, types = moving_joints(urdf, 'arm')
    matrix = np.eye(3) + np.diag(couplings, -1)
    shapes = described_shapes(parse_description(urdf, 'arm', names, types), EVERYTHING)
    ranges = limits_from(MotionSettings(), names, (urdf, 'arm'))
    return Clearance(shapes, ranges, matrix, EVERYTHING), ranges


@pytest.mark.parametrize('urdf', [UPRIGHT, ARM], ids=['turns', 'slide'])
@given(SEEDS)
def test_nothing_approaches_faster_than_is_taken(urdf: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    links, ranges = coupled(urdf, *rng.choice([0.0, -1.0, 0.5], 2).tolist())
    q = rng.uniform(ranges.lower, ranges.upper)
    step = 0.1 * (rng.uniform(ranges.lower, ranges.upper) - q)
    change = np.abs(links.distances(q + step) - links.distances(q))
    assert np.all(change <= links.approach(np.abs(step)) + 1e-6)


def balls(q: Array) -> Array:
    """Return centres, shape (N, K, 3), of balls of 0.04 m in the cylinders, and the tool last."""
    angles, places = np.cumsum(q, axis=1), []
    start = np.zeros((len(q), 3))
    for angle in angles.T:
        along = np.stack([np.cos(angle), 0.0 * angle, -np.sin(angle)], axis=1)
        places += [start + share * along for share in np.linspace(0.08, 0.32, 9)]
        start = start + 0.4 * along
    up = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    return np.stack([*places, start - 0.4 * along + 0.5 * along + 0.1 * up], axis=1)


@given(SEEDS)
@tries(max_examples=15)
def test_no_distance_is_passed_at_any_time(seed: int) -> None:
    rng = np.random.default_rng(seed)
    posture = (*rng.uniform([-0.6, -0.3, -0.3], [0.2, 0.3, 0.3]).tolist(),)
    config = replace(settings(EVERYTHING, posture), search=SearchSettings(draws=1, seed=seed))
    config = replace(config, motion=replace(config.motion, duration_s=3.0))
    try:
        motion = design_motion(config, UPRIGHT).motion
    except lip.ConfigError:  # the posture is too near
        assume(False)
    places = balls(motion.derivative(motion.times(500.0), 0))
    radii = np.append(np.full(places.shape[1] - 1, 0.04), 0.0)
    least = radii + EVERYTHING.margin_m
    later = slice(9, None)  # the first link may stand in the floor
    assert np.all(places[:, later, 2] + 0.5 >= least[later])
    for low, high in np.reshape(EVERYTHING.boxes, (2, 2, 3)):
        beyond = np.maximum(np.maximum(low - places, places - high), 0.0)
        assert np.all(np.linalg.norm(beyond, axis=2) >= least)
    low, high = np.reshape(EVERYTHING.keep_in, (2, 3))
    assert np.all(np.minimum(places - low, high - places).min(axis=2) >= least)


def test_a_wall_that_lies_between_two_samples_is_not_passed() -> None:
    """The tool goes through a wall of 2 mm at 8 m/s."""
    wall = (1.25, 0.0115, -0.2, 1.4, 0.0135, 0.2)
    space = replace(UNCHECKED, boxes=wall, tool=(0.5, 0.0, 0.0), margin_m=0.001)
    links, swing = checked(space), np.zeros((3, 4))
    swing[0, 2] = 1.0
    motion = FourierMotion(np.zeros(3), swing, 1.0)
    assert links.is_kept(motion, fine=False)
    assert not links.is_kept(motion, fine=True)
    assert links.is_kept(motion.scaled(0.0), fine=True)


REFUSED = {
    'links': (APART, (0.0, 2.2, 2.2), r'link_a and link_c must be 0\.056 m apart at the posture'),
    'floor': (SpaceSettings(), (0.5, 0.5, 0.5), 'link_c and the floor must be .* choose another'),
    'box': (
        replace(UNCHECKED, boxes=(0.3, -1.0, -1.0, 0.5, 1.0, 1.0)),
        (0.0, 0.0, 0.0),
        r'link_a and box 1 of space\.boxes must be .* or correct the section space',
    ),
    'ends': (
        replace(UNCHECKED, keep_in=(-2.0, -1.0, -1.0, 1.0, 1.0, 1.0)),
        (0.0, 0.0, 0.0),
        r'link_c and the end of space\.keep_in at x = 1 must be 0\.056 m apart at the posture',
    ),
    'numbers': (
        replace(UNCHECKED, boxes=(1.0, 2.0)),
        (0.0, 0.0, 0.0),
        r'space\.boxes needs 6 numbers for each box, .* but has 2; correct it',
    ),
    'corners': (
        replace(UNCHECKED, keep_in=(1.0, 0.0, 0.0, 0.0, 1.0, 1.0)),
        (0.0, 0.0, 0.0),
        r'space\.keep_in has a box whose lowest corner is not below its highest one',
    ),
    'tool': (
        replace(UNCHECKED, tool=(1.0,)),
        (0.0, 0.0, 0.0),
        r'space\.tool needs x, y and z of the tool, but has 1 numbers',
    ),
}


@pytest.mark.parametrize('case', REFUSED)
def test_what_is_too_near_or_makes_no_sense_is_refused_by_name(case: str) -> None:
    space, posture, sentence = REFUSED[case]
    with pytest.raises(lip.ConfigError, match=sentence):
        design_motion(settings(space, posture), UPRIGHT)


def test_the_floor_is_where_the_arm_is_mounted() -> None:
    """On a table in the frame of the file, 1 m high."""
    table = '<link name="table"/><joint name="on" type="fixed"><parent link="table"/>'
    table += '<child link="base"/><origin xyz="0.5 0 1"/></joint></robot>'
    on_table = ARM.replace('</robot>', table)
    motion = MotionSettings(duration_s=4.0, posture=(0.0, 0.2, 0.3), size=1.0)
    config = ExcitationConfig(motion, SpaceSettings(radius_m=0.03), SearchSettings(draws=3))
    found, lower = design_motion(config, on_table), design_motion(config, ARM)
    np.testing.assert_allclose(found.trajectory.q, lower.trajectory.q)
    assert found.extremes is not None
    assert lower.extremes is not None
    assert found.extremes.lowest[1] == pytest.approx(lower.extremes.lowest[1])
    assert found.extremes.farthest[1] == pytest.approx(lower.extremes.farthest[1])


def test_without_a_posture_one_with_room_around_it_is_taken() -> None:
    """Where the first and the last link are too near at the middles of the ranges."""
    motion = MotionSettings(lower=(-2.9, 1.5, 1.5), upper=(2.9, 2.9, 2.9), duration_s=15.0)
    found = design_motion(ExcitationConfig(motion, APART, FEW), planar_arm())
    np.testing.assert_array_less(found.motion.posture[1:], 2.2)
    assert nearest(found, 200.0) >= 0.05
    assert np.ptp(found.trajectory.q, axis=0).min() > 0.05
    free = replace(motion, lower=(-2.9,), upper=(2.9,))
    found = design_motion(ExcitationConfig(free, APART, FEW), planar_arm())
    np.testing.assert_array_equal(found.motion.posture, 0.0)


def test_a_fixed_joint_may_have_the_name_of_its_link() -> None:
    """Between two that move, as in the URDF of a Unitree Z1."""
    between = '<link name="between"/><joint name="between" type="fixed"><parent link="link_b"/>'
    urdf = planar_arm().replace('<parent link="link_b"/>', '<parent link="between"/>')
    urdf = urdf.replace('</robot>', f'{between}<child link="between"/></joint></robot>')
    links = checked(urdf=urdf)
    np.testing.assert_allclose(links.distances(np.ones(3)), checked().distances(np.ones(3)))


@pytest.mark.parametrize(('radius', 'count'), [(0.45, 1), (0.39, 2)])
def test_links_that_are_built_to_touch_are_left_out(radius: float, count: int) -> None:
    """Spheres around the joints: the first and the last are 0.8 m apart, or the base from it."""
    links = checked(urdf=planar_arm(SPHERE.replace('0.1"', f'{radius}"')))
    assert links.distances(np.zeros(3)).size == count


def test_links_whose_meshes_are_lost_count_as_thick(tmp_path: Path) -> None:
    mesh = '<mesh filename="package://lost/{name}.stl"/>'
    shape = f'<collision><geometry>{mesh}</geometry></collision>'
    urdf = planar_arm().replace(
        '<link name="base"/>', f'<link name="base">{shape.format(name="base")}</link>'
    )
    path = tmp_path / 'arm.urdf'
    path.write_text(urdf)
    found = design_motion(settings(APART), path)
    assert found.unchecked == (
        'Nobody has checked the floor: the settings say so. No shapes are at hand of the base '
        '(Mesh package://lost/base.stl could not be found): space.radius_m, 0.01 m, is taken for '
        'half the thickness.'
    )
    path.write_text(planar_arm(f'<link name="link_{{name}}">{shape}</link>'))
    found = design_motion(settings(replace(APART, radius_m=0.04)), path)
    assert 'No shapes are at hand of link_a, link_b, link_c (Mesh' in found.unchecked
    assert nearest(found, 200.0) >= 0.05


def test_without_pinocchio_a_urdf_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'pinocchio', None)
    with pytest.raises(lip.ConfigError, match='need pinocchio, which is not installed'):
        design_motion(settings(APART), planar_arm())


@pytest.mark.slow
def test_a_ur5_stays_above_its_table_and_off_itself() -> None:
    """By the meshes themselves, in folders around the file, with the usual settings."""
    files = metadata.files('example-robot-data') or []
    (found,) = (each for each in files if str(each).endswith('urdf/ur5_robot.urdf'))
    path = Path(str(found.locate())).resolve()
    motion = design_motion(ExcitationConfig(search=FEW), path)
    model = pinocchio.buildModelFromUrdf(str(path))
    folders = [str(each) for each in path.parents]
    meshes = pinocchio.buildGeomFromUrdf(
        model, str(path), pinocchio.GeometryType.COLLISION, package_dirs=folders
    )
    objects = meshes.geometryObjects
    for b, second in enumerate(objects):
        for a, first in enumerate(objects[:b]):
            if abs(first.parentJoint - second.parentJoint) > 1:
                meshes.addCollisionPair(pinocchio.CollisionPair(a, b))
    data, result = model.createData(), meshes.createData()
    arm = [k for k, each in enumerate(objects) if each.parentJoint > 2]
    for q in motion.motion.derivative(motion.motion.times(200.0), 0):
        assert not pinocchio.computeCollisions(model, data, meshes, result, q, True)
        for k in arm:
            assert result.oMg[k].translation[2] > 0.05
    assert np.ptp(motion.trajectory.q, axis=0).min() > 0.5
