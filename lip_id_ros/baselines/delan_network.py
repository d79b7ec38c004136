"""
Deep Lagrangian network (Lutter, Ritter and Peters 2019): energies as networks.

T = dq^T L L^T dq / 2 with a lower triangular L(q) and V(q), each a feedforward network of the
features of q; torques by the Euler-Lagrange equations, differentiated by torch.

"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import nn

LEAST_INERTIA = 1e-4  # added to the diagonal of L after softplus
OUTPUT_GAIN = 0.1
"""
Of the last layers' initial weights: L begins as nearly constant and diagonal. With couplings at
random, the first steps can silence a joint by driving its diagonal entry to nothing, for good.
"""


class DelanNetwork(nn.Module):
    """
    The two networks.

    Parameters
    ----------
    prismatic : sequence of bool
        Which joints are prismatic; the others enter as cosine and sine.
    width, depth : int
        Of the hidden layers.

    """

    def __init__(self, prismatic: Sequence[bool], width: int, depth: int) -> None:
        super().__init__()
        self.shape = (tuple(prismatic), width, depth)
        n = len(prismatic)
        self.register_buffer('_prismatic', torch.tensor(prismatic))
        rows, columns = torch.tril_indices(n, n)
        self.register_buffer('_diagonal', rows == columns)
        self.register_buffer('_place', n * rows + columns)
        self._inertia = _feedforward(2 * n, n * (n + 1) // 2, width, depth)
        self._potential = _feedforward(2 * n, 1, width, depth)

    def torque(self, q: torch.Tensor, dq: torch.Tensor, ddq: torch.Tensor) -> torch.Tensor:
        """Return d/dt (dL/d dq) - dL/dq, all of shape (N, n)."""
        _, momentum_rate = torch.func.jvp(self._momentum, (q, dq), (dq, ddq))
        by_position = torch.func.grad(self._total_lagrangian)(q, dq)
        return momentum_rate - by_position

    def kinetic(self, q: torch.Tensor, dq: torch.Tensor) -> torch.Tensor:
        """Return T, shape (N,), never negative."""
        return 0.5 * (self._cholesky(q).transpose(1, 2) @ dq[..., None]).square().sum((1, 2))

    def potential(self, q: torch.Tensor) -> torch.Tensor:
        """Return V, shape (N,)."""
        return self._potential(self._features(q)).squeeze(1)

    def _momentum(self, q: torch.Tensor, dq: torch.Tensor) -> torch.Tensor:
        factor = self._cholesky(q)
        return (factor @ (factor.transpose(1, 2) @ dq[..., None])).squeeze(2)

    def _total_lagrangian(self, q: torch.Tensor, dq: torch.Tensor) -> torch.Tensor:
        return (self.kinetic(q, dq) - self.potential(q)).sum()

    def _cholesky(self, q: torch.Tensor) -> torch.Tensor:
        n = q.shape[1]
        entries = self._inertia(self._features(q))
        positive = nn.functional.softplus(entries) + LEAST_INERTIA
        entries = torch.where(self._diagonal, positive, entries)
        flat = torch.zeros(len(q), n * n, dtype=q.dtype, device=q.device)
        return flat.index_add(1, self._place, entries).reshape(-1, n, n)

    def _features(self, q: torch.Tensor) -> torch.Tensor:
        first = torch.where(self._prismatic, q, torch.cos(q))
        second = torch.where(self._prismatic, torch.zeros_like(q), torch.sin(q))
        return torch.cat([first, second], dim=1)


def _feedforward(n_inputs: int, n_outputs: int, width: int, depth: int) -> nn.Sequential:
    sizes = [n_inputs] + [width] * depth
    layers: list[nn.Module] = []
    for before, after in pairwise(sizes):
        layers += [nn.Linear(before, after), nn.Softplus()]
    last = nn.Linear(sizes[-1], n_outputs)
    network = nn.Sequential(*layers, last).double()
    for layer in network:
        if isinstance(layer, nn.Linear):
            nn.init.xavier_normal_(layer.weight, OUTPUT_GAIN if layer is last else 1.0)
            nn.init.zeros_(layer.bias)
    return network
