"""Models with random weights and random data: every formula must hold for them, too."""

from __future__ import annotations

from collections.abc import Callable

from gp.cases import random_hyperparameters, random_kernel, TYPES
from kernels.cases import Array, random_states
import numpy as np

from lip_id_ros.kernels import EnergyKernel, Hyperparameters, TorqueKernel, TorquePrior
from lip_id_ros.kernels.program import without_potential
from lip_id_ros.model import TrainedModel

BOTH = ('friction', 'residual')


def random_model(
    member: str,
    types: tuple[str, ...] = TYPES,
    n_samples: int = 7,
    terms: tuple[str, ...] = BOTH,
    seed: int = 0,
) -> TrainedModel:
    """Return a model that is conditioned on random torques."""
    rng = np.random.default_rng(seed)
    kernel = random_kernel(member, types, terms, rng)
    return conditioned(TorquePrior(kernel, random_hyperparameters(kernel, rng)), n_samples, rng)


def random_model_without_potential(member: str) -> TrainedModel:
    """Return a model of torques that leave gravity out."""
    return random_model_with(without_potential, member)


def random_model_with(
    potential: Callable[[EnergyKernel], EnergyKernel], member: str
) -> TrainedModel:
    """Return a model whose potential energy is another than the kernel's own."""
    rng = np.random.default_rng(0)
    own = random_kernel(member, TYPES, (), rng)
    kernel = TorqueKernel(potential(own.energy), own.basis)
    hyperparameters = random_hyperparameters(kernel, rng)
    return conditioned(TorquePrior(kernel, hyperparameters), 7, rng)


def with_noise(model: TrainedModel, variance: float) -> TrainedModel:
    """Condition the model's prior on the same motions, with a noise variance for all joints."""
    at = model.prior.hyperparameters
    noise = np.full_like(at.noise_variance, variance)
    prior = TorquePrior(model.prior.kernel, Hyperparameters(at.weights, at.jointwise, noise))
    return conditioned(prior, model.n_samples, np.random.default_rng(1))


def conditioned(prior: TorquePrior, n_samples: int, rng: np.random.Generator) -> TrainedModel:
    n = prior.kernel.energy.n_joints
    states = prior.kernel.states(*random_states(n_samples, n, rng))
    tau: Array = rng.normal(size=(n_samples, n))
    alpha = np.linalg.solve(prior.noisy_gram(states), tau.ravel()).reshape(tau.shape)
    return TrainedModel(
        joint_names=tuple(f'joint_{i + 1}' for i in range(n)),
        prior=prior,
        states=states,
        tau=tau,
        alpha=alpha,
        summary={'potential_reference': rng.normal(size=n).tolist()},
    )
