"""Coupled positions against serial chains and Lagrange's equations."""

from collections.abc import Callable

from hypothesis import given
from hypothesis import strategies as st
import numba
import numpy as np
import pytest
from rigid_body.arms import random_bodies, random_chain

from lip_id_ros.errors import ConfigError
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.chain import LINK_PARAMETERS, NO_COUPLINGS, ROTOR
from lip_id_ros.rigid_body.couplings import (
    contradiction,
    Coupling,
    coupling_matrix,
    coupling_texts,
    couplings_of,
    read_couplings,
    rows_of,
)
from lip_id_ros.rigid_body.motions import VECTORS
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.rigid_body.rnea import inertial_torque, Links, rnea
from lip_id_ros.rigid_body.rnea_derivatives import energy_derivatives, placement_derivatives

CASES = {
    'RRRR': (Coupling(2, 1, -1.0),),
    'RRRRRR': (Coupling(4, 3, 1.0), Coupling(5, 4, -0.5), Coupling(5, 3, 0.25)),
    'RPRP': (Coupling(1, 2, 0.1), Coupling(3, 0, 0.2)),
    'RRR': (Coupling(0, 1, 0.5), Coupling(1, 2, -1.0), Coupling(2, 0, 0.3)),
}
NAMES = ('a', 'b', 'c', 'd')


def coupled_arm(arm: str) -> tuple[Chain, np.ndarray, np.random.Generator]:
    rng = np.random.default_rng(len(arm))
    chain = random_chain(arm, rng)._replace(couplings=rows_of(CASES[arm]))
    return chain, random_bodies(len(arm), rng), rng


def of_serial(chain: Chain) -> tuple[Chain, np.ndarray]:
    return chain._replace(couplings=NO_COUPLINGS), coupling_matrix(chain)


def without_rotors(links: np.ndarray) -> np.ndarray:
    links = links.copy()
    links[:, ROTOR] = 0.0
    return links


@pytest.mark.parametrize('arm', CASES)
def test_torques_are_those_of_the_serial_chain_by_virtual_work(arm: str) -> None:
    chain, links, rng = coupled_arm(arm)
    serial, c = of_serial(chain)
    q, dq, ddq = rng.standard_normal((3, 5, len(arm)))
    bodies = without_rotors(links).ravel()
    found = torque_regressor(chain, q, dq, ddq)
    expected = torque_regressor(serial, q @ c.T, dq @ c.T, ddq @ c.T) @ bodies @ c
    np.testing.assert_allclose(found @ bodies, expected, atol=1e-11)
    rotors = found.reshape(5, len(arm), len(arm), LINK_PARAMETERS)[..., ROTOR]
    np.testing.assert_array_equal(rotors, ddq[:, :, None] * np.eye(len(arm)))
    kinetic = kinetic_regressor(serial, q @ c.T, dq @ c.T) @ bodies
    np.testing.assert_allclose(
        kinetic_regressor(chain, q, dq) @ links.ravel(),
        kinetic + 0.5 * dq**2 @ links[:, ROTOR],
        atol=1e-11,
    )
    np.testing.assert_allclose(
        potential_regressor(chain, q), potential_regressor(serial, q @ c.T), atol=1e-12
    )


@pytest.mark.parametrize('arm', CASES)
def test_torques_are_those_of_lagrange(arm: str) -> None:
    chain, links, rng = coupled_arm(arm)
    q, dq, ddq = rng.standard_normal((3, len(arm)))
    p, step = links.ravel(), 1e-5

    def lagrangian(q: np.ndarray, dq: np.ndarray) -> float:
        kinetic = kinetic_regressor(chain, q[None], dq[None]) - potential_regressor(chain, q[None])
        return float((kinetic @ p)[0])

    def slopes(function: Callable[[np.ndarray], float], at: np.ndarray) -> np.ndarray:
        steps = step * np.eye(len(at))
        return np.array([function(at + s) - function(at - s) for s in steps]) / (2.0 * step)

    def momentum(time: float) -> np.ndarray:
        at, rate = q + dq * time + 0.5 * ddq * time**2, dq + ddq * time
        return slopes(lambda x: lagrangian(at, x), rate)

    change = (momentum(1e-3) - momentum(-1e-3)) / 2e-3
    expected = change - slopes(lambda x: lagrangian(x, dq), q)
    found = (torque_regressor(chain, q[None], dq[None], ddq[None]) @ p)[0]
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(found).max())


@numba.njit  # the recursion is compiled into what calls it
def recursion(own, gravity, accelerating, links, work, q, dq, ddq):  # type: ignore[no-untyped-def]
    energies = rnea(own, gravity, links, work, q, dq, ddq)
    inertial_torque(accelerating, links, work, ddq)
    return energies


@pytest.mark.parametrize('arm', CASES)
def test_recursion_gives_torques_and_energies_of_the_regressors(arm: str) -> None:
    chain, links, rng = coupled_arm(arm)
    n = len(arm)
    states = rng.standard_normal((3, 4, n))
    p, still = links.ravel(), np.zeros((4, n))
    tau, kinetic, potential = (
        torque_regressor(chain, *states) @ p,
        kinetic_regressor(chain, *states[:2]) @ p,
        potential_regressor(chain, states[0]) @ p,
    )
    weight = torque_regressor(chain, states[0], still, still) @ p
    inertial = torque_regressor(chain, states[0], still, states[2]) @ p - weight
    work = np.empty((n + 1, VECTORS, 3))
    for t in range(4):
        own, gravity, accelerating = np.zeros((3, n))
        energies = recursion(own, gravity, accelerating, Links(chain, links), work, *states[:, t])
        np.testing.assert_allclose(own + gravity, tau[t], atol=1e-11)
        np.testing.assert_allclose(gravity, weight[t], atol=1e-11)
        np.testing.assert_allclose(accelerating, inertial[t], atol=1e-11)
        np.testing.assert_allclose(energies, (kinetic[t], potential[t]), atol=1e-11)


@pytest.mark.parametrize('arm', CASES)
def test_slopes_by_placements_are_those_of_the_serial_chain(arm: str) -> None:
    chain, links, rng = coupled_arm(arm)
    serial, c = of_serial(chain)
    q, dq, ddq = rng.standard_normal((3, 4, len(arm)))
    serial_state = [np.ascontiguousarray(x @ c.T) for x in (q, dq, ddq)]
    expected = np.einsum('ti...,ij->tj...', placement_derivatives(serial, links, *serial_state), c)
    np.testing.assert_allclose(
        placement_derivatives(chain, links, q, dq, ddq), expected, atol=1e-11
    )
    for found, own in zip(
        energy_derivatives(chain, links, q, dq),
        energy_derivatives(serial, links, *serial_state[:2]),
        strict=True,
    ):
        np.testing.assert_allclose(found, own, atol=1e-12)


@pytest.mark.parametrize('arm', CASES)
def test_inertia_matrix_is_symmetric_and_positive_definite(arm: str) -> None:
    chain, links, rng = coupled_arm(arm)
    n = len(arm)
    q, still = np.tile(rng.standard_normal(n), (n, 1)), np.zeros((n, n))
    p = links.ravel()
    matrix = torque_regressor(chain, q, still, np.eye(n)) @ p
    matrix -= torque_regressor(chain, q, still, still) @ p
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-11)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0


COUPLINGS = st.lists(
    st.builds(
        Coupling, st.integers(0, 3), st.integers(0, 3), st.sampled_from((-1.0, 1.0, 0.5, -0.02))
    ),
    max_size=3,
).filter(lambda some: not contradiction(some, 4))


@given(COUPLINGS)
def test_couplings_survive_being_written(couplings: list[Coupling]) -> None:
    chain = random_chain('RRRR', np.random.default_rng(0))._replace(couplings=rows_of(couplings))
    assert read_couplings(coupling_texts(chain, NAMES), NAMES) == tuple(couplings)
    assert couplings_of(chain.couplings) == tuple(couplings)


@pytest.mark.parametrize(
    ('texts', 'words'),
    [
        (['c -1'], 'a coupling is "joint ratio other_joint"'),
        (['c -1 e'], "no joint 'e'; its joints are a, b, c, d"),
        (['c one b'], "'one' is no number"),
        (['c -1 c'], 'no two of 4 joints'),
        (['c 0 b'], 'a ratio of 0'),
        (['c inf b'], 'a ratio of inf'),
        (['c -1 b', 'c 1 b'], 'two couplings of joint 2 with joint 1'),
        (['c 1 b', 'b 1 c'], 'do not follow'),
    ],
)
def test_couplings_that_are_none(texts: list[str], words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_couplings(texts, NAMES)
    assert words in str(caught.value)
