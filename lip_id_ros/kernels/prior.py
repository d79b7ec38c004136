"""The whole prior of the torques: energies, what is not Lagrangian, and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import energy_covariance as definition
from lip_id_ros.kernels import gram as energy
from lip_id_ros.kernels.features import JointBasis, Samples
from lip_id_ros.kernels.per_joint import PerJointKernel
from lip_id_ros.kernels.program import EnergyKernel, Weights


@dataclass(frozen=True, eq=False)
class JointStates:
    """
    Joint states prepared for every kernel of a prior.

    Attributes
    ----------
    q, dq, ddq : arrays, shape (N, n)
    packed : Samples
    per_joint : tuple of arrays
        The inputs of each per_joint kernel.

    """

    q: Array
    dq: Array
    ddq: Array
    packed: Samples
    per_joint: tuple[Array, ...]

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.q)


@dataclass(frozen=True)
class TorqueKernel:
    """
    The kernels that make up the prior, without their hyperparameters.

    Attributes
    ----------
    energy : EnergyKernel
    basis : JointBasis
    per_joint : tuple of PerJointKernel

    """

    energy: EnergyKernel
    basis: JointBasis
    per_joint: tuple[PerJointKernel, ...] = ()

    @property
    def has_potential(self) -> bool:
        """Whether any of the prior is potential energy."""
        return len(self.energy.potential_links) > 0

    def states(self, q: Array, dq: Array, ddq: Array) -> JointStates:
        """Prepare joint states, each of shape (N, n); ShapeError if they are not."""
        packed = self.basis.pack(q, dq, ddq)
        inputs = tuple(kernel.inputs(q, dq, ddq) for kernel in self.per_joint)
        return JointStates(q, dq, ddq, packed, inputs)


@dataclass(frozen=True)
class Hyperparameters:
    """
    Everything that is optimised; all numbers positive.

    Attributes
    ----------
    weights : Weights
        Of the energy kernel.
    per_joint : tuple of arrays
        Of each per_joint kernel.
    noise_variance : array, shape (n,)
        [(N m)^2 or N^2].

    """

    weights: Weights
    per_joint: tuple[Array, ...]
    noise_variance: Array


@dataclass(frozen=True)
class TorquePrior:
    """
    Gaussian process prior on the torques and the energies.

    Attributes
    ----------
    kernel : TorqueKernel
    hyperparameters : Hyperparameters

    """

    kernel: TorqueKernel
    hyperparameters: Hyperparameters

    def gram(self, x: JointStates) -> Array:
        """
        Gram matrix of noiseless torques (paper, eq. `kernel_with_fric`).

        Returns
        -------
        array, shape (N n, N n)
            Row t n + i is torque i of sample t.

        """
        out = energy.gram(self.kernel.energy, self.hyperparameters.weights, x.packed)
        return self._add_others(out, x, x)

    def noisy_gram(self, x: JointStates) -> Array:
        """Gram matrix of measured torques: `gram` plus the noise variances on the diagonal."""
        out = self.gram(x)
        out.reshape(-1)[:: len(out) + 1] += np.tile(self.hyperparameters.noise_variance, len(x))
        return out

    def cross_gram(self, x: JointStates, z: JointStates) -> Array:
        """Covariances of noiseless torques at x and z, shape (N n, M n)."""
        weights = self.hyperparameters.weights
        out = energy.cross_gram(self.kernel.energy, weights, x.packed, z.packed)
        return self._add_others(out, x, z)

    def torque_variance(self, x: JointStates) -> Array:
        """Prior variances of noiseless torques, shape (N, n)."""
        weights = self.hyperparameters.weights
        blocks = energy.prior_blocks(self.kernel.energy, weights, x.packed)
        out: Array = np.einsum('tii->ti', blocks).copy()
        for kernel, parameters, inputs in self._terms(x):
            out += kernel.prior_variance(parameters, inputs)
        return out

    def kinetic_variance(self, x: JointStates) -> Array:
        """Prior variances of the kinetic energy, shape (N,) [J^2]."""
        f, _ = self.kernel.basis.features(x.q)
        weights = self.hyperparameters.weights
        values = definition.kinetic_covariance(self.kernel.energy, weights, f, x.dq.T, f, x.dq.T)
        return np.full(len(x), values, dtype=np.float64)

    def potential_covariance(self, q: Array, z: Array) -> Array:
        """Prior covariances of potential energies at rows of q and z, shapes (N or 1, n) [J^2]."""
        f, _ = self.kernel.basis.features(q)
        fz, _ = self.kernel.basis.features(z)
        weights = self.hyperparameters.weights
        values = definition.potential_covariance(self.kernel.energy, weights, f, fz)
        return np.array(values, dtype=np.float64)

    def energy_covariance(self, x: JointStates, z: JointStates) -> tuple[Array, Array]:
        """Covariances of kinetic and potential energy at x with torques at z, shapes (N, M n)."""
        weights = self.hyperparameters.weights
        return energy.energy_covariance(self.kernel.energy, weights, x.packed, z.packed)

    def _terms(self, x: JointStates) -> list[tuple[PerJointKernel, Array, Array]]:
        parameters = self.hyperparameters.per_joint
        return list(zip(self.kernel.per_joint, parameters, x.per_joint, strict=True))

    def _add_others(self, out: Array, x: JointStates, z: JointStates) -> Array:
        n = self.kernel.energy.n_joints
        for (kernel, parameters, left), right in zip(self._terms(x), z.per_joint, strict=True):
            covariance = kernel.covariance(parameters, left, right)
            for i in range(n):
                out[i::n, i::n] += covariance[i]
        return out
