"""Posterior standard deviations against the textbook's dense formula."""

from __future__ import annotations

from dataclasses import replace

from gp.processes import process_of
from kernels.cases import MEMBERS, random_states
from model.models import KERNELS, random_model, with_noise
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lip_id_ros.arrays import Array
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import LoadCoulomb
from lip_id_ros.kernels.energy_covariance import kinetic_covariance, potential_covariance
from lip_id_ros.kernels.posterior import BLOCK
from lip_id_ros.model import InverseDynamicsModel, StandardDeviation
from lip_id_ros.model.arm_deviation import FEW
from lip_id_ros.model.arm_posterior import ArmPosterior, compacted
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED

States = tuple[Array, Array, Array]


def queries(n_samples: int) -> States:
    return random_states(n_samples, 3, np.random.default_rng(9))


def explained(model: InverseDynamicsModel, cross: Array) -> Array:
    """Return diag(k K^-1 k^T)."""
    gram = process_of(model).prior.cross_gram(process_of(model).states, process_of(model).states)
    noise = np.tile(process_of(model).prior.hyperparameters.noise_variance, model.n_samples)
    return np.asarray(np.diagonal(cross @ np.linalg.solve(gram + np.diag(noise), cross.T)))


def prior_energies(model: InverseDynamicsModel, x: States) -> tuple[Array, Array]:
    """Return the prior variances of T, and of V less V at the reference, one sample at a time."""
    kernel, weights = (
        process_of(model).prior.kernel,
        process_of(model).prior.hyperparameters.weights,
    )
    reference, _ = kernel.basis.features(model.potential_reference[None])
    kinetic, potential = [], []
    for q, dq in zip(x[0], x[1], strict=True):
        f, _ = kernel.basis.features(q[None])
        at, rest = f[:, :, 0], reference[:, :, 0]
        kinetic.append(kinetic_covariance(kernel.energy, weights, at, dq, at, dq))
        between = [
            potential_covariance(kernel.energy, weights, left, right)
            for left, right in ((at, at), (at, rest), (rest, rest))
        ]
        potential.append(between[0] - 2.0 * between[1] + between[2])
    return np.array(kinetic), np.array(potential)


def textbook(model: InverseDynamicsModel, x: States) -> StandardDeviation:
    """Return the prior variance less what the data explain, under a square root."""
    prior = process_of(model).prior
    states = prior.kernel.states(*x)
    still = np.zeros((1, model.n_joints))
    rest = prior.kernel.states(model.potential_reference[None], still, still)
    cross = prior.cross_gram(states, process_of(model).states)
    kinetic, potential = prior.energy_covariance(states, process_of(model).states)
    _, reference = prior.energy_covariance(rest, process_of(model).states)
    tau = np.diagonal(prior.cross_gram(states, states)) - explained(model, cross)
    prior_kinetic, prior_potential = prior_energies(model, x)
    return StandardDeviation(
        np.sqrt(tau).reshape(x[0].shape),
        np.sqrt(prior_kinetic - explained(model, kinetic)),
        np.sqrt(prior_potential - explained(model, potential - reference)),
    )


@pytest.mark.parametrize('terms', [(), ('friction', 'residual')])
@pytest.mark.parametrize('member', MEMBERS)
def test_against_the_textbook(member: str, terms: tuple[str, ...]) -> None:
    model = random_model(member, terms=terms)
    x = queries(5)
    got, expected = model.standard_deviation(*x), textbook(model, x)
    assert got.potential is not None
    assert expected.potential is not None
    np.testing.assert_allclose(got.tau, expected.tau, rtol=1e-7)
    np.testing.assert_allclose(got.kinetic, expected.kinetic, rtol=1e-7)
    np.testing.assert_allclose(got.potential, expected.potential, rtol=1e-7)


@pytest.mark.parametrize('member', MEMBERS)
def test_nothing_is_uncertain_where_it_was_measured_without_noise(member: str) -> None:
    model = with_noise(random_model(member, terms=()), 1e-10)
    states = process_of(model).states
    got = model.standard_deviation(states.q, states.dq, states.ddq)
    prior = np.sqrt(process_of(model).prior.torque_variance(states))
    assert (got.tau < 1e-4 * prior).all()


@pytest.mark.parametrize('member', KERNELS)
def test_the_potential_is_certain_at_its_reference(member: str) -> None:
    model = random_model(member)
    q = np.stack([model.potential_reference, model.potential_reference + 0.1])
    got = model.standard_deviation(q, np.ones((2, 3)), np.ones((2, 3)))
    assert got.potential is not None
    assert got.potential[0] < 1e-6 * got.potential[1]


@pytest.mark.parametrize('member', KERNELS)
def test_the_kinetic_energy_is_certain_at_rest(member: str) -> None:
    q, dq, ddq = queries(3)
    got = random_model(member).standard_deviation(q, 0.0 * dq, ddq)
    np.testing.assert_array_equal(got.kinetic, 0.0)


def test_data_only_take_uncertainty_away() -> None:
    model = random_model('recursive')
    x = queries(20)
    got = model.standard_deviation(*x)
    prior = process_of(model).prior.torque_variance(process_of(model).prior.kernel.states(*x))
    assert (got.tau**2 < prior).all()


def test_queries_are_independent_of_their_block() -> None:
    predictor = random_model('recursive')
    x = queries(BLOCK + 3)
    whole = predictor.standard_deviation(*x)
    part = predictor.standard_deviation(*(values[BLOCK - 2 :] for values in x))
    np.testing.assert_allclose(whole.tau[BLOCK - 2 :], part.tau, rtol=1e-9)
    np.testing.assert_allclose(whole.kinetic[BLOCK - 2 :], part.kinetic, rtol=1e-9)


def test_deviations_of_an_arm_by_differences_of_the_mean() -> None:
    """Torques and energies change along each column of the covariance's root as they should."""
    model = random_model(ARTICULATED, terms=())
    arm = without_load(model)
    model = replace(model, arm=arm)
    x, step = queries(4), 1e-6
    up, down = (
        np.array([answers(model, moved(arm, by * column), x) for column in arm.covariance_root.T])
        for by in (step, -step)
    )
    expected = np.sqrt((((up - down) / (2.0 * step)) ** 2).sum(axis=0))
    got = model.standard_deviation(*x)
    assert got.potential is not None
    found = np.column_stack([got.tau, got.kinetic, got.potential])
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6 * expected.max())


@pytest.mark.parametrize('count', [1, 3 * FEW])
def test_compiled_deviations_are_the_plain_ones(count: int) -> None:
    model = random_model(ARTICULATED, terms=())
    assert model.arm is not None
    x = queries(count)
    got = model.torque_std(*x)
    np.testing.assert_allclose(got, model.arm.torque_std(*x), rtol=1e-12)


@pytest.mark.parametrize('seed', range(3))
def test_a_compact_posterior_has_the_deviations_of_the_whole(seed: int) -> None:
    """In fewer coordinates and bits, at states that were not looked at, energies included."""
    rng = np.random.default_rng(seed)
    model = random_model(ARTICULATED, terms=(), seed=seed)
    assert model.arm is not None
    count = len(model.arm.covariance_root)
    whole = replace(model.arm, covariance_root=rng.normal(size=(count, count)))
    few = compacted(whole, model.training_range)
    assert few.covariance_root.any(axis=1).sum() < 0.75 * count
    x = queries(100)
    np.testing.assert_allclose(few.torque_std(*x), whole.torque_std(*x), rtol=1e-3)
    energies = zip(few.energy_std(*x[:2], x[0][0]), whole.energy_std(*x[:2], x[0][0]), strict=True)
    for got, expected in energies:
        np.testing.assert_allclose(got, expected, rtol=1e-3, atol=1e-9)


def without_load(model: InverseDynamicsModel) -> ArmPosterior:
    """Return a model's arm without friction by load, whose change the posterior leaves out."""
    arm = model.arm
    assert arm is not None
    loaded = [isinstance(each.term, LoadCoulomb) for each in arm.friction.basis.terms]
    friction = FrictionModel(arm.friction.basis, np.where(loaded, 0.0, arm.friction.coefficients))
    root = arm.covariance_root.copy()
    root[-len(loaded) :][loaded] = 0.0
    return replace(arm, friction=friction, covariance_root=root)


def moved(arm: ArmPosterior, by: Array) -> ArmPosterior:
    """Return the arm with its coordinates changed."""
    n = len(arm.links)
    places = by[: 6 * n].reshape(n, 6)
    turns = Rotation.from_rotvec(places[:, :3]).as_matrix()
    chain = arm.chain._replace(
        rotations=arm.chain.rotations @ turns, translations=arm.chain.translations + places[:, 3:]
    )
    friction = FrictionModel(arm.friction.basis, arm.friction.coefficients + by[17 * n :])
    links = arm.links + by[6 * n : 17 * n].reshape(n, 11)
    return replace(arm, chain=chain, links=links, friction=friction)


def answers(model: InverseDynamicsModel, arm: ArmPosterior, x: States) -> Array:
    """Return torques and energies, shape (N, n + 2)."""
    got = replace(model, arm=arm).predict(*x)
    assert got.potential is not None
    return np.column_stack([got.tau, got.kinetic, got.potential])
