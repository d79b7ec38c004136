"""Models with random weights and random data: every formula must hold for them, too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from gp.cases import random_hyperparameters, random_kernel, TYPES
from kernels.cases import MEMBERS, random_links, random_states
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import (
    ARTICULATED,
    EnergyKernel,
    Hyperparameters,
    TorqueKernel,
    TorquePosterior,
    TorquePrior,
)
from lip_id_ros.kernels.program import without_potential
from lip_id_ros.model import EffortCalibration, InverseDynamicsModel

BOTH = ('friction', 'residual')
KERNELS = (*MEMBERS, ARTICULATED)


def random_model(
    member: str,
    types: tuple[str, ...] = TYPES,
    n_samples: int = 7,
    terms: tuple[str, ...] = BOTH,
    seed: int = 0,
) -> InverseDynamicsModel:
    """Return a model that is conditioned on random torques; `ARTICULATED` has rigid links."""
    rng = np.random.default_rng(seed)
    kernel = _random_kernel(member, types, terms, rng)
    return conditioned(TorquePrior(kernel, random_hyperparameters(kernel, rng)), n_samples, rng)


def random_model_without_potential(member: str) -> InverseDynamicsModel:
    """Return a model whose energy kernel has no potential; rigid links keep theirs."""
    return random_model_with(without_potential, member)


def random_model_without_gravity() -> InverseDynamicsModel:
    """Return a model with rigid links of torques that leave gravity out."""
    model = random_model_without_potential(ARTICULATED)
    (links,) = model.process.prior.kernel.links
    weightless = replace(links, chain=links.chain._replace(gravity=np.zeros(3)))
    prior = replace(
        model.process.prior, kernel=replace(model.process.prior.kernel, links=(weightless,))
    )
    return conditioned(prior, model.n_samples, np.random.default_rng(1))


def random_model_with(
    potential: Callable[[EnergyKernel], EnergyKernel], member: str
) -> InverseDynamicsModel:
    """Return a model whose energy kernel has another potential than its own."""
    rng = np.random.default_rng(0)
    own = _random_kernel(member, TYPES, (), rng)
    kernel = replace(own, energy=potential(own.energy))
    hyperparameters = random_hyperparameters(kernel, rng)
    return conditioned(TorquePrior(kernel, hyperparameters), 7, rng)


def with_noise(model: InverseDynamicsModel, variance: float) -> InverseDynamicsModel:
    """Condition the model's prior on the same motions, with a noise variance for all joints."""
    at = model.process.prior.hyperparameters
    noise = np.full_like(at.noise_variance, variance)
    prior = TorquePrior(
        model.process.prior.kernel, Hyperparameters(at.weights, at.per_joint, noise)
    )
    return conditioned(prior, model.n_samples, np.random.default_rng(1))


def conditioned(
    prior: TorquePrior, n_samples: int, rng: np.random.Generator
) -> InverseDynamicsModel:
    n = prior.kernel.energy.n_joints
    states = prior.kernel.states(*random_states(n_samples, n, rng))
    tau: Array = rng.normal(size=(n_samples, n))
    alpha = np.linalg.solve(prior.noisy_gram(states), tau.ravel()).reshape(tau.shape)
    return InverseDynamicsModel(
        joint_names=tuple(f'joint_{i + 1}' for i in range(n)),
        process=TorquePosterior(prior, states, tau, alpha),
        potential_reference=rng.normal(size=n),
        effort_calibrations=(EffortCalibration(0.5 + rng.random(n), rng.normal(size=n)),),
    )


def _random_kernel(
    member: str, types: tuple[str, ...], terms: tuple[str, ...], rng: np.random.Generator
) -> TorqueKernel:
    if member != ARTICULATED:
        return random_kernel(member, types, terms, rng)
    beside = random_kernel('recursive', types, terms, rng)
    return replace(beside, links=(random_links(types, rng),))
