"""Rigid links against pinocchio and against themselves."""

from typing import Any

from kernels.cases import P, R
from kernels.cases import random_chain as random_chain_of
import numpy as np
import pytest
from rigid_body.arms import random_bodies
from scipy.spatial.transform import Rotation

from lip_id_ros.rigid_body import Chain, LINK_PARAMETERS
from lip_id_ros.rigid_body.regressor import (
    kinetic_regressor,
    potential_regressor,
    torque_regressor,
)
from lip_id_ros.rigid_body.rnea_derivatives import energy_derivatives, placement_derivatives

pinocchio = pytest.importorskip('pinocchio')

ARMS = ('RRRRRRR', 'RPRPRR', 'PPR', 'R', 'P')
TO_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # its inertias are xx xy yy xz yz zz


def random_chain(arm: str, rng: np.random.Generator) -> Chain:
    return random_chain_of(tuple({'R': R, 'P': P}[kind] for kind in arm), rng)


def oracle(chain: Chain) -> tuple[object, object]:
    model = pinocchio.Model()
    model.gravity.linear = chain.gravity
    last = 0
    for i, slides in enumerate(chain.prismatic):
        joint = pinocchio.JointModelPZ() if slides else pinocchio.JointModelRZ()
        place = pinocchio.SE3(chain.rotations[i], chain.translations[i])
        last = model.addJoint(last, joint, place, f'joint {i}')
    return model, model.createData()


def columns(regressor: np.ndarray, n: int) -> np.ndarray:
    """Put pinocchio's parameters in our order."""
    return np.squeeze(regressor.reshape(-1, n, 10)[..., TO_PINOCCHIO])


@pytest.mark.parametrize('arm', ARMS)
def test_torques_and_energies_are_those_of_pinocchio(arm: str) -> None:
    rng = np.random.default_rng(len(arm))
    chain = random_chain(arm, rng)
    model, data = oracle(chain)
    q, dq, ddq = rng.standard_normal((3, 5, len(arm)))
    torque = torque_regressor(chain, q, dq, ddq).reshape(5, len(arm), len(arm), LINK_PARAMETERS)
    kinetic = kinetic_regressor(chain, q, dq).reshape(5, len(arm), LINK_PARAMETERS)
    potential = potential_regressor(chain, q).reshape(5, len(arm), LINK_PARAMETERS)
    for t in range(5):
        expected = pinocchio.computeJointTorqueRegressor(model, data, q[t], dq[t], ddq[t])
        np.testing.assert_allclose(
            np.squeeze(torque[t, ..., :10]), columns(expected, len(arm)), atol=1e-11
        )
        expected = pinocchio.computeKineticEnergyRegressor(model, data, q[t], dq[t])
        np.testing.assert_allclose(
            np.squeeze(kinetic[t, :, :10]), columns(expected, len(arm)), atol=1e-11
        )
        expected = pinocchio.computePotentialEnergyRegressor(model, data, q[t])
        np.testing.assert_allclose(
            np.squeeze(potential[t, :, :10]), columns(expected, len(arm)), atol=1e-11
        )
    rotors = torque[..., 10]
    np.testing.assert_array_equal(rotors, ddq[:, :, None] * np.eye(len(arm)))
    np.testing.assert_array_equal(kinetic[:, :, 10], 0.5 * dq**2)


def displaced(chain: Chain, i: int, direction: int, by: float) -> Chain:
    """Return a chain with one joint rotated about an axis of its own frame, or translated."""
    moved = chain._replace(
        rotations=chain.rotations.copy(), translations=chain.translations.copy()
    )
    if direction < 3:
        small = Rotation.from_rotvec(by * np.eye(3)[direction]).as_matrix()
        moved.rotations[i] = moved.rotations[i] @ small
    else:
        moved.translations[i, direction - 3] += by
    return moved


@pytest.mark.parametrize('arm', ARMS)
def test_derivatives_of_energies_by_placements(arm: str) -> None:
    rng = np.random.default_rng(30 + len(arm))
    n, step = len(arm), 1e-6
    chain = random_chain(arm, rng)
    parameters = rng.standard_normal((n, LINK_PARAMETERS))
    q, dq = rng.standard_normal((2, 4, n))
    found = energy_derivatives(chain, parameters, q, dq)

    def energies(i: int, direction: int, by: float) -> np.ndarray:
        placed = displaced(chain, i, direction, by)
        rows = kinetic_regressor(placed, q, dq), potential_regressor(placed, q)
        return np.stack(rows) @ parameters.ravel()

    for i in range(n):
        for direction in range(6):
            slope = (energies(i, direction, step) - energies(i, direction, -step)) / (2 * step)
            np.testing.assert_allclose(found[0][:, i, direction], slope[0], atol=1e-6)
            np.testing.assert_allclose(found[1][:, i, direction], slope[1], atol=1e-6)


@pytest.mark.parametrize('arm', ARMS)
def test_sensitivity_of_torques_to_placements(arm: str) -> None:
    rng = np.random.default_rng(10 + len(arm))
    n = len(arm)
    chain = random_chain(arm, rng)
    parameters = rng.standard_normal((n, LINK_PARAMETERS))
    state = rng.standard_normal((3, 4, n))
    found = placement_derivatives(chain, parameters, *state)
    step = 1e-6

    def torques(i: int, direction: int, by: float) -> np.ndarray:
        placed = displaced(chain, i, direction, by)
        return np.asarray(torque_regressor(placed, *state) @ parameters.ravel())

    for i in range(n):
        for direction in range(6):
            slope = (torques(i, direction, step) - torques(i, direction, -step)) / (2 * step)
            np.testing.assert_allclose(found[:, :, i, direction], slope, atol=1e-6)


def with_resting_joint(chain: Chain, links: np.ndarray, j: int, direction: int) -> Any:
    """Return a model of pinocchio with one more joint that displaces placement j."""
    model = pinocchio.Model()
    model.gravity.linear = chain.gravity
    kinds = 'RX', 'RY', 'RZ', 'PX', 'PY', 'PZ'
    resting = getattr(pinocchio, f'JointModel{kinds[direction]}')()
    here, last = pinocchio.SE3.Identity(), 0
    for i, slides in enumerate(chain.prismatic):
        joint = pinocchio.JointModelPZ() if slides else pinocchio.JointModelRZ()
        place = pinocchio.SE3(chain.rotations[i], chain.translations[i])
        if i == j:
            before, place = (place, here) if direction < 3 else (here, place)
            last = model.addJoint(last, resting, before, 'resting')
        last = model.addJoint(last, joint, place, f'joint {i}')
        body = pinocchio.Inertia.FromDynamicParameters(links[i, TO_PINOCCHIO])
        model.appendBodyToJoint(last, body, here)
    return model


@pytest.mark.parametrize('arm', ARMS)
def test_derivatives_by_placements_are_those_by_resting_joints_of_pinocchio(arm: str) -> None:
    rng = np.random.default_rng(50 + len(arm))
    n = len(arm)
    chain, links = random_chain(arm, rng), random_bodies(n, rng)
    state = rng.standard_normal((3, n))
    found = placement_derivatives(chain, links, *state[:, None])[0]
    for j, direction in np.ndindex(n, 6):
        model = with_resting_joint(chain, links, j, direction)
        there = np.insert(state, j, 0.0, axis=1)
        data = model.createData()  # which owns the slopes
        slopes = pinocchio.computeRNEADerivatives(model, data, *there)[0]
        expected = np.delete(slopes[:, j], j)
        np.testing.assert_allclose(found[:, j, direction], expected, atol=1e-11)
