"""
Torque covariances by nested automatic differentiation, with torch.

The definition of the kernels (`lip_id_ros.kernels.program`) is differentiated as it
stands: no closed form, no compiled loop. The tests compare all compiled code with this module, and
`fit.device: cuda` evaluates the marginal likelihood with it (maths.md, section 5). It has run
on the CPU only: no machine of this project had a CUDA device.

"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
import math
from typing import Any, NamedTuple

import torch
from torch.func import jacrev, jvp, vmap

from lip_id_ros.arrays import Array
from lip_id_ros.errors import FitError
from lip_id_ros.kernels import (
    EnergyKernel,
    Hyperparameters,
    JointBasis,
    JointStates,
    TorqueKernel,
    Weights,
)
from lip_id_ros.kernels.program import kinetic_covariance, potential_covariance
from lip_id_ros.linear_algebra import JITTERS, NOT_FINITE, NOT_POSITIVE_DEFINITE

Tensor = Any  # torch is optional, also for the type checker

CHUNK_BYTES = 2**30
"""About how much memory the derivatives of one chunk of the Gram matrix may take."""

PAIR_NUMBERS = 60
"""Numbers that torch keeps per pair, step of the program and torque covariance, about."""


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
        """Return the covariance of the kinetic energies."""
        f, fz = self._features(q), self._features(qz)
        zero = 0.0 * (q @ qz + dq @ dz)
        return zero + kinetic_covariance(self.kernel, self.weights, f, dq, fz, dz)

    def potential(self, q: Tensor, qz: Tensor) -> Tensor:
        """Return the covariance of the potential energies."""
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
    _, rate = jvp(jacrev(lagrangian, argnums=1), (x.q, x.dq), (x.dq, x.ddq))
    return rate - jacrev(lagrangian, argnums=0)(x.q, x.dq)


class _Inputs(NamedTuple):
    """Joint states, and the features of the friction kernel (n, N, 3) or None."""

    state: State
    friction: Tensor

    def rows(self, samples: slice) -> _Inputs:
        """Return some of the samples."""
        friction = None if self.friction is None else self.friction[:, samples]
        return _Inputs(State(*(values[samples] for values in self.state)), friction)


@dataclass(frozen=True)
class TorchMarginalLikelihood:
    """
    Negative log marginal likelihood as a function of the log-hyperparameters.

    The same numbers as `lip_id_ros.gp.likelihood.MarginalLikelihood`, with the Gram matrix, its
    factor and the gradient on a device. The gradient is that of sum(W * K) at a fixed contraction
    W, so that only one chunk of the Gram matrix is differentiated at a time; its derivatives may
    take about `chunk_bytes`.

    """

    kernel: TorqueKernel
    states: JointStates
    tau: Array
    like: Hyperparameters
    device: str
    chunk_bytes: int = CHUNK_BYTES
    _x: _Inputs = field(init=False, repr=False, compare=False)
    _y: Tensor = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Copy the data to the device."""

        def tensor(values: Array) -> Tensor:
            return torch.tensor(values, device=self.device)

        x = self.states
        friction = None if x.friction is None else tensor(x.friction)
        inputs = _Inputs(State(tensor(x.q), tensor(x.dq), tensor(x.ddq)), friction)
        object.__setattr__(self, '_x', inputs)
        object.__setattr__(self, '_y', tensor(self.tau.ravel()))

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """Evaluate at log-hyperparameters (p,), as `MarginalLikelihood.value_and_gradient`."""
        theta = torch.tensor(vector, device=self.device, requires_grad=True)
        noise: Tensor = self._at(theta).noise_variance.repeat(len(self.states))
        noisy = self._gram(theta)
        noisy.diagonal().add_(noise.detach())
        lower = _cholesky(noisy)
        alpha = torch.cholesky_solve(self._y[:, None], lower)[:, 0]
        constant = 0.5 * len(self._y) * math.log(2.0 * math.pi)
        value = 0.5 * self._y @ alpha + lower.diagonal().log().sum() + constant
        contraction = 0.5 * (torch.cholesky_inverse(lower) - torch.outer(alpha, alpha))
        (noise @ contraction.diagonal()).backward()
        n = self.kernel.energy.n_joints
        for first, last in self._chunks():
            weights = contraction[first * n : last * n, : last * n].clone()
            weights[:, : first * n] *= 2.0  # for the mirror image above the diagonal
            (weights * self._rows(theta, first, last)).sum().backward()
        gradient: Array = theta.grad.cpu().numpy()
        return float(value), gradient

    def gram(self, vector: Array) -> Array:
        """Gram matrix of noiseless torques, as `TorquePrior.gram`, shape (N n, N n)."""
        lower = self._gram(torch.tensor(vector, device=self.device))
        whole: Array = (lower.tril() + lower.tril(-1).T).cpu().numpy()
        return whole

    @torch.no_grad()
    def _gram(self, theta: Tensor) -> Tensor:
        """Return the Gram matrix, of which only the lower triangle is set."""
        n = self.kernel.energy.n_joints
        out = theta.new_zeros((len(self._y),) * 2)
        for first, last in self._chunks():
            out[first * n : last * n, : last * n] = self._rows(theta, first, last)
        return out

    def _rows(self, theta: Tensor, first: int, last: int) -> Tensor:
        """Return some rows of the Gram matrix, up to the end of its diagonal blocks."""
        at, n = self._at(theta), self.kernel.energy.n_joints
        x, z = self._x.rows(slice(first, last)), self._x.rows(slice(0, last))
        energies = EnergyReference(self.kernel.energy, self.kernel.basis, at.weights)
        blocks = energies.torque_blocks(x.state, z.state)
        if at.friction is not None:
            each = (x.friction * at.friction[:, None]) @ z.friction.transpose(1, 2)
            blocks = blocks + torch.diag_embed(each.permute(1, 2, 0))
        return blocks.permute(0, 2, 1, 3).reshape(len(blocks) * n, -1)

    def _at(self, theta: Tensor) -> Hyperparameters:
        """Return the tensors whose logarithms are `theta`, in the shapes of `like`."""
        groups = self.like.groups().values()
        pieces = theta.exp().split([values.size for values in groups])
        return self.like.filled(
            [piece.reshape(values.shape) for piece, values in zip(pieces, groups, strict=True)]
        )

    def _chunks(self) -> Iterator[tuple[int, int]]:
        """Yield the first sample of each chunk and that after its last."""
        energy, count = self.kernel.energy, len(self.states)
        steps = len(energy.steps) + energy.n_joints
        pair_bytes = 8 * PAIR_NUMBERS * steps * energy.n_joints**2
        size = max(1, self.chunk_bytes // (pair_bytes * count))
        for first in range(0, count, size):
            yield first, min(first + size, count)


def _cholesky(matrix: Tensor) -> Tensor:
    """Factorise a matrix with as little jitter as it takes; only the lower triangle is read."""
    if not torch.isfinite(matrix.sum()):
        raise FitError(NOT_FINITE)
    scale = matrix.diagonal().mean()
    for relative in JITTERS:
        work = matrix.clone()
        work.diagonal().add_(relative * scale)
        lower, info = torch.linalg.cholesky_ex(work)
        if int(info) == 0:
            return lower
    raise FitError(NOT_POSITIVE_DEFINITE)


def is_available() -> bool:
    """Whether torch finds a CUDA device."""
    return bool(torch.cuda.is_available())


def likelihood_on(device: str) -> Callable[..., TorchMarginalLikelihood]:
    """Return what makes likelihoods on a device."""
    return partial(TorchMarginalLikelihood, device=device)
