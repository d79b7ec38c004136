"""The closed form against nested automatic differentiation of the definition."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from torch_later import Later, NEEDS_TORCH, Tensor, torch

from lip_id_ros.kernels import JointBasis

pytestmark = NEEDS_TORCH

kernel: Any = Later('benchmarks.baselines.lse_kernel')

Lagrangian = Callable[[Tensor, Tensor], Tensor]
RNG = np.random.default_rng(3)
TYPES = ('revolute', 'prismatic', 'revolute')
N = len(TYPES)
X, Z = (tuple(RNG.standard_normal((3, size, N))) for size in (2, 3))
BASIS = JointBasis.of(TYPES, X[0])
LENGTHS = RNG.uniform(0.5, 2, (2, N)), RNG.uniform(0.5, 2, N)


def lengths() -> Any:
    return kernel.Lengths(*map(torch.tensor, LENGTHS))


def states(motion: tuple[np.ndarray, ...]) -> Any:
    return kernel.States.of(BASIS, *motion)


def features(q: Tensor, dq: Tensor) -> Tensor:
    revolute = torch.tensor([kind == 'revolute' for kind in TYPES])
    u = (q - torch.tensor(BASIS.centre)) / torch.tensor(BASIS.half_range)
    first = torch.where(revolute, torch.cos(q), u) / lengths().f[0]
    second = torch.where(revolute, torch.sin(q), torch.zeros_like(q)) / lengths().f[1]
    return torch.cat([first, second, dq / lengths().dq])


def covariance(x: Tensor, z: Tensor) -> Tensor:
    return torch.exp(-0.5 * (x - z).square().sum())


def torque(lagrangian: Lagrangian, *motion: Tensor) -> Tensor:
    """Euler and Lagrange, by the letter."""
    q, dq, ddq = motion
    by_dq, by_q = torch.func.grad(lagrangian, argnums=1), torch.func.grad(lagrangian)
    _, rate = torch.func.jvp(by_dq, (q, dq), (dq, ddq))
    return rate - by_q(q, dq)


def expected_block(x: list[Tensor], z: list[Tensor]) -> Tensor:
    def inner(q: Tensor, dq: Tensor) -> Tensor:
        return torque(lambda r, dr: covariance(features(q, dq), features(r, dr)), *z)

    def component(j: int) -> Tensor:
        return torque(lambda q, dq: inner(q, dq)[j], *x)

    return torch.stack([component(j) for j in range(N)], dim=1)


def tensors(motion: tuple[np.ndarray, ...], row: int) -> list[Tensor]:
    return [torch.tensor(x[row]) for x in motion]


def test_torque_covariances_are_those_of_the_operator() -> None:
    found = kernel.torque_gram(states(X), states(Z), lengths())
    for i in range(2):
        for j in range(3):
            expected = expected_block(tensors(X, i), tensors(Z, j))
            np.testing.assert_allclose(found[i, :, j], expected, rtol=1e-9, atol=1e-11)


def energy_of(z: Tensor) -> Lagrangian:
    """Covariance with the Lagrangian at some features."""
    return lambda q, dq: covariance(z, features(q, dq))


def test_energy_covariances_are_those_of_the_operator() -> None:
    found = kernel.energy_gram(states(X), states(Z), lengths())
    for i in range(2):
        here = features(*tensors(X, i)[:2])
        for j in range(3):
            expected = torque(energy_of(here), *tensors(Z, j))
            np.testing.assert_allclose(found[i, j], expected, rtol=1e-9, atol=1e-11)
