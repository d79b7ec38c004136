"""
Torque covariances by nested automatic differentiation, with torch.

The definition of the kernels (`lip_id_ros.kernels.program`) is differentiated as it stands: no
closed form, no compiled loop.

"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from torch_later import torch

from lip_id_ros.kernels import EnergyKernel, JointBasis, Weights
from lip_id_ros.kernels.program import kinetic_covariance, potential_covariance

Tensor = Any  # torch is optional, also for the type checker


class State(NamedTuple):
    """Joint states; each tensor of shape (n,) or (N, n)."""

    q: Tensor
    dq: Tensor
    ddq: Tensor


@dataclass(frozen=True)
class EnergyReference:
    """Covariances of an energy kernel between single joint states; its weights are tensors."""

    kernel: EnergyKernel
    basis: JointBasis
    weights: Weights

    def kinetic(self, q: Tensor, dq: Tensor, qz: Tensor, dz: Tensor) -> Tensor:
        f, fz = self._features(q), self._features(qz)
        zero = 0.0 * (q @ qz + dq @ dz)
        return zero + kinetic_covariance(self.kernel, self.weights, f, dq, fz, dz)

    def potential(self, q: Tensor, qz: Tensor) -> Tensor:
        f, fz = self._features(q), self._features(qz)
        return 0.0 * (q @ qz) + potential_covariance(self.kernel, self.weights, f, fz)

    def torque_block(self, x: State, z: State) -> Tensor:
        """Return the covariances of the torques at x (rows) and z (columns), shape (n, n)."""

        def lagrangian_and_torque(q: Tensor, dq: Tensor) -> Tensor:
            return euler_lagrange(
                lambda qz, dz: self.kinetic(q, dq, qz, dz) + self.potential(q, qz), z
            )

        return euler_lagrange(lagrangian_and_torque, x).T

    def kinetic_row(self, x: State, z: State) -> Tensor:
        """Return the covariances of T at x with the torques at z, shape (n,)."""
        return euler_lagrange(lambda qz, dz: self.kinetic(x.q, x.dq, qz, dz), z)

    def potential_row(self, x: State, z: State) -> Tensor:
        """Return the covariances of V at x with the torques at z, shape (n,)."""
        # cov(V, L) = -k_V, whence the sign.
        return euler_lagrange(lambda qz, dz: 0.0 * dz.sum() - self.potential(x.q, qz), z)

    def torque_blocks(self, x: State, z: State) -> Tensor:
        """Return `torque_block` for all pairs of N and M states, shape (N, M, n, n)."""
        vmap = torch.func.vmap
        return vmap(lambda a: vmap(lambda b: self.torque_block(State(*a), State(*b)))(z))(x)

    def _features(self, q: Tensor) -> tuple[Tensor, Tensor]:
        """Return the joint features as `JointBasis.features` does."""
        scaled = (q - q.new_tensor(self.basis.centre)) / q.new_tensor(self.basis.half_range)
        pick = torch.tensor(self.basis.prismatic, device=q.device)
        return torch.where(pick, scaled, q.cos()), torch.where(pick, 0.0 * q, q.sin())


def euler_lagrange(lagrangian: Callable[[Tensor, Tensor], Tensor], x: State) -> Tensor:
    """
    Apply d/dt d/d(dq) - d/dq along a motion to a function of q and dq.

    Returns a tensor of shape (..., n), with the shape of the function's value in front.

    """
    _, rate = torch.func.jvp(torch.func.jacrev(lagrangian, argnums=1), (x.q, x.dq), (x.dq, x.ddq))
    return rate - torch.func.jacrev(lagrangian, argnums=0)(x.q, x.dq)
