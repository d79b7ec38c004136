"""The Gaussian process of torques and energies: hyperparameters, prior and posterior."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.kernels import gram as energy
from lip_id_ros.kernels.features import JointBasis, PackedStates
from lip_id_ros.kernels.program import (
    EnergyKernel,
    kinetic_covariance,
    potential_covariance,
    Weights,
)
from lip_id_ros.linear_algebra import CholeskyFactor


@dataclass(frozen=True)
class FrictionKernel:
    """
    Linear kernel in velocity, its sign and a constant, each joint by itself.

    Parameters (n, 3) are prior variances of the viscous coefficient, of the Coulomb torque and of
    the offset (paper, eq. `kernel_epsilon`, without its squared exponential). The sign is tanh(dq
    / sign_width): the torque that a controller adds must not jump.
    """

    sign_width: Array

    def features(self, dq: Array) -> Array:
        """Return the features of velocities (N, n), shape (n, N, 3)."""
        return np.stack([dq.T, np.tanh(dq / self.sign_width).T, np.ones_like(dq.T)], axis=-1)


def friction_covariance(parameters: Array, x: Array, z: Array) -> Array:
    """Return the covariances (n, N, M) of friction torques with features (n, N, 3), (n, M, 3)."""
    return np.asarray((x * parameters[:, None, :]) @ z.transpose(0, 2, 1))


def friction_gradient(x: Array, contraction: Array) -> Array:
    """Return the derivatives (n, 3) of sum(contraction * covariance); contraction (n, N, N)."""
    return np.asarray(np.einsum('itc,itc->ic', x, contraction @ x))


def friction_coefficients(parameters: Array, x: Array, alpha: Array) -> Array:
    """Return the coefficients' posterior mean, shape (n, 3), for alpha of shape (N, n)."""
    return np.asarray(parameters * np.einsum('itc,ti->ic', x, alpha))


@dataclass(frozen=True)
class Hyperparameters:
    """
    Everything that is optimised; all numbers positive.

    `friction` has shape (n, 3), None without friction; `noise_variance` (n,) [(N m)^2 or N^2].
    """

    weights: Weights
    friction: Array | None
    noise_variance: Array

    def groups(self) -> dict[str, Array]:
        """Return every group of hyperparameters by its name, in the order of the vector."""
        own = {} if self.friction is None else {'friction': self.friction}
        return {**self.weights._asdict(), **own, 'noise_variance': self.noise_variance}

    def vector(self) -> Array:
        """Return the logarithms of all hyperparameters, shape (p,)."""
        return np.concatenate([np.log(values).ravel() for values in self.groups().values()])

    def with_vector(self, vector: Array) -> Hyperparameters:
        """Return the hyperparameters whose logarithms are `vector`, in the shapes of these."""
        return self.filled([values for _, values in self._split(np.exp(vector))])

    def filled(self, groups: Sequence[Any]) -> Hyperparameters:
        """Return hyperparameters from groups in the order of `groups`: arrays or tensors."""
        count = len(Weights._fields)
        friction = None if self.friction is None else groups[count]
        return Hyperparameters(Weights(*groups[:count]), friction, groups[-1])

    def names(self) -> list[str]:
        """Return a name such as ``velocities[0, 3]`` for every entry of the vector."""
        return [
            f'{name}{list(index)}'
            for name, values in self.groups().items()
            for index in np.ndindex(values.shape)
        ]

    def cosines_and_sines(self) -> tuple[IntArray, IntArray]:
        """Return where the vector has the weights of the factors' cosines, and their sines."""
        size = sum(values.size for values in self.groups().values())
        places = dict(self._split(np.arange(size)))
        kinetic, potential = places['factors'], places['potential_factors']
        factors = np.concatenate([kinetic.reshape(-1, 3), potential])
        return factors[:, 1], factors[:, 2]

    def log_gradient(self, gradient: Hyperparameters) -> Array:
        """Turn derivatives by these numbers into those by their logarithms, shape (p,)."""
        pairs = zip(gradient.groups().values(), self.groups().values(), strict=True)
        return np.concatenate([(by * values).ravel() for by, values in pairs])

    def _split(self, vector: NDArray[Any]) -> Iterator[tuple[str, NDArray[Any]]]:
        start = 0
        for name, values in self.groups().items():
            yield name, vector[start : start + values.size].reshape(values.shape)
            start += values.size


@dataclass(frozen=True, eq=False)
class JointStates:
    """Joint states (N, n) prepared for every kernel; features of friction (n, N, 3) or None."""

    q: Array
    dq: Array
    ddq: Array
    packed: PackedStates
    friction: Array | None = None

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.q)


@dataclass(frozen=True)
class TorqueKernel:
    """The kernels that make up the prior, without their hyperparameters."""

    energy: EnergyKernel
    basis: JointBasis
    friction: FrictionKernel | None = None

    @property
    def has_potential(self) -> bool:
        """Whether any of the prior is potential energy."""
        return len(self.energy.potential_links) > 0

    def states(self, q: Array, dq: Array, ddq: Array) -> JointStates:
        """Prepare joint states, each of shape (N, n); ShapeError if they are not."""
        packed = self.basis.pack(q, dq, ddq)
        friction = None if self.friction is None else self.friction.features(dq)
        return JointStates(q, dq, ddq, packed, friction)


@dataclass(frozen=True)
class TorquePrior:
    """Gaussian process prior on the torques and the energies."""

    kernel: TorqueKernel
    hyperparameters: Hyperparameters

    def gram(self, x: JointStates) -> Array:
        """Gram matrix of noiseless torques (paper, eq. `kernel_with_fric`), as `gram.gram`."""
        out = energy.gram(self.kernel.energy, self.hyperparameters.weights, x.packed)
        return self._with_friction(out, x, x)

    def noisy_gram(self, x: JointStates) -> Array:
        """Gram matrix of measured torques: `gram` plus the noise variances on the diagonal."""
        out = self.gram(x)
        out.reshape(-1)[:: len(out) + 1] += np.tile(self.hyperparameters.noise_variance, len(x))
        return out

    def cross_gram(self, x: JointStates, z: JointStates) -> Array:
        """Covariances of noiseless torques at x and z, shape (N n, M n)."""
        weights = self.hyperparameters.weights
        out = energy.cross_gram(self.kernel.energy, weights, x.packed, z.packed)
        return self._with_friction(out, x, z)

    def torque_variance(self, x: JointStates) -> Array:
        """Prior variances of noiseless torques, shape (N, n)."""
        weights = self.hyperparameters.weights
        blocks = energy.prior_blocks(self.kernel.energy, weights, x.packed)
        out: Array = np.einsum('tii->ti', blocks).copy()
        parameters = self.hyperparameters.friction
        if x.friction is not None and parameters is not None:
            out += np.einsum('itc,ic->ti', x.friction**2, parameters)
        return out

    def kinetic_variance(self, x: JointStates) -> Array:
        """Prior variances of the kinetic energy, shape (N,) [J^2]."""
        f, _ = self.kernel.basis.features(x.q)
        weights = self.hyperparameters.weights
        values = kinetic_covariance(self.kernel.energy, weights, f, x.dq.T, f, x.dq.T)
        return np.full(len(x), values, dtype=np.float64)

    def potential_covariance(self, q: Array, z: Array) -> Array:
        """Prior covariances of potential energies at rows of q and z, shapes (N or 1, n) [J^2]."""
        f, _ = self.kernel.basis.features(q)
        fz, _ = self.kernel.basis.features(z)
        weights = self.hyperparameters.weights
        values = potential_covariance(self.kernel.energy, weights, f, fz)
        return np.array(values, dtype=np.float64)

    def energy_covariance(self, x: JointStates, z: JointStates) -> tuple[Array, Array]:
        """Covariances of kinetic and potential energy at x with torques at z, shapes (N, M n)."""
        weights = self.hyperparameters.weights
        return energy.energy_covariance(self.kernel.energy, weights, x.packed, z.packed)

    def _with_friction(self, out: Array, x: JointStates, z: JointStates) -> Array:
        n, parameters = self.kernel.energy.n_joints, self.hyperparameters.friction
        if parameters is not None and x.friction is not None and z.friction is not None:
            for i, covariance in enumerate(
                friction_covariance(parameters, x.friction, z.friction)
            ):
                out[i::n, i::n] += covariance
        return out


BLOCK = 64
"""Queries per block: bounds the memory of the covariances with the training samples."""


@dataclass(frozen=True, eq=False)
class TorquePosterior:
    """
    Gaussian process posterior of torques and energies, given N samples.

    `alpha`, shape (N, n), is (K + noise)^-1 tau: the weights of the posterior mean. `inflation` is
    a factor of its variances, for residuals that are correlated in time.
    """

    prior: TorquePrior
    states: JointStates
    tau: Array
    alpha: Array
    inflation: float = 1.0

    @cached_property
    def factor(self) -> CholeskyFactor:
        """Factor of the noisy Gram matrix: (n N)^3 / 3 operations and (n N)^2 numbers."""
        return CholeskyFactor.of(self.prior.noisy_gram(self.states))

    @property
    def noise_std(self) -> Array:
        """Standard deviation of each torque's measurement noise, shape (n,) [N m or N]."""
        return np.sqrt(self.prior.hyperparameters.noise_variance)

    def variances(
        self, q: Array, dq: Array, ddq: Array, reference: Array
    ) -> tuple[Array, Array, Array]:
        """
        Posterior variances (paper, eqs. `GP-posterior` and section `sec:energy_est`).

        Of noiseless torques, (N, n) [(N m)^2 or N^2], and of both energies, (N,) [J^2]. At
        `reference`, shape (n,), the potential energy is zero and certain.
        """
        tau, kinetic, potential = np.empty_like(q), np.empty(len(q)), np.empty(len(q))
        for start in range(0, len(q), BLOCK):
            rows = slice(start, start + BLOCK)
            x = self.prior.kernel.states(q[rows], dq[rows], ddq[rows])
            tau[rows], kinetic[rows], potential[rows] = self._block(x, reference[None])
        return self.inflation * tau, self.inflation * kinetic, self.inflation * potential

    def _block(self, x: JointStates, reference: Array) -> tuple[Array, Array, Array]:
        prior, training = self.prior, self.states
        torque = self._explained(prior.cross_gram(x, training))
        kinetic, potential = prior.energy_covariance(x, training)
        still = np.zeros_like(reference)
        at = prior.kernel.states(reference, still, still)
        _, of_reference = prior.energy_covariance(at, training)
        covariance = prior.potential_covariance
        difference = (
            covariance(x.q, x.q)
            - 2.0 * covariance(x.q, reference)
            + covariance(reference, reference)
        )
        return (
            np.maximum(prior.torque_variance(x) - torque.reshape(x.q.shape), 0.0),
            np.maximum(prior.kinetic_variance(x) - self._explained(kinetic), 0.0),
            np.maximum(difference - self._explained(potential - of_reference), 0.0),
        )

    def _explained(self, covariance: Array) -> Array:
        half = self.factor.half_solve(covariance.T)
        return np.asarray(np.einsum('kt,kt->t', half, half))
