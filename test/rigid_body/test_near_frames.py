"""Frames near each other: the same torques, and one chain of all that have them."""

from __future__ import annotations

from gp.chains import P, R, random_arm
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.denavit_hartenberg import mirrored
from lip_id_ros.rigid_body.near_frames import with_near_frames
from lip_id_ros.rigid_body.regressor import torque_regressor

ARMS = [(R,), (R, R, R), (P, R, R), (R, P, R), (R, R, P), (P, P, R), (R, R, R, R, R, R, R)]


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


@pytest.mark.parametrize('kinds', ARMS, ids=lambda kinds: ''.join(k[0] for k in kinds))
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
