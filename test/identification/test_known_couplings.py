"""Arms whose reported positions are coupled, where the coupling is known."""

from __future__ import annotations

from dataclasses import replace

from gp.arms import dataset_of, noise_of
from gp.chains import ChainArm, R, random_arm
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionBasis, FrictionModel, plain_friction
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.friction.terms import LoadViscous
from lip_id_ros.identification.fitting import fit
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.rigid_body.couplings import Coupling, coupling_texts, rows_of
from lip_id_ros.settings import FitSettings

PARALLELOGRAM, WRIST = Coupling(2, 1, -1.0), Coupling(1, 2, 0.5)
NOISE = 1e-3


def coupled_arm(*couplings: Coupling, seed: int = 6) -> ChainArm:
    arm = random_arm((R, R, R), seed)
    return replace(arm, chain=arm.chain._replace(couplings=rows_of(couplings)))


def samples_of(arm: ChainArm, count: int = 200) -> Dataset:
    motion = arm.motion(count, seed=0)
    tau = arm.torque(*motion)
    return dataset_of(arm, motion, tau + noise_of(tau, NOISE))


@pytest.mark.parametrize('couplings', [(PARALLELOGRAM,), (WRIST,), (WRIST, Coupling(2, 0, -1.0))])
def test_linearised_torques_are_those_of_the_arm(couplings: tuple[Coupling, ...]) -> None:
    """No column that a torque depends on is left out, with a load on a coupled joint too."""
    arm = coupled_arm(*couplings)
    data = samples_of(arm, 20)
    terms = (
        *plain_friction(3, np.full(3, 0.1)).terms,
        DriveTerm(Drive.transmitted(2, 1), LoadViscous()),
    )
    basis = FrictionBasis(3, terms, 0.0)
    friction = FrictionModel(basis, np.linspace(0.1, 1.0, basis.size))
    noise = TorqueNoise(np.ones(3), np.ones(3), np.ones(3))
    names = data.joint_names
    around = Linearisation(names, arm.chain, arm.parameters, friction, noise)
    features, target = around.rows(data)
    parameters = np.zeros(around.size)
    parameters[: basis.size] = friction.coefficients
    parameters[-arm.parameters.size :] = arm.parameters.ravel()
    found = np.stack(
        [
            target[:, j] - rows @ parameters[np.concatenate(own)]
            for j, (rows, own) in enumerate(zip(features, around.columns, strict=True))
        ],
        axis=1,
    )
    np.testing.assert_allclose(found, around.residual(data), atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize('coupling', [WRIST])
def test_unseen_torques_and_their_deviations(coupling: Coupling) -> None:
    arm = coupled_arm(coupling)
    data = samples_of(arm)
    texts = tuple(coupling_texts(arm.chain, data.joint_names))
    model = fit(data, FitSettings(coupling=texts))
    assert model.arm is not None
    np.testing.assert_array_equal(model.arm.chain.couplings, arm.chain.couplings)
    motion = arm.motion(300, seed=1)
    tau = arm.torque(*motion)
    found = model.predict(*motion, return_std=True)
    np.testing.assert_allclose(found.tau, tau, atol=3e-3 * np.abs(tau).max())
    assert found.std is not None
    covered = np.abs(found.tau - tau) < 3.0 * found.std.tau
    assert covered.mean() > 0.95
    in_series = replace(model.arm, chain=model.arm.chain._replace(couplings=rows_of(())))
    assert np.abs(in_series.torque(*motion) - tau).max() > 0.1 * np.abs(tau).max()
    inertia = model.inertia_matrix(motion[0])
    np.testing.assert_allclose(inertia, arm.inertia(motion[0]), atol=0.02 * np.abs(inertia).max())


def test_couplings_of_other_models() -> None:
    data = samples_of(coupled_arm(PARALLELOGRAM))
    texts = tuple(coupling_texts(coupled_arm(PARALLELOGRAM).chain, data.joint_names))
    with pytest.raises(ConfigError, match=r'fit\.coupling is of the links of an articulated fit'):
        fit(data, FitSettings(kernel='recursive', coupling=texts))
    with pytest.raises(ConfigError, match="the recording has no joint 'elbow'"):
        fit(data, FitSettings(coupling=('elbow 1 joint_1',)))
