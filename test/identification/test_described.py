"""A URDF as prior: the arm that is found near it, and the URDFs that the data contradict."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from identification.arms import assert_gradient
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from simulation.panda_runs import runs

from benchmarks._arms import FrictionalArm, JointFriction
from lip_id_ros.arrays import Array
from lip_id_ros.dataset import Dataset
from lip_id_ros.description.robot import RobotDescription
from lip_id_ros.description.urdf import load_description
from lip_id_ros.errors import ConfigError
from lip_id_ros.export.arm import ArmDescription, JointRanges
from lip_id_ros.export.urdf_template import fill_template
from lip_id_ros.friction.basis import plain_friction
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.identification import fit
from lip_id_ros.identification.arm_fit import ArmFit, ArmFitter
from lip_id_ros.identification.arm_prior import ArmPrior, DescriptionSettings
from lip_id_ros.identification.description_doubts import doubts, reversed_axis
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body import Chain
from lip_id_ros.rigid_body.denavit_hartenberg import (
    DenavitHartenberg,
    table,
    table_std,
    with_standard_frames,
)
from lip_id_ros.rigid_body.pseudo_inertia import link_parameters, scale_of
from lip_id_ros.rigid_body.rnea_derivatives import DIRECTIONS
from lip_id_ros.settings import FitSettings
from lip_id_ros.simulation import make_dataset, panda, SinusoidTrajectory
from lip_id_ros.simulation.arm import MOTION, panda_urdf

pytest.importorskip('pinocchio')
N = 7
NAMES = tuple(f'panda_joint{i + 1}' for i in range(N))
TYPES = ('revolute',) * N
NOISE = 0.005
"""Of the measured torques, as a share of their deviations."""


@cache
def truth() -> RobotDescription:
    return load_description(panda_urdf(), NAMES, TYPES)


def urdf_of(chain: Chain, links: Array) -> str:
    """Write a Panda whose joints and links are elsewhere."""
    none = np.zeros(N)
    friction = FrictionModel(plain_friction(N, np.full(N, 0.05)), np.zeros(3 * N))
    ranges = JointRanges(none, none, none, none, none)
    arm = ArmDescription('panda', NAMES, chain, links, friction, ranges, none)
    return fill_template(arm, truth(), origins=True)


def perturbed(seed: int, degrees: float = 1.0, metres: float = 0.005, share: float = 0.3) -> str:
    rng = np.random.default_rng(seed)
    turns, shifts = rng.standard_normal((2, N, 3))
    turns *= np.radians(degrees) / np.linalg.norm(turns, axis=1)[:, None]
    shifts *= metres / np.linalg.norm(shifts, axis=1)[:, None]
    chain = truth().chain
    moved = chain._replace(
        rotations=chain.rotations @ Rotation.from_rotvec(turns).as_matrix(),
        translations=chain.translations + shifts,
    )
    return urdf_of(moved, truth().links * (1.0 + share * rng.choice([-1.0, 1.0], (N, 1))))


@cache
def motion(seed: int, seconds: int, rate: int) -> Dataset:
    rng = np.random.default_rng(seed)
    friction = JointFriction(np.full(N, 0.5), np.full(N, 0.4), 0.05)
    trajectory = SinusoidTrajectory.random(MOTION, rng, 20)
    t = np.arange(0.0, seconds, 1.0 / rate)
    data = make_dataset(FrictionalArm(panda(), friction), trajectory, t, 0.0, rng)
    noise = NOISE * data.tau.std(axis=0) * rng.standard_normal(data.tau.shape)
    return replace(data, tau=data.tau + noise)


def denavit_hartenberg(chain: Chain, links: Array) -> DenavitHartenberg:
    return table(with_standard_frames(chain, links)[0])


@pytest.fixture(scope='module')
def fitted() -> InverseDynamicsModel:
    return fit(motion(0, 60, 50), FitSettings(description=perturbed(0)))


@pytest.mark.slow
def test_origins_are_found(fitted: InverseDynamicsModel) -> None:
    """Of all joints but the last, whose torque is hardly above the noise."""
    assert fitted.arm is not None
    found = denavit_hartenberg(fitted.arm.chain, fitted.arm.links)
    expected = denavit_hartenberg(truth().chain, truth().links)
    np.testing.assert_allclose(np.degrees(found.twist - expected.twist)[:6], 0.0, atol=0.1)
    np.testing.assert_allclose(np.degrees(found.angle - expected.angle)[:5], 0.0, atol=0.1)
    std = table_std(fitted.arm.chain, fitted.arm.covariance_root[: DIRECTIONS * N])
    assert (np.abs(found.length - expected.length)[:6] <= 3.0 * std.length[:6]).all()
    assert (std.length[:6] < 6e-4).all()
    np.testing.assert_allclose((found.offset - expected.offset)[[1, 2, 4]], 0.0, atol=1e-3)


@pytest.mark.slow
def test_placements_can_be_fixed() -> None:
    """Of a file that is wrong, with noise that would move them too."""
    data, text = runs(3, 150, noise=0.05)[0], perturbed(0)
    settings = FitSettings(description=text, description_angle_deg=0.0, terms='friction')
    model = fit(data, settings)
    assert model.arm is not None
    chain = load_description(text, data.joint_names, data.joint_types).chain
    np.testing.assert_array_equal(model.arm.chain.rotations, chain.rotations)
    np.testing.assert_array_equal(model.arm.chain.translations, chain.translations)


def started(description: RobotDescription) -> tuple[ArmFitter, ArmFit]:
    fitter = ArmFitter(motion(0, 20, 25), (description, DescriptionSettings()))
    selected = fitter.selected(description.chain)
    return fitter, fitter.best_start([description.chain], selected)


@pytest.mark.slow
def test_a_fit_to_nearly_exact_torques_reaches_their_noise() -> None:
    """Its descent starts at links that can exist and explain them: a narrow valley leads there."""
    recorded, _ = runs(3, 300, noise=1e-3)
    model = fit(recorded, FitSettings(description=panda_urdf().read_text()))
    assert model.arm is not None
    np.testing.assert_allclose(model.arm.noise.std, 1e-3, rtol=0.3)


@pytest.mark.slow
def test_a_reversed_joint_is_noticed() -> None:
    text = urdf_of(reversed_axis(truth().chain, 1), truth().links)
    description = load_description(text, NAMES, TYPES)
    found = doubts(*started(description), description)
    assert len(found.corrections) == 1
    assert "joint 'panda_joint2' moves the other way" in found.corrections[0]
    assert 'is not the description of this arm as it was recorded' in found.sentences[0]


@pytest.mark.slow
def test_a_link_of_another_model_is_noticed() -> None:
    chain = truth().chain
    translations = chain.translations.copy()
    translations[3] += [0.03, 0.05, 0.0]
    text = urdf_of(chain._replace(translations=translations), truth().links)
    description = load_description(text, NAMES, TYPES)
    found = doubts(*started(description), description)
    assert found.corrections == ()
    assert found.deviations[3] > 5.0
    assert "The data place joint 'panda_joint4'" in ' '.join(found.sentences)


def test_the_prior_is_centred_on_the_description() -> None:
    usual = scale_of(3.0, 0.3)
    settings = DescriptionSettings(0.01, 0.002, 0.25)
    prior = ArmPrior.described(truth(), settings, usual)
    still = np.zeros((N, 11))
    np.testing.assert_allclose(prior.deviation(truth().chain, still), 0.0, atol=1e-12)
    links = link_parameters(still, prior.scale)
    np.testing.assert_allclose(links[:, :10], truth().links[:, :10], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(prior.precision[:DIRECTIONS], [100.0] * 3 + [500.0] * 3)
    np.testing.assert_allclose(prior.precision[6 * N : 6 * N + 11], [8.0] * 10 + [0.3])


def test_links_without_inertials_have_the_usual_prior() -> None:
    usual = scale_of(3.0, 0.3)
    first, *others = truth().bodies
    none = tuple(replace(body, parameters=np.zeros(10)) for body in first)
    bare = replace(truth(), bodies=(none, *others))
    prior = ArmPrior.described(bare, DescriptionSettings(), usual)
    np.testing.assert_array_equal(prior.scale.factors[0], usual.factors[0])
    assert prior.precision[6 * N] == 0.3


def test_the_gradient_with_a_description_by_differences() -> None:
    data = motion(0, 20, 25).select(np.arange(0, 500, 25))
    fitter, fit_ = started(load_description(perturbed(1), NAMES, TYPES))
    problem = fitter.problem(data, fit_)
    state = problem.evaluated(fit_.state)
    assert_gradient(problem, state, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize('kernel', ['recursive', 'articulated'])
def test_a_description_needs_an_articulated_fit(kernel: str) -> None:
    data = motion(0, 20, 25).select(np.arange(12))
    with pytest.raises(ConfigError, match='is the prior of an articulated fit to at least 14'):
        fit(data, FitSettings(description='arm.urdf', kernel=kernel))
