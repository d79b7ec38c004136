"""Posterior standard deviations against the textbook's dense formula."""

from __future__ import annotations

from kernels.cases import random_states
from model.models import KERNELS, random_model, with_noise
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.energy_covariance import kinetic_covariance, potential_covariance
from lip_id_ros.kernels.posterior import BLOCK
from lip_id_ros.model import InverseDynamicsModel, StandardDeviation

States = tuple[Array, Array, Array]


def queries(n_samples: int) -> States:
    return random_states(n_samples, 3, np.random.default_rng(9))


def explained(model: InverseDynamicsModel, cross: Array) -> Array:
    """Return diag(k K^-1 k^T)."""
    gram = model.process.prior.cross_gram(model.process.states, model.process.states)
    noise = np.tile(model.process.prior.hyperparameters.noise_variance, model.n_samples)
    return np.asarray(np.diagonal(cross @ np.linalg.solve(gram + np.diag(noise), cross.T)))


def prior_energies(model: InverseDynamicsModel, x: States) -> tuple[Array, Array]:
    """Return the prior variances of T, and of V less V at the reference, one sample at a time."""
    kernel, weights = model.process.prior.kernel, model.process.prior.hyperparameters.weights
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
    variances = np.array(kinetic), np.array(potential)
    for links in kernel.links:
        difference = links.potential(x[0]) - links.potential(model.potential_reference[None])
        variances[0][:] += (links.kinetic(x[0], x[1]) ** 2).sum(axis=1)
        variances[1][:] += (difference**2).sum(axis=1)
    return variances


def textbook(model: InverseDynamicsModel, x: States) -> StandardDeviation:
    """Return the prior variance less what the data explain, under a square root."""
    prior = model.process.prior
    states = prior.kernel.states(*x)
    still = np.zeros((1, model.n_joints))
    rest = prior.kernel.states(model.potential_reference[None], still, still)
    cross = prior.cross_gram(states, model.process.states)
    kinetic, potential = prior.energy_covariance(states, model.process.states)
    _, reference = prior.energy_covariance(rest, model.process.states)
    tau = np.diagonal(prior.cross_gram(states, states)) - explained(model, cross)
    prior_kinetic, prior_potential = prior_energies(model, x)
    return StandardDeviation(
        np.sqrt(tau).reshape(x[0].shape),
        np.sqrt(prior_kinetic - explained(model, kinetic)),
        np.sqrt(prior_potential - explained(model, potential - reference)),
    )


@pytest.mark.parametrize('terms', [(), ('friction', 'residual')])
@pytest.mark.parametrize('member', KERNELS)
def test_against_the_textbook(member: str, terms: tuple[str, ...]) -> None:
    model = random_model(member, terms=terms)
    x = queries(5)
    got, expected = model.standard_deviation(*x), textbook(model, x)
    assert got.potential is not None
    assert expected.potential is not None
    np.testing.assert_allclose(got.tau, expected.tau, rtol=1e-7)
    np.testing.assert_allclose(got.kinetic, expected.kinetic, rtol=1e-7)
    np.testing.assert_allclose(got.potential, expected.potential, rtol=1e-7)


@pytest.mark.parametrize('member', KERNELS)
def test_nothing_is_uncertain_where_it_was_measured_without_noise(member: str) -> None:
    model = with_noise(random_model(member, terms=()), 1e-10)
    states = model.process.states
    got = model.standard_deviation(states.q, states.dq, states.ddq)
    prior = np.sqrt(model.process.prior.torque_variance(states))
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
    prior = model.process.prior.torque_variance(model.process.prior.kernel.states(*x))
    assert (got.tau**2 < prior).all()


def test_queries_are_independent_of_their_block() -> None:
    predictor = random_model('recursive')
    x = queries(BLOCK + 3)
    whole = predictor.standard_deviation(*x)
    part = predictor.standard_deviation(*(values[BLOCK - 2 :] for values in x))
    np.testing.assert_allclose(whole.tau[BLOCK - 2 :], part.tau, rtol=1e-9)
    np.testing.assert_allclose(whole.kinetic[BLOCK - 2 :], part.kinetic, rtol=1e-9)
