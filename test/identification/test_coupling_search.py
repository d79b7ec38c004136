"""Couplings of positions: given ones, and such that are found where they are and nowhere else."""

from __future__ import annotations

from dataclasses import replace

from gp.arms import dataset_of, noise_of
from gp.chains import ChainArm, R, random_arm
import numpy as np
import pytest

from lip_id_ros.dataset import Dataset
from lip_id_ros.errors import ConfigError
from lip_id_ros.friction.basis import FrictionBasis, plain_friction
from lip_id_ros.friction.drives import Drive, DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.noise import TorqueNoise
from lip_id_ros.friction.terms import load_viscous
from lip_id_ros.identification.arm_fit import ArmFitter
from lip_id_ros.identification.arm_search import ArmSearch, find_placements
from lip_id_ros.identification.coupling_search import (
    _left_out_squares,
    find_couplings,
    least_gain,
    promising,
)
from lip_id_ros.identification.fitting import fit
from lip_id_ros.identification.folds import recurrent_folds
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.placement_search import calibration_at
from lip_id_ros.progress import silent
from lip_id_ros.rigid_body.couplings import Coupling, coupling_texts, couplings_of, rows_of
from lip_id_ros.settings import FitSettings

TYPES = (R, R, R, R)
PARALLELOGRAM, WRIST = Coupling(2, 1, -1.0), Coupling(3, 2, 0.5)


def arm_of(*couplings: Coupling, seed: int, types: tuple[str, ...] = TYPES) -> ChainArm:
    arm = random_arm(types, seed)
    return replace(arm, chain=arm.chain._replace(couplings=rows_of(couplings)))


def recording(arm: ChainArm, noise: float = 0.01, efforts: np.ndarray | None = None) -> Dataset:
    motion = arm.motion(400, seed=0)
    tau = arm.torque(*motion)
    if efforts is not None:
        tau = tau @ efforts.T
    return dataset_of(arm, motion, tau + noise_of(tau, noise))


def found(data: Dataset) -> tuple[Coupling, ...]:
    search, _ = find_couplings(*find_placements(ArmFitter(data), 0, silent), 0, silent)
    return couplings_of(search.fitter.couplings)


@pytest.mark.slow
@pytest.mark.parametrize('couplings', [(WRIST,), (PARALLELOGRAM, Coupling(3, 2, 1.0))])
def test_couplings_are_found(couplings: tuple[Coupling, ...]) -> None:
    assert sorted(found(recording(arm_of(*couplings, seed=3)))) == sorted(couplings)


@pytest.mark.slow
def test_no_coupling_is_invented_in_noise() -> None:
    """Residuals of a tenth are far more than a serial chain would be sure of."""
    assert found(recording(arm_of(seed=3), noise=0.1)) == ()


@pytest.mark.slow
def test_efforts_of_coupled_motors_are_no_coupled_positions() -> None:
    """The positions are those of the joints, the efforts those of the motors."""
    efforts = np.eye(4)
    efforts[2, 3] = 1.0
    assert found(recording(arm_of(seed=3), efforts=efforts)) == ()


@pytest.mark.slow
def test_an_arm_whose_residuals_are_small_is_not_searched() -> None:
    search = ArmSearch(ArmFitter(recording(arm_of(seed=3), noise=1e-3)))
    assert promising(search, search.calibrated(0, silent)) is None


@pytest.mark.slow
def test_each_coupling_has_to_be_worth_its_own() -> None:
    """The error of one joint has to halve for each: its mean square has a quarter."""
    assert least_gain(1) == pytest.approx(np.log(4.0))
    assert least_gain(2) == pytest.approx(np.log(16.0))


def test_what_is_left_out_is_not_learned_from() -> None:
    """An offset of one motion, of which a fit that had seen it would take a sixth or more."""
    arm = arm_of(seed=3)
    data = recording(arm)
    fold, offset = recurrent_folds(data, 6), 10.0 * data.tau[:, 0].std()
    assert np.unique(fold).size == 6
    tau = data.tau.copy()
    tau[fold == 0, 0] += offset
    search = ArmSearch(ArmFitter(replace(data, tau=tau)))
    samples = search.samples(search.fitter.dataset)
    squares = _left_out_squares(samples, calibration_at(arm.chain, samples), fold)
    whole = offset**2 * samples.weights[fold == 0, 0].mean()
    assert squares[0, 0] > 0.9 * whole


@pytest.mark.slow
def test_default_fits_search_and_others_do_not() -> None:
    arm = arm_of(PARALLELOGRAM, seed=3, types=TYPES[:3])
    data, motion = recording(arm, noise=1e-3), arm.motion(200, seed=1)
    tau = arm.torque(*motion)
    models = [fit(data, FitSettings(coupling=each, terms='friction')) for each in ((), ('none',))]
    couplings = [couplings_of(each.arm.chain.couplings) for each in models if each.arm]
    assert couplings == [(PARALLELOGRAM,), ()]
    coupled, serial = (np.square(each.predict(*motion).tau - tau).mean() for each in models)
    assert coupled < 1e-4 * np.square(tau).mean() < serial


PARALLEL, GEARED = Coupling(2, 1, -1.0), Coupling(1, 2, 0.5)
LITTLE = 1e-3


def known_arm(*couplings: Coupling, seed: int = 6) -> ChainArm:
    arm = random_arm((R, R, R), seed)
    return replace(arm, chain=arm.chain._replace(couplings=rows_of(couplings)))


def known_samples(arm: ChainArm, count: int = 200) -> Dataset:
    motion = arm.motion(count, seed=0)
    tau = arm.torque(*motion)
    return dataset_of(arm, motion, tau + noise_of(tau, LITTLE))


@pytest.mark.parametrize('couplings', [(PARALLEL,), (GEARED,), (GEARED, Coupling(2, 0, -1.0))])
def test_linearised_torques_are_those_of_the_arm(couplings: tuple[Coupling, ...]) -> None:
    """No column that a torque depends on is left out, with a load on a coupled joint too."""
    arm = known_arm(*couplings)
    data = known_samples(arm, 20)
    terms = (
        *plain_friction(3, np.full(3, 0.1)).terms,
        DriveTerm(Drive.transmitted(2, 1), load_viscous()),
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
def test_unseen_torques_and_their_deviations() -> None:
    arm = known_arm(GEARED)
    data = known_samples(arm)
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
    data = known_samples(known_arm(PARALLEL))
    texts = tuple(coupling_texts(known_arm(PARALLEL).chain, data.joint_names))
    with pytest.raises(ConfigError, match=r'fit\.coupling is of the links of an articulated fit'):
        fit(data, FitSettings(kernel='recursive', coupling=texts))
    with pytest.raises(ConfigError, match="the recording has no joint 'elbow'"):
        fit(data, FitSettings(coupling=('elbow 1 joint_1',)))
