"""Rigid links against pinocchio and against themselves."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lip_id_ros.kernels import Chain, RigidLinks
from lip_id_ros.kernels.rigid_links import PARAMETERS
from lip_id_ros.kernels.rigid_links.sensitivity import torque_sensitivity

pinocchio = pytest.importorskip('pinocchio')

ARMS = ('RRRRRRR', 'RPRPRR', 'PPR', 'R', 'P')
TO_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # its inertias are xx xy yy xz yz zz


def random_chain(arm: str, rng: np.random.Generator) -> Chain:
    n = len(arm)
    return Chain(
        Rotation.random(n, random_state=rng).as_matrix().reshape(n, 3, 3),
        rng.standard_normal((n, 3)),
        np.array([kind == 'P' for kind in arm]),
        np.array([0.0, 0.0, -9.81]),
    )


def oracle(chain: Chain) -> tuple[object, object]:
    model = pinocchio.Model()
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
    links = RigidLinks(chain, np.ones((len(arm), PARAMETERS)))
    model, data = oracle(chain)
    q, dq, ddq = rng.standard_normal((3, 5, len(arm)))
    torque = links.torque(q, dq, ddq).reshape(5, len(arm), len(arm), PARAMETERS)
    kinetic = links.kinetic(q, dq).reshape(5, len(arm), PARAMETERS)
    potential = links.potential(q).reshape(5, len(arm), PARAMETERS)
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


@pytest.mark.parametrize('arm', ARMS)
def test_sensitivity_of_torques_to_placements(arm: str) -> None:
    rng = np.random.default_rng(10 + len(arm))
    n = len(arm)
    chain = random_chain(arm, rng)
    parameters = rng.standard_normal((n, PARAMETERS))
    state = rng.standard_normal((3, 4, n))
    found = torque_sensitivity(chain, parameters, *state)
    step = 1e-6

    def torques(i: int, direction: int, by: float) -> np.ndarray:
        moved = Chain(chain.rotations.copy(), chain.translations.copy(), *chain[2:])
        if direction < 3:
            small = Rotation.from_rotvec(by * np.eye(3)[direction]).as_matrix()
            moved.rotations[i] = moved.rotations[i] @ small
        else:
            moved.translations[i, direction - 3] += by
        return RigidLinks(moved, parameters).torque(*state).sum(axis=2)

    for i in range(n):
        for direction in range(6):
            slope = (torques(i, direction, step) - torques(i, direction, -step)) / (2 * step)
            np.testing.assert_allclose(found[:, :, i, direction], slope, atol=1e-6)
