"""Random priors and torques for the tests of this folder."""

from __future__ import annotations

from dataclasses import replace

from kernels.cases import random_basis, random_states, random_weights
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.gp.training import MarginalLikelihood
from lip_id_ros.kernels import FAMILY, FrictionKernel, Hyperparameters, TorqueKernel
from lip_id_ros.kernels.program import without_potential

R, P = 'revolute', 'prismatic'
TYPES = (R, P, R)


def random_kernel(
    member: str, types: tuple[str, ...], friction: bool, rng: np.random.Generator
) -> TorqueKernel:
    n = len(types)
    basis = random_basis(types, rng)
    return TorqueKernel(
        FAMILY[member](n), basis, FrictionKernel(0.1 + rng.random(n)) if friction else None
    )


def random_hyperparameters(kernel: TorqueKernel, rng: np.random.Generator) -> Hyperparameters:
    """Draw weights around one half and noise a tenth of that."""
    n = kernel.energy.n_joints
    return Hyperparameters(
        weights=random_weights(kernel.energy, rng),
        friction=None if kernel.friction is None else 0.5 + rng.random((n, 3)),
        noise_variance=0.05 + 0.1 * rng.random(n),
    )


def random_likelihood(
    member: str, types: tuple[str, ...], friction: bool, n_samples: int
) -> MarginalLikelihood:
    """Return the likelihood of random torques; its `like` is a point to evaluate it at."""
    rng = np.random.default_rng(0)
    kernel = random_kernel(member, types, friction, rng)
    states = kernel.states(*random_states(n_samples, len(types), rng))
    tau: Array = rng.normal(size=(n_samples, len(types)))
    return MarginalLikelihood(kernel, states, tau, random_hyperparameters(kernel, rng))


def without_gravity(likelihood: MarginalLikelihood) -> MarginalLikelihood:
    kernel, like = likelihood.kernel, likelihood.like
    weights = like.weights._replace(potential_scales=np.empty(0))
    return replace(
        likelihood,
        kernel=replace(kernel, energy=without_potential(kernel.energy)),
        like=replace(like, weights=weights),
    )
