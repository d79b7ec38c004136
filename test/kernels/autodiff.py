"""Torques and their covariances by nested automatic differentiation: slow, and plainly right."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.func import grad, jacrev

from lip_id_ros.kernels import JointBasis, Weights
from lip_id_ros.kernels.plain import kinetic_covariance, potential_covariance
from lip_id_ros.kernels.program import EnergyKernel

State = tuple[Tensor, Tensor, Tensor]
Scalar = Callable[[Tensor, Tensor], Tensor]


def features(basis: JointBasis, q: Tensor) -> tuple[Tensor, Tensor]:
    """Joint features of one configuration, as `JointBasis.features` has them."""
    centre, half = torch.tensor(basis.centre), torch.tensor(basis.half_range)
    pick = torch.tensor(basis.prismatic)
    scaled = (q - centre) / half
    return torch.where(pick, scaled, torch.cos(q)), torch.where(pick, 0.0 * q, torch.sin(q))


def euler_lagrange(lagrangian: Scalar, x: State) -> Tensor:
    """d/dt dL/d(dq) - dL/dq along (dq, ddq), shape (n,)."""
    q, dq, ddq = x
    momentum = grad(lagrangian, argnums=1)
    by_q, by_dq = jacrev(momentum, argnums=(0, 1))(q, dq)
    return by_dq @ ddq + by_q @ dq - grad(lagrangian, argnums=0)(q, dq)


class Oracle:
    """Covariances of one energy kernel between single joint states."""

    def __init__(self, kernel: EnergyKernel, basis: JointBasis, weights: Weights) -> None:
        self.kernel = kernel
        self.basis = basis
        self.weights = Weights(*(torch.as_tensor(w) for w in weights))

    def kinetic(self, q: Tensor, dq: Tensor, qz: Tensor, dz: Tensor) -> Tensor:
        """Return k_T(x, z)."""
        f, fz = features(self.basis, q), features(self.basis, qz)
        return torch.as_tensor(kinetic_covariance(self.kernel, self.weights, f, dq, fz, dz))

    def potential(self, q: Tensor, qz: Tensor) -> Tensor:
        """Return k_V(x, z)."""
        f, fz = features(self.basis, q), features(self.basis, qz)
        return torch.as_tensor(potential_covariance(self.kernel, self.weights, f, fz))

    def lagrangian(self, q: Tensor, dq: Tensor, qz: Tensor, dz: Tensor) -> Tensor:
        """Return the covariance of the Lagrangians."""
        return self.kinetic(q, dq, qz, dz) + self.potential(q, qz)

    def torque_block(self, x: State, z: State) -> Tensor:
        """Covariance of the torques at x (rows) and z (columns), shape (n, n)."""

        def row(i: int) -> Scalar:
            def torque(qz: Tensor, dz: Tensor) -> Tensor:
                return euler_lagrange(lambda q, dq: self.lagrangian(q, dq, qz, dz), x)[i]

            return torque

        return torch.stack([euler_lagrange(row(i), z) for i in range(len(x[0]))])

    def kinetic_row(self, x: State, z: State) -> Tensor:
        """Covariance of the kinetic energy at x with the torques at z, shape (n,)."""
        return euler_lagrange(lambda qz, dz: self.kinetic(x[0], x[1], qz, dz), z)

    def potential_row(self, x: State, z: State) -> Tensor:
        """Covariance of the potential energy at x with the torques at z, shape (n,)."""
        # cov(V, L) = -k_V, whence the sign.
        return euler_lagrange(lambda qz, dz: -self.potential(x[0], qz) + 0.0 * dz.sum(), z)
