"""Links that can exist with the torques of links that cannot."""

from __future__ import annotations

import numpy as np
import pytest
from rigid_body.arms import ARMS, random_bodies, random_chain, torques_and_energies, UP

from lip_id_ros.arrays import Array
from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.chain import ROTOR
from lip_id_ros.rigid_body.consistent_links import are_consistent, consistent_links
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, pseudo_inertia
from lip_id_ros.rigid_body.regressor import torque_regressor


def unseen_directions(chain: Chain, rng: np.random.Generator) -> Array:
    n = len(chain.prismatic)
    state = rng.standard_normal((3, 60, n))
    regressor = torque_regressor(chain, *state).reshape(-1, LINK_PARAMETERS * n)
    _, values, vectors = np.linalg.svd(regressor, full_matrices=True)
    rank = int((values > 1e-10 * values[0]).sum())
    return np.asarray(vectors[rank:])


@pytest.mark.parametrize('gravity', [UP, np.zeros(3)])
@pytest.mark.parametrize('arm', ARMS)
def test_links_with_the_same_torques_are_found(arm: str, gravity: Array) -> None:
    rng = np.random.default_rng(len(arm))
    chain = random_chain(arm, rng, gravity)
    true = random_bodies(len(arm), rng)
    assert are_consistent(true)
    unseen = unseen_directions(chain, rng)
    change = unseen.T @ (3.0 * rng.standard_normal(len(unseen)))
    spoilt = true + change.reshape(true.shape)
    assert not are_consistent(spoilt)
    found = consistent_links(chain, spoilt)
    assert are_consistent(found.parameters)
    assert not found.torque_change.any()
    state = rng.standard_normal((3, 30, len(arm)))
    for one, other in zip(
        torques_and_energies(chain, true, state),
        torques_and_energies(chain, found.parameters, state),
        strict=True,
    ):
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-10 * max(1.0, np.abs(one).max()))


def test_links_that_can_exist_stay_as_they_are() -> None:
    rng = np.random.default_rng(3)
    chain, true = random_chain('RRR', rng), random_bodies(3, rng)
    found = consistent_links(chain, true)
    np.testing.assert_array_equal(found.parameters, true)
    assert not found.torque_change.any()


def test_where_none_has_the_same_torques_the_change_is_given() -> None:
    """A rotor with a negative inertia, which no link makes up for."""
    rng = np.random.default_rng(4)
    chain, spoilt = random_chain('RRRRR', rng), random_bodies(5, rng)
    spoilt[3, ROTOR] = -0.2
    found = consistent_links(chain, spoilt)
    assert are_consistent(found.parameters)
    assert 1e-4 < found.torque_change.max() < 1.0


def test_positive_definite_means_that_a_body_exists() -> None:
    """The triangle inequality of the principal moments about the centre of mass."""
    body = np.array([[2.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.2, 0.0, 2.1, 0.1]])
    assert are_consistent(body) == bool(1.0 + 1.2 > 2.1)
    body[0, 9] = 2.3
    assert not are_consistent(body)
    np.testing.assert_allclose(link_parameters(pseudo_inertia(body)), body[:, :10])
