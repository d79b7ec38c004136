"""Frames of the same arm: by the convention of Denavit and Hartenberg, and near each other."""

from __future__ import annotations

from gp.chains import P, R, random_arm
import numpy as np
import pytest
from rigid_body.arms import ARMS, links_of, random_chain, torques_and_energies, UP
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.denavit_hartenberg import (
    DenavitHartenberg,
    mirrored,
    table,
    table_std,
    with_standard_frames,
)
from lip_id_ros.rigid_body.near_frames import with_near_frames
from lip_id_ros.rigid_body.regressor import torque_regressor
from lip_id_ros.simulation.arm import panda_urdf


@pytest.mark.parametrize('arm', ARMS)
@pytest.mark.parametrize('seed', range(8))
@pytest.mark.parametrize('gravity', [UP, np.array([1.0, -2.0, 3.0]), np.zeros(3)])
def test_frames_change_no_torque(arm: str, seed: int, gravity: Array) -> None:
    rng = np.random.default_rng(seed)
    chain = random_chain(arm, rng, gravity)
    parameters = rng.standard_normal((len(arm), LINK_PARAMETERS))
    state = rng.standard_normal((3, 20, len(arm)))
    moved, of_links = with_standard_frames(chain, parameters)
    before = torques_and_energies(chain, parameters, state)
    after = torques_and_energies(moved, of_links, state)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-11 * max(1.0, np.abs(one).max()))
    identity = np.broadcast_to(np.eye(3), moved.rotations.shape)
    gram = moved.rotations.transpose(0, 2, 1) @ moved.rotations
    np.testing.assert_allclose(gram, identity, atol=1e-12)
    assert moved.gravity[2] <= 0.0
    np.testing.assert_allclose(moved.gravity[:2], 0.0, atol=1e-12)


@pytest.mark.parametrize('arm', ARMS)
@pytest.mark.parametrize('seed', range(8))
def test_the_table_says_where_the_joints_are(arm: str, seed: int) -> None:
    """Rot_x Trans_x Rot_z Trans_z of the table is the chain, in which every zero is written."""
    rng = np.random.default_rng(seed)
    chain, _ = with_standard_frames(random_chain(arm, rng), np.zeros((len(arm), LINK_PARAMETERS)))
    found = table(chain)
    np.testing.assert_allclose(composed(found).rotations, chain.rotations, atol=1e-12)
    np.testing.assert_allclose(composed(found).translations, chain.translations, atol=1e-12)
    np.testing.assert_allclose(found.tilt, 0.0, atol=1e-12)
    assert found.angle[-1] == pytest.approx(0.0, abs=1e-12)
    assert (np.abs(found.angle) <= np.pi / 2 + 1e-12).all()
    assert found.offset[0] == found.length[0] == 0.0


@pytest.mark.parametrize('arm', ARMS)
@pytest.mark.parametrize('seed', range(4))
def test_an_arm_and_its_mirror_image_have_the_same_torques(arm: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = random_chain(arm, rng)
    links = rng.standard_normal((len(arm), LINK_PARAMETERS))
    image, of_image = mirrored(chain, links)
    np.testing.assert_allclose(np.linalg.det(image.rotations), 1.0)
    assert not np.allclose(image.rotations, chain.rotations) or arm == 'P'
    state = rng.standard_normal((3, 20, len(arm)))
    before = torques_and_energies(chain, links, state)
    after = torques_and_energies(image, of_image, state)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-11 * max(1.0, np.abs(one).max()))


def composed(found: DenavitHartenberg) -> Chain:
    x, y, z = np.eye(3)
    turns = Rotation.from_rotvec(np.outer(found.twist, x))
    turns *= Rotation.from_rotvec(np.outer(found.tilt, y))
    rotations = (turns * Rotation.from_rotvec(np.outer(found.angle, z))).as_matrix()
    translations = np.outer(found.length, x) + found.offset[:, None] * rotations[:, :, 2]
    return Chain(rotations, translations, np.zeros(len(found.twist), bool), UP)


def test_nearly_parallel_axes_get_no_offset() -> None:
    """Their common normal may be anywhere: a tilt of the frame stands for it."""
    tilted = Rotation.from_rotvec([0.01, 0.02, 0.0]).as_matrix()
    chain = Chain(
        np.stack([Rotation.from_euler('x', 90, degrees=True).as_matrix(), tilted, np.eye(3)]),
        np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.3, 0.1, 0.0]]),
        np.zeros(3, bool),
        UP,
    )
    moved, _ = with_standard_frames(chain, np.zeros((3, LINK_PARAMETERS)))
    found = table(moved)
    assert np.abs(found.offset).max() < 0.02
    assert np.abs(found.tilt[1]) == pytest.approx(0.02, abs=1e-3)
    np.testing.assert_allclose(composed(found).rotations, moved.rotations, atol=1e-12)
    np.testing.assert_allclose(composed(found).translations, moved.translations, atol=1e-12)


def test_the_panda_has_the_table_of_its_maker() -> None:
    """Franka Robotics, "Denavit-Hartenberg parameters" (FCI documentation), but for the base."""
    pinocchio = pytest.importorskip('pinocchio')
    model = pinocchio.buildModelFromXML(panda_urdf().read_text(encoding='utf-8'))
    arm = pinocchio.buildReducedModel(model, [8, 9], pinocchio.neutral(model))
    chain, parameters = links_of(arm)
    found = table(with_standard_frames(chain, parameters)[0])
    np.testing.assert_allclose(np.degrees(found.twist), [0, -90, 90, 90, -90, 90, 90], atol=1e-3)
    np.testing.assert_allclose(found.length, [0, 0, 0, 0.0825, -0.0825, 0, 0.088], atol=1e-9)
    np.testing.assert_allclose(found.offset, [0, 0, 0.316, 0, 0.384, 0, 0], atol=1e-9)
    np.testing.assert_allclose(found.angle, 0.0, atol=1e-9)


def test_deviations_of_the_table() -> None:
    """Tables of chains that are displaced at random spread as much."""
    rng = np.random.default_rng(3)
    rotations = Rotation.random(3, random_state=rng).as_matrix()
    chain = Chain(rotations, rng.standard_normal((3, 3)), np.zeros(3, dtype=bool), UP)
    root = 1e-4 * rng.standard_normal((18, 4))
    found = np.array(table_std(chain, root))
    moved = (displaced(chain, root @ rng.standard_normal(4)) for _ in range(1000))
    spread = np.std([standard_table(each) for each in moved], axis=0)
    np.testing.assert_allclose(found, spread, rtol=0.12, atol=1e-9)
    turn = np.zeros((18, 1))
    turn[8] = 0.1  # of the second link, and all beyond, about its own axis
    expected = np.zeros((5, 3))
    expected[DenavitHartenberg._fields.index('angle'), 1] = 0.1
    np.testing.assert_allclose(table_std(chain, turn), expected, atol=1e-8)


def test_deviations_of_opposite_axes_are_those_of_parallel_ones() -> None:
    """A twist of half a turn becomes one of minus half a turn."""
    turn = np.zeros((18, 1))
    turn[6] = 0.1  # of the second axis, about the line between both
    found = []
    for twist in (0.0, np.pi):
        angles = np.array([0.0, twist, 0.5 * np.pi])
        rotations = Rotation.from_rotvec(np.outer(angles, [1.0, 0.0, 0.0])).as_matrix()
        translations = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
        chain = Chain(rotations, translations, np.zeros(3, dtype=bool), UP)
        found.append(table_std(chain, turn))
    np.testing.assert_allclose(found[0].twist[1], 0.1, rtol=1e-6)
    np.testing.assert_allclose(found[1].twist, found[0].twist, rtol=1e-6)


def standard_table(chain: Chain) -> DenavitHartenberg:
    return table(with_standard_frames(chain, np.zeros((3, LINK_PARAMETERS)))[0])


def displaced(chain: Chain, by: Array) -> Chain:
    places = by.reshape(3, 6)
    turns = Rotation.from_rotvec(places[:, :3]).as_matrix()
    return chain._replace(
        rotations=chain.rotations @ turns, translations=chain.translations + places[:, 3:]
    )


KINDS = [(R,), (R, R, R), (P, R, R), (R, P, R), (R, R, P), (P, P, R), (R, R, R, R, R, R, R)]


def in_other_frames(chain: Chain, seed: int) -> Chain:
    """
    Turn the base about the vertical, frames about their axes, and shift them along these.

    Those of slides but the first are shifted to any side: only the direction of a slide matters.
    """
    rng = np.random.default_rng(seed)
    n = len(chain.prismatic)
    angles = np.outer(rng.uniform(-3.0, 3.0, n + 1), [0.0, 0.0, 1.0])
    turns = Rotation.from_rotvec(angles).as_matrix()
    along = np.zeros((n + 1, 3))
    along[1:, 2] = rng.uniform(-0.5, 0.5, n)
    slides = 2 + np.flatnonzero(chain.prismatic[1:])
    along[slides, :2] = rng.uniform(-0.5, 0.5, (slides.size, 2))
    before, own = turns[:-1].transpose(0, 2, 1), turns[1:]
    translations = chain.translations + (chain.rotations @ along[1:, :, None])[:, :, 0]
    translations = (before @ (translations - along[:-1])[:, :, None])[:, :, 0]
    return chain._replace(rotations=before @ chain.rotations @ own, translations=translations)


def span(chain: Chain, motion: tuple[Array, Array, Array]) -> Array:
    """Return the projection on the torques that any links have, by which chains are the same."""
    features = torque_regressor(chain, *motion)
    rows = features.reshape(-1, features.shape[2])
    u, sizes, _ = np.linalg.svd(rows, full_matrices=False)
    u = u[:, sizes > 1e-9 * sizes[0]]
    return np.asarray(u @ u.T)


@pytest.mark.parametrize('kinds', KINDS, ids=lambda kinds: ''.join(k[0] for k in kinds))
@pytest.mark.parametrize('seed', range(3))
def test_chains_of_the_same_torques_become_one(kinds: tuple[str, ...], seed: int) -> None:
    arm = random_arm(kinds, seed)
    motion = arm.motion(20, seed=0)
    near = with_near_frames(arm.chain)
    np.testing.assert_allclose(span(near, motion), span(arm.chain, motion), atol=1e-6)
    links = np.zeros((len(kinds), 11))
    for other in (in_other_frames(arm.chain, seed), mirrored(arm.chain, links)[0]):
        again = with_near_frames(other)
        np.testing.assert_allclose(again.rotations, near.rotations, atol=1e-9)
        np.testing.assert_allclose(again.translations, near.translations, atol=1e-9)
    np.testing.assert_allclose(near.gravity, arm.chain.gravity, atol=1e-12)


def test_nearly_parallel_axes_stay_near() -> None:
    """Their common normal, where Denavit and Hartenberg put frames, is far away."""
    tilt = Rotation.from_rotvec(np.outer([0.0, 0.2, 0.2], [1.0, 0.0, 0.0])).as_matrix()
    chain = random_arm((R, R, R), 0).chain
    chain = chain._replace(
        rotations=tilt, translations=np.array([[0.0] * 3, *[[0.4, 0.1, 0.0]] * 2])
    )
    lengths = np.linalg.norm(with_near_frames(chain).translations, axis=1)
    assert lengths.max() <= np.linalg.norm(chain.translations, axis=1).max() + 1e-12
