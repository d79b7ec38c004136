"""The whole prior of the torques: energies, what is not Lagrangian, and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels import energy_covariance as definition
from lip_id_ros.kernels import gram as energy
from lip_id_ros.kernels.features import JointBasis, Samples
from lip_id_ros.kernels.per_joint import Friction, PerJointKernel
from lip_id_ros.kernels.program import EnergyKernel, Weights
from lip_id_ros.kernels.rigid_links import ARTICULATED, RigidLinks


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
    links : tuple of arrays, each of shape (N n, k)
        The features of the torques of rigid links.

    """

    q: Array
    dq: Array
    ddq: Array
    packed: Samples
    per_joint: tuple[Array, ...]
    links: tuple[Array, ...] = ()

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
    links : tuple of RigidLinks
        Rigid links beside the energy kernel: one, or none.

    """

    energy: EnergyKernel
    basis: JointBasis
    per_joint: tuple[PerJointKernel, ...] = ()
    links: tuple[RigidLinks, ...] = ()

    @property
    def name(self) -> str:
        """Name of the energy kernel, or 'articulated' where rigid links are beside it."""
        return ARTICULATED if self.links else self.energy.name

    @property
    def has_potential(self) -> bool:
        """Whether any of the prior is potential energy."""
        weight = any(links.chain.gravity.any() for links in self.links)
        return weight or len(self.energy.potential_links) > 0

    @property
    def is_linear(self) -> bool:
        """Whether links and friction are all of the prior."""
        return self.energy.is_empty and all(isinstance(x, Friction) for x in self.per_joint)

    def states(self, q: Array, dq: Array, ddq: Array) -> JointStates:
        """Prepare joint states, each of shape (N, n); ShapeError if they are not."""
        packed = self.basis.pack(q, dq, ddq)
        inputs = tuple(kernel.inputs(q, dq, ddq) for kernel in self.per_joint)
        features = tuple(links.torque(q, dq, ddq).reshape(q.size, -1) for links in self.links)
        return JointStates(q, dq, ddq, packed, inputs, features)


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
        for features in x.links:
            out += np.square(features).sum(axis=1).reshape(out.shape)
        return out

    def kinetic_variance(self, x: JointStates) -> Array:
        """Prior variances of the kinetic energy, shape (N,) [J^2]."""
        f, _ = self.kernel.basis.features(x.q)
        weights = self.hyperparameters.weights
        values = definition.kinetic_covariance(self.kernel.energy, weights, f, x.dq.T, f, x.dq.T)
        out = np.full(len(x), values, dtype=np.float64)
        for links in self.kernel.links:
            out += np.square(links.kinetic(x.q, x.dq)).sum(axis=1)
        return out

    def potential_covariance(self, q: Array, z: Array) -> Array:
        """Prior covariances of potential energies at rows of q and z, shapes (N or 1, n) [J^2]."""
        f, _ = self.kernel.basis.features(q)
        fz, _ = self.kernel.basis.features(z)
        weights = self.hyperparameters.weights
        values = definition.potential_covariance(self.kernel.energy, weights, f, fz)
        out = np.array(values, dtype=np.float64)
        for links in self.kernel.links:
            out = out + (links.potential(q) * links.potential(z)).sum(axis=1)
        return out

    def energy_covariance(self, x: JointStates, z: JointStates) -> tuple[Array, Array]:
        """Covariances of kinetic and potential energy at x with torques at z, shapes (N, M n)."""
        weights = self.hyperparameters.weights
        kinetic, potential = energy.energy_covariance(
            self.kernel.energy, weights, x.packed, z.packed
        )
        for links, features in zip(self.kernel.links, z.links, strict=True):
            kinetic += links.kinetic(x.q, x.dq) @ features.T
            potential += links.potential(x.q) @ features.T
        return kinetic, potential

    def _terms(self, x: JointStates) -> list[tuple[PerJointKernel, Array, Array]]:
        parameters = self.hyperparameters.per_joint
        return list(zip(self.kernel.per_joint, parameters, x.per_joint, strict=True))

    def _add_others(self, out: Array, x: JointStates, z: JointStates) -> Array:
        for left, right in zip(x.links, z.links, strict=True):
            out += left @ right.T
        n = self.kernel.energy.n_joints
        for (kernel, parameters, left), right in zip(self._terms(x), z.per_joint, strict=True):
            covariance = kernel.covariance(parameters, left, right)
            for i in range(n):
                out[i::n, i::n] += covariance[i]
        return out
