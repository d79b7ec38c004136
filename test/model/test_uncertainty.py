"""Posterior standard deviations against the textbook's formula with covariances by torch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from gp.processes import process_of
from kernels.cases import MEMBERS, random_states
from kernels.reference import EnergyReference, State
from model.models import KERNELS, random_model, with_noise
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from torch_later import needs_torch, torch

from lip_id_ros import numba_jit
from lip_id_ros.arrays import Array
from lip_id_ros.friction.basis import FrictionBasis
from lip_id_ros.friction.drives import DriveTerm
from lip_id_ros.friction.model import FrictionModel
from lip_id_ros.friction.terms import coulomb
from lip_id_ros.kernels import JointStates, TorquePrior, Weights
from lip_id_ros.kernels.torque_process import BLOCK
from lip_id_ros.model import InverseDynamicsModel, StandardDeviation
from lip_id_ros.model.arm_deviation import ArmDeviation, FEW
from lip_id_ros.model.arm_posterior import ArmPosterior, compacted
from lip_id_ros.model.inverse_dynamics_model import ARTICULATED
from lip_id_ros.rigid_body.regressor import kinetic_regressor, potential_regressor
from lip_id_ros.rigid_body.rnea_derivatives import energy_derivatives

States = tuple[Array, Array, Array]


def queries(n_samples: int) -> States:
    return random_states(n_samples, 3, np.random.default_rng(9))


def textbook(model: InverseDynamicsModel, x: States) -> StandardDeviation:
    """Return the prior variance less what the data explain, under a square root."""
    process = process_of(model)
    prior, training = Covariances(process.prior), tensors(process.states)
    here, rest = State(*map(torch.tensor, x)), at_rest(model.potential_reference)
    noise = np.tile(process.prior.hyperparameters.noise_variance, len(process.states))
    gram = prior.torques(training, training) + np.diag(noise)

    def remaining(own: Array, cross: Array) -> Array:
        variance = own - np.diagonal(cross @ np.linalg.solve(gram, cross.T))
        return np.sqrt(process.inflation * variance)

    potential = prior.energies(prior.energy.potential_row, here, training) - prior.energies(
        prior.energy.potential_row, rest, training
    )
    own = np.diagonal(prior.torques(here, here))
    tau = remaining(own, prior.torques(here, training)).reshape(x[0].shape)
    return StandardDeviation(
        tau,
        np.sqrt(tau**2 + process.prior.hyperparameters.noise_variance),
        remaining(
            np.array(
                [float(prior.energy.kinetic(q, dq, q, dq)) for q, dq, _ in zip(*here, strict=True)]
            ),
            prior.energies(prior.energy.kinetic_row, here, training),
        ),
        remaining(prior.potential_variance(here, rest), potential),
    )


class Covariances:
    """Covariances of a prior by automatic differentiation of its definition."""

    def __init__(self, prior: TorquePrior) -> None:
        at = prior.hyperparameters
        weights = Weights(*map(torch.tensor, at.weights))
        self.energy = EnergyReference(prior.kernel.energy, prior.kernel.basis, weights)
        self.friction, self.kernel = at.friction, prior.kernel.friction

    def torques(self, x: State, z: State) -> Array:
        """Return the covariances of torques, shape (N n, M n)."""
        blocks = self.energy.torque_blocks(x, z).numpy()
        if self.kernel is not None and self.friction is not None:
            n, width = len(self.friction), self.kernel.sign_width
            for joint, (viscous, coulomb, offset) in enumerate(self.friction):
                v, w = x.dq[:, None, joint].numpy(), z.dq[None, :, joint].numpy()
                signs = np.tanh(v / width[joint]) * np.tanh(w / width[joint])
                blocks[:, :, joint, joint] += viscous * v * w + coulomb * signs + offset
            assert blocks.shape[2:] == (n, n)
        return np.asarray(blocks.transpose(0, 2, 1, 3).reshape(x.q.numel(), z.q.numel()))

    def energies(self, row: Callable[[State, State], Any], x: State, z: State) -> Array:
        """Return the covariances of an energy with torques, shape (N, M n)."""
        rows = [[row(a, b).numpy() for b in samples(z)] for a in samples(x)]
        return np.array(rows).reshape(len(x.q), -1)

    def potential_variance(self, x: State, rest: State) -> Array:
        """Return the variances of V less V at rest, shape (N,)."""
        k, q0 = self.energy.potential, rest.q[0]
        return np.array([float(k(q, q) - 2.0 * k(q, q0) + k(q0, q0)) for q in x.q])


def samples(x: State) -> list[State]:
    return [State(*row) for row in zip(*x, strict=True)]


def tensors(states: JointStates) -> State:
    return State(*(torch.tensor(values) for values in (states.q, states.dq, states.ddq)))


def at_rest(q: Array) -> State:
    return State(*torch.tensor(np.stack([q, 0.0 * q, 0.0 * q])[:, None]))


@needs_torch
@pytest.mark.parametrize('friction', [False, True])
@pytest.mark.parametrize('member', MEMBERS)
def test_against_the_textbook(member: str, friction: bool) -> None:
    model = random_model(member, n_samples=3, friction=friction)
    x = queries(2)
    got, expected = model.standard_deviation(*x), textbook(model, x)
    assert got.potential is not None
    assert expected.potential is not None
    np.testing.assert_allclose(got.tau, expected.tau, rtol=1e-7)
    np.testing.assert_allclose(got.measurement, expected.measurement, rtol=1e-7)
    np.testing.assert_allclose(got.kinetic, expected.kinetic, rtol=1e-7)
    np.testing.assert_allclose(got.potential, expected.potential, rtol=1e-7)


@pytest.mark.parametrize('member', MEMBERS)
def test_nothing_is_uncertain_where_it_was_measured_without_noise(member: str) -> None:
    model = with_noise(random_model(member, friction=False), 1e-10)
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


def test_queries_are_independent_of_their_block() -> None:
    predictor = random_model('recursive')
    x = queries(BLOCK + 3)
    whole = predictor.standard_deviation(*x)
    part = predictor.standard_deviation(*(values[BLOCK - 2 :] for values in x))
    np.testing.assert_allclose(whole.tau[BLOCK - 2 :], part.tau, rtol=1e-9)
    np.testing.assert_allclose(whole.kinetic[BLOCK - 2 :], part.kinetic, rtol=1e-9)


def test_deviations_of_an_arm_by_differences_of_the_mean() -> None:
    """Torques and energies change along each column of the covariance's root as they should."""
    model = random_model(ARTICULATED, residual_gp=False)
    arm = model.arm
    assert arm is not None
    assert arm.friction.basis.is_loaded.sum() == 2
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


def test_a_measurement_of_an_arm_has_its_noise_too() -> None:
    """Noise of the samples' velocities, more of it near rest, beside that of the torque."""
    model, (q, _, ddq) = random_model(ARTICULATED), queries(2)
    assert model.arm is not None
    noise, dq = model.arm.noise, np.stack([np.zeros(3), np.full(3, 1e3)])
    std = model.predict(q, dq, ddq, return_std=True).std
    assert std is not None
    at_rest = noise.std**2 * (1.0 + noise.ratio**2) + noise.stuck**2
    expected = np.sqrt(std.tau**2 + np.stack([at_rest, noise.std**2]))
    np.testing.assert_allclose(std.measurement, expected, rtol=1e-12)


@pytest.mark.parametrize('count', [1, 3 * FEW, numba_jit.FEW + 1])
def test_compiled_deviations_are_the_plain_ones(count: int) -> None:
    model = random_model(ARTICULATED, residual_gp=False)
    assert model.arm is not None
    x = queries(count)
    got = model.torque_std(*x)
    np.testing.assert_allclose(got, model.arm.torque_std(*x), rtol=1e-12)


def widened(arm: ArmPosterior, by: Array) -> ArmPosterior:
    """Return the arm with logarithms of the widths of Coulomb friction changed, shape (W,)."""
    terms, factors = [], iter(np.exp(by).tolist())
    for part in arm.friction.basis.terms:
        term = part.term
        if term.kind is coulomb:
            term = coulomb(term.parameters['width'] * next(factors))
        terms.append(DriveTerm(part.drive, term))
    basis = FrictionBasis(arm.friction.n_joints, tuple(terms))
    return replace(arm, friction=FrictionModel(basis, arm.friction.coefficients))


def test_widths_of_signs_have_deviations(tmp_path: Path) -> None:
    """By differences of the mean; compiled, and from a file, the same."""
    model = random_model(ARTICULATED, residual_gp=False)
    assert model.arm is not None
    std, step = np.array([0.1, 0.2, 0.05]), 1e-4
    root = np.zeros((len(model.arm.covariance_root) + std.size, std.size))
    root[-std.size :] = np.diag(std * model.arm.friction.shape_std)
    arm = replace(model.arm, covariance_root=root.astype(np.float32).astype(np.float64))
    q, dq, ddq = queries(50)
    x = q, 0.2 * dq, ddq
    slopes = [
        (widened(arm, step * unit).torque(*x) - widened(arm, -step * unit).torque(*x)) / (2 * step)
        for unit in np.eye(std.size)
    ]
    expected = np.sqrt(np.einsum('kti,k->ti', np.square(slopes), std**2))
    np.testing.assert_allclose(arm.torque_std(*x), expected, rtol=1e-3, atol=1e-3)
    uncertain = replace(model, arm=arm)
    few = [some[:FEW] for some in x]
    np.testing.assert_allclose(uncertain.torque_std(*few), arm.torque_std(*few), rtol=1e-12)
    uncertain.save(tmp_path / 'arm.npz')
    loaded = InverseDynamicsModel.load(tmp_path / 'arm.npz')
    np.testing.assert_allclose(loaded.torque_std(*few), arm.torque_std(*few), rtol=1e-12)


@pytest.mark.parametrize('seed', range(3))
def test_a_compact_posterior_has_the_deviations_of_the_whole(seed: int) -> None:
    """In fewer coordinates and bits, at states that were not looked at, energies included."""
    rng = np.random.default_rng(seed)
    model = random_model(ARTICULATED, residual_gp=False, seed=seed)
    assert model.arm is not None
    count = len(model.arm.covariance_root)
    whole = replace(model.arm, covariance_root=rng.normal(size=(count, count)))
    few = compacted(whole, model.training_range)
    assert few.covariance_root.any(axis=1).sum() < 0.75 * count
    x = queries(100)
    np.testing.assert_allclose(few.torque_std(*x), whole.torque_std(*x), rtol=1e-3)
    for got, expected in zip(energy_std(few, *x), energy_std(whole, *x), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-3, atol=1e-9)
    compiled = ArmDeviation(few, x[0][0]).energy_std(*x[:2])
    for got, expected in zip(compiled, energy_std(few, *x), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-12)


def energy_std(arm: ArmPosterior, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array]:
    """Return deviations of both energies, the potential one relative to the first position."""
    kinetic, potential = energy_derivatives(arm.chain, arm.links, q, dq)
    potential = np.hstack([potential.reshape(len(q), -1), potential_regressor(arm.chain, q)])
    kinetic = np.hstack([kinetic.reshape(len(q), -1), kinetic_regressor(arm.chain, q, dq)])
    root = arm.covariance_root[: kinetic.shape[1]]
    at_reference = potential - potential[0]
    return np.linalg.norm(kinetic @ root, axis=1), np.linalg.norm(at_reference @ root, axis=1)


def moved(arm: ArmPosterior, by: Array) -> ArmPosterior:
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
