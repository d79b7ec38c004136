"""Random priors and torques for the tests of this folder."""

from __future__ import annotations

from kernels.cases import random_basis, random_states, random_weights
import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.gp.likelihood import MarginalLikelihood
from lip_id_ros.kernels import (
    FAMILY,
    Friction,
    Hyperparameters,
    PerJointKernel,
    Residual,
    TorqueKernel,
)
from lip_id_ros.kernels.program import without_potential

R, P = 'revolute', 'prismatic'
TYPES = (R, P, R)
TERMS = ((), ('friction',), ('residual',), ('friction', 'residual'))


def random_kernel(
    member: str,
    types: tuple[str, ...],
    terms: tuple[str, ...],
    rng: np.random.Generator,
) -> TorqueKernel:
    """Return the kernel of an arm with the named per-joint terms."""
    n = len(types)
    basis = random_basis(types, rng)
    choices: dict[str, PerJointKernel] = {
        'friction': Friction(0.1 + rng.random(n)),
        'residual': Residual(basis, 0.5 + rng.random((2, n))),
    }
    return TorqueKernel(FAMILY[member](n), basis, tuple(choices[term] for term in terms))


def random_hyperparameters(kernel: TorqueKernel, rng: np.random.Generator) -> Hyperparameters:
    """Draw weights around one half and noise a tenth of that."""
    n = kernel.energy.n_joints
    columns = {'friction': 3, 'residual': 4}
    return Hyperparameters(
        weights=random_weights(kernel.energy, rng),
        per_joint=tuple(0.5 + rng.random((n, columns[term.name])) for term in kernel.per_joint),
        noise_variance=0.05 + 0.1 * rng.random(n),
    )


def random_likelihood(
    member: str, types: tuple[str, ...], terms: tuple[str, ...], n_samples: int, seed: int = 0
) -> MarginalLikelihood:
    """Return the likelihood of random torques; its `like` is a point to evaluate it at."""
    rng = np.random.default_rng(seed)
    kernel = random_kernel(member, types, terms, rng)
    states = kernel.states(*random_states(n_samples, len(types), rng))
    tau: Array = rng.normal(size=(n_samples, len(types)))
    return MarginalLikelihood(kernel, states, tau, random_hyperparameters(kernel, rng))


def without_gravity(likelihood: MarginalLikelihood) -> MarginalLikelihood:
    """Return the likelihood of torques that leave gravity out."""
    kernel, like = likelihood.kernel, likelihood.like
    energy = without_potential(kernel.energy)
    weights = like.weights._replace(potential_scales=np.empty(0))
    return MarginalLikelihood(
        TorqueKernel(energy, kernel.basis, kernel.per_joint),
        likelihood.states,
        likelihood.tau,
        Hyperparameters(weights, like.per_joint, like.noise_variance),
    )
