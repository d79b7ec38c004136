"""
Kernels of what is not Lagrangian: one independent Gaussian process per joint.

They are the paper's eq. `kernel_epsilon`. Each contributes to the diagonal of the n x n torque
blocks only, so a covariance is a stack of n matrices, one per joint. Parameters are arrays of
positive numbers.

"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.features import JointBasis


class PerJointKernel(Protocol):
    """What the Gaussian process needs of a kernel that acts on every joint by itself."""

    @property
    def name(self) -> str:
        """Key of the parameters in a model file."""

    def inputs(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return what the kernel needs of joint states (N, n); the second index is the sample."""

    def covariance(self, parameters: Array, x: Array, z: Array) -> Array:
        """Return the covariances, shape (n, N, M) [(N m)^2 or N^2]."""

    def prior_variance(self, parameters: Array, x: Array) -> Array:
        """Return the diagonal of `covariance` with x on both sides, shape (N, n)."""

    def gradient(self, parameters: Array, x: Array, contraction: Array) -> Array:
        """Return the derivatives of sum(contraction * covariance) by the parameters."""


@dataclass(frozen=True)
class Friction:
    """
    Linear kernel in the friction features of each joint: velocity, its sign, and a constant.

    Parameters (n, 3) are prior variances of the viscous coefficient, of the Coulomb torque and of
    the offset.

    Attributes
    ----------
    sign_width : array, shape (n,)
        The sign is tanh(dq / sign_width) [rad/s or m/s]: the torque that a controller adds must
        not jump.

    """

    sign_width: Array
    name: str = 'friction'

    def inputs(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the features, shape (n, N, 3)."""
        return np.stack([dq.T, np.tanh(dq / self.sign_width).T, np.ones_like(dq.T)], axis=-1)

    def covariance(self, parameters: Array, x: Array, z: Array) -> Array:
        """Return the covariances, shape (n, N, M)."""
        return np.asarray((x * parameters[:, None, :]) @ z.transpose(0, 2, 1))

    def prior_variance(self, parameters: Array, x: Array) -> Array:
        """Return the prior variances, shape (N, n)."""
        return np.asarray(np.einsum('itc,ic->ti', x * x, parameters))

    def gradient(self, parameters: Array, x: Array, contraction: Array) -> Array:
        """Return the derivatives, shape (n, 3)."""
        return np.asarray(np.einsum('itc,itc->ic', x, contraction @ x))

    def coefficients(self, parameters: Array, x: Array, alpha: Array) -> Array:
        """Return the coefficients' posterior mean, shape (n, 3), for alpha of shape (N, n)."""
        return np.asarray(parameters * np.einsum('itc,ti->ic', x, alpha))


@dataclass(frozen=True)
class Residual:
    """
    Squared-exponential kernel of each joint on the whole joint state.

    Parameters (n, 4) are the prior variance and the length scales of positions, velocities and
    accelerations, the latter two in units of `scales`; positions enter through the joint features.

    Attributes
    ----------
    basis : JointBasis
    scales : array, shape (2, n)
        Of velocities and accelerations, root mean squares of the training data.

    """

    basis: JointBasis
    scales: Array
    name: str = 'residual'

    def inputs(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return the stacked inputs, shape (3, N, 2 n)."""
        f, _ = self.basis.features(q)
        positions = np.concatenate([f[0], f[1]]).T
        none = np.zeros_like(dq)
        return np.stack(
            [
                positions,
                np.concatenate([dq / self.scales[0], none], axis=1),
                np.concatenate([ddq / self.scales[1], none], axis=1),
            ]
        )

    def covariance(self, parameters: Array, x: Array, z: Array) -> Array:
        """Return the covariances, shape (n, N, M)."""
        return self._covariance(parameters, _square_distances(x, z))

    def prior_variance(self, parameters: Array, x: Array) -> Array:
        """Return the prior variances, shape (N, n)."""
        return np.broadcast_to(parameters[:, 0], (x.shape[1], len(parameters))).copy()

    def gradient(self, parameters: Array, x: Array, contraction: Array) -> Array:
        """Return the derivatives, shape (n, 4)."""
        distances = _square_distances(x, x)
        weighted = contraction * self._covariance(parameters, distances)
        by_variance = weighted.sum(axis=(1, 2)) / parameters[:, 0]
        by_length = np.einsum('itu,gtu->ig', weighted, distances) / parameters[:, 1:] ** 3
        return np.column_stack([by_variance, by_length])

    @staticmethod
    def _covariance(parameters: Array, distances: Array) -> Array:
        precision = 0.5 / parameters[:, 1:] ** 2
        exponent = np.tensordot(precision, distances, axes=1)
        np.negative(exponent, out=exponent)
        np.exp(exponent, out=exponent)
        exponent *= parameters[:, 0, None, None]
        return exponent


def _square_distances(x: Array, z: Array) -> Array:
    """Return the squared distances of every group of inputs, shape (3, N, M)."""
    norms = (x * x).sum(-1)[:, :, None] + (z * z).sum(-1)[:, None, :]
    return np.maximum(norms - 2.0 * x @ z.transpose(0, 2, 1), 0.0)
