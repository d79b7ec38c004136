"""The likelihood that is maximised, against SciPy, and what happens at bad points."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from torch_later import Later, NEEDS_TORCH, Tensor, torch

from lip_id_ros.errors import FitError

pytestmark = NEEDS_TORCH

likelihood: Any = Later('benchmarks.baselines.marginal_likelihood')

RNG = np.random.default_rng(0)
X = RNG.uniform(0, 5, 40)
Y = np.sin(X) + 0.1 * RNG.standard_normal(40)


def quiet(done: int, total: int) -> None:
    pass


def noisy_gram(theta: Tensor) -> Tensor:
    distance = torch.tensor(X[:, None] - X).square() * torch.exp(-2 * theta[1])
    return torch.exp(theta[0] - 0.5 * distance) + torch.exp(theta[2]) * torch.eye(40).double()


def test_no_neighbour_of_the_optimum_is_likelier() -> None:
    found = likelihood.maximise(noisy_gram, Y, np.zeros(3), 200, quiet)

    def log_likelihood(theta: np.ndarray) -> float:
        gram = noisy_gram(torch.tensor(theta)).numpy()
        return float(multivariate_normal(cov=gram).logpdf(Y))

    best = log_likelihood(found)
    assert best > log_likelihood(np.zeros(3)) + 10
    for step in 0.05 * np.vstack([np.eye(3), -np.eye(3)]):
        assert log_likelihood(found + step) < best
    assert np.exp(found[2] / 2) == pytest.approx(0.1, rel=0.5)


def test_a_matrix_without_factor_at_the_start_is_an_error() -> None:
    def indefinite(theta: Tensor) -> Tensor:
        return -torch.exp(theta[0]) * torch.eye(40).double()

    with pytest.raises(FitError, match='positive definite but is not'):
        likelihood.maximise(indefinite, Y, np.zeros(1), 5, quiet)


def test_a_trial_point_without_factor_does_not_end_the_search() -> None:
    visited = []

    def with_a_hole(theta: Tensor) -> Tensor:
        visited.append(float(theta[0].detach()))
        sign = -1.0 if len(visited) == 2 else 1.0
        return sign * noisy_gram(theta)

    found = likelihood.maximise(with_a_hole, Y, np.zeros(3), 200, quiet)
    assert np.exp(found[2] / 2) == pytest.approx(0.1, rel=0.5)


def test_a_prior_holds_hyperparameters_near_their_start() -> None:
    free = likelihood.maximise(noisy_gram, Y, np.zeros(3), 200, quiet)
    held = likelihood.maximise(noisy_gram, Y, np.zeros(3), 200, quiet, np.array([0.0, 1e9, 0.0]))
    assert abs(held[1]) < 1e-4 < 0.1 < abs(free[1])
    assert abs(held[2]) > 1.0
