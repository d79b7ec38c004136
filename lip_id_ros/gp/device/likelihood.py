"""The marginal likelihood on a device (docs/maths.md, section 5)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
import math
from typing import Any

import torch

from lip_id_ros.arrays import Array
from lip_id_ros.gp.device.factorisation import cholesky
from lip_id_ros.gp.device.gram import cross_gram
from lip_id_ros.gp.device.states import hyperparameters, TensorStates
from lip_id_ros.kernels import Hyperparameters, JointStates, TorqueKernel

Tensor = Any

CHUNK_BYTES = 2**30
"""About how much memory the derivatives of one chunk of the Gram matrix may take."""


def is_available() -> bool:
    """Whether torch finds a CUDA device."""
    return bool(torch.cuda.is_available())


def likelihood_on(device: str) -> Callable[..., TorchMarginalLikelihood]:
    """Return what makes likelihoods on a device."""
    return partial(TorchMarginalLikelihood, device=device)


@dataclass(frozen=True)
class TorchMarginalLikelihood:
    """
    Negative log marginal likelihood as a function of the log-hyperparameters.

    The same numbers as `lip_id_ros.gp.likelihood.MarginalLikelihood`, with the Gram matrix, its
    factor and the gradient on a device. The gradient is that of sum(W * K) at a fixed contraction
    W, so that only one chunk of the Gram matrix is differentiated at a time.

    Attributes
    ----------
    kernel : TorqueKernel
    states : JointStates
        N samples.
    tau : array, shape (N, n)
        Measured torques [N m or N].
    like : Hyperparameters
        Gives the shapes.
    device : str
        As torch names it.
    chunk_bytes : int
        About how much memory the derivatives of one chunk may take.

    """

    kernel: TorqueKernel
    states: JointStates
    tau: Array
    like: Hyperparameters
    device: str
    chunk_bytes: int = CHUNK_BYTES
    _x: TensorStates = field(init=False, repr=False, compare=False)
    _y: Tensor = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Copy the data to the device."""
        object.__setattr__(self, '_x', TensorStates.of(self.states, self.device))
        object.__setattr__(self, '_y', torch.tensor(self.tau.ravel(), device=self.device))

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        """
        Evaluate at one vector of log-hyperparameters, shape (p,).

        Returns
        -------
        value : float
            Negative log marginal likelihood, constant included.
        gradient : array, shape (p,)

        Raises
        ------
        FitError
            If the Gram matrix cannot be factorised.

        """
        theta = torch.tensor(vector, device=self.device, requires_grad=True)
        lower = cholesky(self._noisy_gram(theta))
        alpha = torch.cholesky_solve(self._y[:, None], lower)[:, 0]
        constant = 0.5 * len(self._y) * math.log(2.0 * math.pi)
        value = 0.5 * self._y @ alpha + lower.diagonal().log().sum() + constant
        contraction = 0.5 * (torch.cholesky_inverse(lower) - torch.outer(alpha, alpha))
        return float(value), self._gradient(theta, contraction)

    def gram(self, vector: Array) -> Array:
        """Gram matrix of noiseless torques, as `TorquePrior.gram`, shape (N n, N n)."""
        lower = self._lower_gram(torch.tensor(vector, device=self.device))
        whole: Array = (lower.tril() + lower.tril(-1).T).cpu().numpy()
        return whole

    @torch.no_grad()
    def _lower_gram(self, theta: Tensor) -> Tensor:
        n = self.kernel.energy.n_joints
        out = theta.new_zeros((len(self._y),) * 2)
        for first, last in self._chunks():
            out[first * n : last * n, : last * n] = self._rows(theta, first, last)
        return out

    @torch.no_grad()
    def _noisy_gram(self, theta: Tensor) -> Tensor:
        out = self._lower_gram(theta)
        noise = hyperparameters(theta, self.like).noise_variance
        out.diagonal().add_(noise.repeat(len(self.states)))
        return out

    def _gradient(self, theta: Tensor, contraction: Tensor) -> Array:
        n = self.kernel.energy.n_joints
        noise = hyperparameters(theta, self.like).noise_variance
        (noise.repeat(len(self.states)) @ contraction.diagonal()).backward()
        for first, last in self._chunks():
            weights = contraction[first * n : last * n, : last * n].clone()
            weights[:, : first * n] *= 2.0  # for what lies above the diagonal
            (weights * self._rows(theta, first, last)).sum().backward()
        gradient: Array = theta.grad.cpu().numpy()
        return gradient

    def _rows(self, theta: Tensor, first: int, last: int) -> Tensor:
        """Return some rows of the Gram matrix, up to the end of its diagonal blocks."""
        at = hyperparameters(theta, self.like)
        x, z = self._x.some(slice(first, last)), self._x.some(slice(0, last))
        return cross_gram(self.kernel, at, x, z)

    def _chunks(self) -> Iterator[tuple[int, int]]:
        """Yield the first sample of each chunk and that after its last."""
        energy, count = self.kernel.energy, len(self.states)
        jet_bytes = 4 * 8 * (energy.n_joints + 1) ** 2
        steps = len(energy.squares) + len(energy.entries) + energy.n_joints
        pair_bytes = jet_bytes * steps
        size = max(1, self.chunk_bytes // (pair_bytes * count))
        for first in range(0, count, size):
            yield first, min(first + size, count)
