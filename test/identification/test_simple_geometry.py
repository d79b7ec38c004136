"""Neighbouring axes at quarter turns, and such that meet."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_body.arms import angles_between, distances_between
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.identification.simple_geometry import (
    _length_gradient,
    _twist_gradient,
    candidates,
    Geometry,
    together,
)
from lip_id_ros.rigid_body import Chain

N = 4
DOWN = np.array([0.0, 0.0, -9.81])


def chain_of(seed: int) -> Chain:
    rng = np.random.default_rng(seed)
    rotations = Rotation.random(N, random_state=rng).as_matrix()
    return Chain(rotations, rng.standard_normal((N, 3)), np.zeros(N, dtype=bool), DOWN)


GEOMETRY = Geometry(
    np.array([0.0, 0.5 * np.pi, np.pi, np.nan]), np.array([False, True, False, True])
)


def has(chain: Chain, geometry: Geometry) -> bool:
    twists = np.concatenate(
        [[np.arccos(np.clip(chain.rotations[0, 2, 2], -1.0, 1.0))], angles_between(chain)]
    )
    wrong = np.nan_to_num(np.abs(twists - geometry.twists))
    apart = np.concatenate([[0.0], distances_between(chain)])[geometry.meets]
    return bool(wrong.max() < 1e-6 and np.abs(apart).max() < 1e-6)


def stepped(chain: Chain, step: Array) -> Chain:
    parts = step.reshape(N, 6)
    turns = Rotation.from_rotvec(parts[:, :3]).as_matrix()
    return chain._replace(
        rotations=chain.rotations @ turns, translations=chain.translations + parts[:, 3:]
    )


@pytest.mark.parametrize('seed', range(5))
def test_a_chain_is_projected_on_a_geometry(seed: int) -> None:
    found = GEOMETRY.projected(chain_of(seed))
    assert has(found, GEOMETRY)
    again = GEOMETRY.projected(found)
    np.testing.assert_allclose(again.rotations, found.rotations, atol=1e-12)
    np.testing.assert_allclose(again.translations, found.translations, atol=1e-12)


def test_fixed_twists_and_lengths_take_one_direction_each_and_parallel_axes_two() -> None:
    chain = GEOMETRY.projected(chain_of(0))
    assert np.trace(GEOMETRY.projector(chain)) == pytest.approx(6 * N - (2 + 2 + 2 + 1))
    np.testing.assert_array_equal(Geometry.free(N).projector(chain), np.eye(6 * N))


def test_what_is_near_in_deviations_is_a_candidate() -> None:
    chain = GEOMETRY.projected(chain_of(1))
    tilted = stepped(chain, np.full(6 * N, 0.01))
    wide, narrow = (candidates(tilted, std * np.eye(6 * N)) for std in (0.02, 1e-4))
    offered = together([fixed for _, fixed in wide], N)
    np.testing.assert_allclose(offered.twists[:3], GEOMETRY.twists[:3])
    assert offered.meets[1]
    assert [away for away, _ in wide] == sorted(away for away, _ in wide)
    assert not narrow


def test_lengths_of_prismatic_joints_are_left_alone() -> None:
    chain = GEOMETRY.projected(chain_of(1))._replace(
        prismatic=np.array([False, True, False, True])
    )
    assert not together([fixed for _, fixed in candidates(chain, np.eye(6 * N))], N).meets.any()


@pytest.mark.parametrize('seed', range(5))
def test_gradients_by_differences(seed: int) -> None:
    chain, step = chain_of(seed), 1e-6
    for joint in range(1, N):
        found = (
            _twist_gradient(chain.rotations[joint]),
            _length_gradient(chain.rotations[joint], chain.translations[joint]),
        )
        for k in range(6):
            way = np.zeros(6 * N)
            way[6 * joint + k] = step
            up, down = stepped(chain, way), stepped(chain, -way)
            twist = angles_between(up)[joint - 1] - angles_between(down)[joint - 1]
            lengths = [
                np.cross((0.0, 0.0, 1.0), each.rotations[joint][:, 2]) for each in (up, down)
            ]
            length = sum(
                sign * (normal / np.linalg.norm(normal)) @ each.translations[joint]
                for sign, normal, each in zip((1.0, -1.0), lengths, (up, down), strict=True)
            )
            assert found[0][k] == pytest.approx(twist / (2.0 * step), abs=1e-6)
            assert found[1][k] == pytest.approx(length / (2.0 * step), abs=1e-5)
