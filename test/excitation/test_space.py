"""Floor, boxes and the box to stay in: kept at every time, or refused by name."""

from __future__ import annotations

from dataclasses import replace

from excitation.cases import ARM, random_limits, random_posture, SEEDS
from hypothesis import assume, given
import numpy as np
import pytest
from rigid_body.arms import random_chain
from scipy.optimize import check_grad

import lip_id_ros as lip
from lip_id_ros.arrays import Array
from lip_id_ros.excitation.constraints import Constraints
from lip_id_ros.excitation.joint_limits import JointLimits
from lip_id_ros.excitation.series import FourierMotion, LimitedMotions
from lip_id_ros.excitation.settings import SpaceSettings
from lip_id_ros.excitation.space import FINE_HZ, Space
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.chain import joint_transform
from lip_id_ros.rigid_body.couplings import Coupling, coupling_matrix, rows_of

BOXES = SpaceSettings(
    floor_m=-1.0,
    boxes=(-0.5, -0.5, 0.5, 0.5, 0.5, 1.0, 0.6, -2.0, -1.0, 0.9, 2.0, 2.0),
    keep_in=(-2.0, -1.5, -1.5, 2.0, 1.5, 1.8),
    tool=(0.1, 0.0, 0.2),
    margin_m=0.02,
)


def random_arm(rng: np.random.Generator) -> Chain:
    """Draw an arm of which every other one has coupled positions."""
    arm = ''.join(rng.choice(['R', 'R', 'P'], size=rng.integers(2, 7)))
    couplings = [Coupling(0, 1, 0.5), Coupling(len(arm) - 1, 0, -1.0)][: rng.choice([0, 2])]
    return random_chain(arm, rng)._replace(couplings=rows_of(couplings))


def random_space(seed: int, settings: SpaceSettings = BOXES) -> tuple[Space, Chain, Array]:
    rng = np.random.default_rng(seed)
    chain = random_arm(rng)
    limits = random_limits(rng, len(chain.prismatic))
    return Space(settings, chain, limits), chain, random_posture(rng, limits)


def walked(chain: Chain, tool: Array, q: Array) -> Array:
    place, points, q = np.eye(4), [], coupling_matrix(chain) @ q
    for j in range(len(q)):
        rest = np.eye(4)
        rest[:3, 3] = chain.translations[j]
        points.append((place @ rest)[:3, 3])
        found = joint_transform(chain, j, q[j])
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = np.array(found.rotation).T, found.translation
        place = place @ step
    return np.array([*points[1:], (place @ np.append(tool, 1.0))[:3]])


@given(SEEDS)
def test_places_are_those_of_the_transforms(seed: int) -> None:
    space, chain, q = random_space(seed)
    expected = walked(chain, np.array(BOXES.tool), q)
    points, slopes = space.points(q[None])
    np.testing.assert_allclose(points[0], expected, atol=1e-10 * (1.0 + np.abs(expected).max()))
    h = 1e-6
    for j in range(len(q)):
        ends = [space.points((q + s * h * np.eye(len(q))[j])[None])[0][0] for s in (1, -1)]
        np.testing.assert_allclose(slopes[0, :, j], (ends[0] - ends[1]) / (2 * h), atol=1e-6)


@given(SEEDS)
def test_no_point_is_faster_than_its_reach(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = random_arm(rng)
    limits = random_limits(rng, len(chain.prismatic))
    space = Space(BOXES, chain, limits)
    q = rng.uniform(limits.lower, limits.upper, (20, len(limits.lower)))
    speeds = np.linalg.norm(space.points(q)[1], axis=-1)
    assert np.all(speeds <= space.reach * (1.0 + 1e-12) + 1e-12)


@given(SEEDS)
def test_distances_grow_along_their_gradients(seed: int) -> None:
    space, _, _ = random_space(0)
    rng = np.random.default_rng(seed)
    point, h = rng.uniform(-2.0, 2.0, 3), 1e-6
    distance, gradient = space.clearance(point)
    assert np.linalg.norm(gradient) == pytest.approx(1.0)
    ahead, back = (space.clearance(point + s * h * gradient)[0] for s in (1.0, -1.0))
    assert (ahead - back) / (2.0 * h) == pytest.approx(1.0, abs=1e-3)
    # no distance to anything changes faster than the place
    other = rng.uniform(-2.0, 2.0, 3)
    assert abs(space.clearance(other)[0] - distance) <= np.linalg.norm(other - point) + 1e-12


@given(SEEDS)
def test_no_limit_is_passed_at_any_time(seed: int) -> None:
    """Nor by motions of 20 s, of which every fourth would pass one."""
    rng = np.random.default_rng(seed)
    chain = random_arm(rng)
    limits = random_limits(rng, len(chain.prismatic))
    posture = random_posture(rng, limits)
    space = Space(BOXES, chain, limits)
    assume(space.clearance(space.points(posture[None])[0])[0].min() > 0.001)
    motions = LimitedMotions(limits, posture, 20.0, 4)
    motion = Constraints((space,)).held(motions.motion(motions.random(rng)))
    q = motion.derivative(motion.times(1e3), 0)
    places = np.array([walked(chain, np.array(BOXES.tool), each) for each in q[::100]])
    assert space.clearance(places)[0].min() > 0.0
    assert space.clearance(space.points(q)[0])[0].min() > 0.0


def test_what_stays_free_is_not_made_smaller() -> None:
    rng = np.random.default_rng(1)
    chain, limits = random_chain('RR', rng), random_limits(rng, 2)
    motions = LimitedMotions(limits, random_posture(rng, limits), 1.0, 4)
    motion = motions.motion(motions.random(rng))
    wide = Space(SpaceSettings(floor_m=-100.0), chain, limits)
    assert Constraints((wide,)).held(motion) is motion


def test_the_penalty_has_the_gradient_of_differences() -> None:
    settings = replace(BOXES, margin_m=1.0)
    rng = np.random.default_rng(5)
    chain, limits = random_chain('RPRR', rng), random_limits(rng, 4)
    chain = chain._replace(couplings=rows_of([Coupling(2, 1, -1.0)]))
    space, still = Space(settings, chain, limits), np.zeros((1, 4))

    def cost(q: Array) -> float:
        return space.penalty(q[None], still, still)[0]

    def slope(q: Array) -> Array:
        return np.asarray(space.penalty(q[None], still, still)[1][0, 0])

    q = rng.uniform(-0.5, 0.5, 4)
    assert cost(q) > 1.0
    assert check_grad(cost, slope, q) < 1e-4 * np.linalg.norm(slope(q))


QUICK = lip.ExcitationConfig(
    lip.MotionSettings(duration_s=4.0),
    lip.SpaceSettings(floor_m=0.1, margin_m=0.05, tool=(0.0, 0.0, 0.1)),
    lip.SearchSettings(draws=3, starts=1, steps=10),
)


def test_a_design_stays_above_the_floor() -> None:
    motion = replace(QUICK.motion, posture=(0.0, 0.2, 0.3))
    found = lip.design_motion(replace(QUICK, motion=motion), ARM)
    free = lip.design_motion(replace(QUICK, motion=motion, space=lip.SpaceSettings()), ARM)
    lowest = [heights(each).min() for each in (found, free)]
    assert lowest[0] >= 0.15
    assert lowest[1] < 0.15


def heights(found: lip.ExcitingMotion) -> Array:
    """Return the heights of the tool at 10 kHz, by the joints of `ARM`."""
    q = found.motion.derivative(found.motion.times(1e4), 0)
    # the tool is ahead of the slide's axis x by z = 0.1 of its frame, which is turned to x
    return np.asarray(0.3 - np.sin(q[:, 1]) * (0.2 + q[:, 2] + 0.1))


REFUSED = {
    'posture': (
        lip.SpaceSettings(floor_m=1.0, margin_m=0.05),
        r'the tool is at \(.*\) m at the posture, which lacks 0\.\d+ m to space\.margin_m from',
    ),
    'numbers': (
        lip.SpaceSettings(boxes=(1.0, 2.0)),
        r'space\.boxes needs 6 numbers for each box, .* but has 2; correct it',
    ),
    'corners': (
        lip.SpaceSettings(keep_in=(1.0, 0.0, 0.0, 0.0, 1.0, 1.0)),
        r'space\.keep_in has a box whose lowest corner is not below its highest one',
    ),
    'tool': (
        lip.SpaceSettings(floor_m=-1.0, tool=(1.0,)),
        r'space\.tool needs x, y and z of the tool, but has 1 numbers',
    ),
}


@pytest.mark.parametrize('case', REFUSED)
def test_a_space_that_leaves_no_motion_is_refused(case: str) -> None:
    space, sentence = REFUSED[case]
    with pytest.raises(lip.ConfigError, match=sentence):
        lip.design_motion(replace(QUICK, space=space), ARM)


def test_a_space_needs_to_know_where_the_joints_are() -> None:
    motion = lip.MotionSettings(joints=('a',), lower=(-1.0,), upper=(1.0,), velocity=(1.0,))
    with pytest.raises(lip.ConfigError, match='need a URDF, but there is none: torques do not'):
        lip.design_motion(replace(QUICK, motion=motion))


def test_a_wall_that_lies_between_two_samples_is_not_passed() -> None:
    """The tool goes 25 mm from one sample to the next, through a wall of 2 mm."""
    chain = Chain(
        np.tile(np.eye(3), (2, 1, 1)),
        np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
        np.zeros(2, dtype=np.bool_),
        np.array([0.0, 0.0, -9.81]),
    )
    limits = JointLimits(('a', 'b'), np.full(2, -2.0), *np.full((4, 2), 2.0))
    wall = (1.9, 0.0115, -0.1, 2.1, 0.0135, 0.1)
    settings = SpaceSettings(boxes=wall, tool=(1.0, 0.0, 0.0), margin_m=0.001)
    space = Space(settings, chain, limits)
    swing = np.array([[0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    motion = FourierMotion(np.zeros(2), swing, 1.0)
    q = motion.derivative(motion.times(FINE_HZ), 0)
    assert space.clearance(space.points(q)[0])[0].min() > 0.0
    assert not space.is_kept(motion, fine=True)
    assert space.is_kept(motion.scaled(0.0), fine=True)
