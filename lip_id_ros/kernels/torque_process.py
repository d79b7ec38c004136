"""The Gaussian process of torques and energies: prior, friction and noise, and its posterior."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import gram as energy
from lip_id_ros.kernels.features import JointBasis, PackedStates
from lip_id_ros.kernels.hyperparameters import Hyperparameters
from lip_id_ros.kernels.program import EnergyKernel, kinetic_covariance, potential_covariance
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

    `alpha`, shape (N, n), is (K + noise)^-1 tau: the weights of the posterior mean.

    """

    prior: TorquePrior
    states: JointStates
    tau: Array
    alpha: Array

    @classmethod
    def condition(cls, prior: TorquePrior, states: JointStates, tau: Array) -> TorquePosterior:
        """Condition a prior on samples; FitError if the Gram matrix cannot be factorised."""
        factor = CholeskyFactor.of(prior.noisy_gram(states))
        return cls(prior, states, tau, factor.solve(tau.ravel()).reshape(tau.shape))

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

        At `reference`, shape (n,), the potential energy is zero and certain.

        Returns
        -------
        tau : array, shape (N, n)
            Of noiseless torques [(N m)^2 or N^2].
        kinetic, potential : arrays, shape (N,)
            [J^2].

        """
        tau, kinetic, potential = np.empty_like(q), np.empty(len(q)), np.empty(len(q))
        for start in range(0, len(q), BLOCK):
            rows = slice(start, start + BLOCK)
            x = self.prior.kernel.states(q[rows], dq[rows], ddq[rows])
            tau[rows], kinetic[rows], potential[rows] = self._block(x, reference[None])
        return tau, kinetic, potential

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
