"""Deep Lagrangian networks: the mechanics of the network, and that it learns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from simulation.panda_runs import runs
from torch_later import Later, NEEDS_TORCH, Tensor, torch

from lip_id_ros.evaluation import metrics
from lip_id_ros.progress import silent
from lip_id_ros.settings import FitSettings

pytest.importorskip('pinocchio')

pytestmark = [*NEEDS_TORCH, pytest.mark.slow]

delan: Any = Later('benchmarks.baselines.delan')


def network() -> Any:
    torch.manual_seed(1)
    return delan.DelanNetwork(np.array([False, True, False]), width=16, depth=2)


def motion(n: int) -> list[Tensor]:
    generator = torch.Generator().manual_seed(2)
    return [torch.randn(n, 3, dtype=torch.float64, generator=generator) for _ in range(3)]


def test_inertia_is_symmetric_positive_definite_and_gives_the_kinetic_energy() -> None:
    net, (q, dq, _) = network(), motion(4)
    rest = torch.zeros_like(q)
    columns = [
        net.torque(q, rest, rest + torch.eye(3).double()[j]) - net.torque(q, rest, rest)
        for j in range(3)
    ]
    M = torch.stack(columns, dim=2).detach().numpy()
    np.testing.assert_allclose(M, M.transpose(0, 2, 1), atol=1e-12)
    assert np.linalg.eigvalsh(M).min() > 0
    expected = 0.5 * np.einsum('ki,kij,kj->k', dq, M, dq)
    np.testing.assert_allclose(net.kinetic(q, dq).detach(), expected, rtol=1e-10)


def test_power_is_the_rate_of_the_energy() -> None:
    net, (q, dq, ddq) = network(), motion(5)
    step = 1e-5

    def energy(s: float) -> Tensor:
        at = q + s * dq + 0.5 * s**2 * ddq
        return (net.kinetic(at, dq + s * ddq) + net.potential(at)).detach()

    rate = (energy(step) - energy(-step)) / (2 * step)
    power = (net.torque(q, dq, ddq) * dq).sum(1).detach()
    np.testing.assert_allclose(rate, power, rtol=1e-6, atol=1e-8)


def test_it_learns_and_the_seed_decides() -> None:
    data, unseen = runs(2, 150)
    few, many, again = (
        delan.Delan(steps)
        .fit(data, FitSettings(seed=3), silent)
        .predict(unseen.q, unseen.dq, unseen.ddq)
        for steps in (20, 400, 20)
    )
    np.testing.assert_array_equal(few.tau, again.tau)
    errors = [metrics.nmse_percent(x.tau, unseen.tau).mean() for x in (few, many)]
    assert errors[1] < 0.5 * errors[0]
    assert many.kinetic is not None
    assert many.kinetic.min() >= 0
