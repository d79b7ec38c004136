"""The optimisation of the hyperparameters: where it goes, where it stops, what it reports."""

from __future__ import annotations

from gp.cases import random_likelihood, TYPES
from kernels.cases import MEMBERS
import numpy as np
import pytest

from lip_id_ros.gp.likelihood import MarginalLikelihood
from lip_id_ros.gp.log_vector import to_vector
from lip_id_ros.gp.training import maximise, RANGE, STAGE


def small(member: str = 'recursive') -> MarginalLikelihood:
    return random_likelihood(member, TYPES, ('friction',), 12)


def value(likelihood: MarginalLikelihood, vector: np.ndarray) -> float:
    return likelihood.value_and_gradient(vector)[0]


@pytest.mark.parametrize('member', MEMBERS)
def test_the_likelihood_rises(member: str) -> None:
    likelihood = small(member)
    found = maximise(likelihood, likelihood.like, 8, 0.0)
    assert found.negative_log_likelihood < value(likelihood, to_vector(likelihood.like)) - 1.0
    end = to_vector(found.hyperparameters)
    assert found.negative_log_likelihood == pytest.approx(value(likelihood, end), rel=1e-12)
    assert 0 < found.iterations <= 8


def test_a_stationary_point_is_reached() -> None:
    """Of the likelihood times the prior."""
    likelihood = small()
    precision = 0.5
    found = maximise(likelihood, likelihood.like, 500, precision)
    assert found.converged
    assert found.at_bounds == ()
    start, end = to_vector(likelihood.like), to_vector(found.hyperparameters)
    slope = likelihood.value_and_gradient(end)[1]
    noise = likelihood.like.noise_variance.size
    slope[:-noise] += precision * (end - start)[:-noise]
    assert abs(slope).max() < 1e-2


def test_a_strong_prior_keeps_all_but_the_noise() -> None:
    likelihood = small()
    found = maximise(likelihood, likelihood.like, 30, 1e6)
    moved = abs(to_vector(found.hyperparameters) - to_vector(likelihood.like))
    noise = likelihood.like.noise_variance.size
    assert moved[:-noise].max() < 1e-3
    assert moved[-noise:].max() > 0.1


def test_no_iterations_keep_the_start() -> None:
    likelihood = small()
    found = maximise(likelihood, likelihood.like, 0, 0.05)
    start = to_vector(likelihood.like)
    np.testing.assert_array_equal(to_vector(found.hyperparameters), start)
    assert found.iterations == 0
    assert not found.converged
    assert found.negative_log_likelihood == pytest.approx(value(likelihood, start))


def test_what_runs_to_a_bound_is_named() -> None:
    """Noise explains random torques best: some weight goes as low as it may."""
    likelihood = small()
    found = maximise(likelihood, likelihood.like, 300, 0.0)
    assert found.at_bounds
    moved = abs(to_vector(found.hyperparameters) - to_vector(likelihood.like))
    assert moved.max() == pytest.approx(RANGE)
    assert len(found.at_bounds) == np.isclose(moved, RANGE, atol=1e-4).sum()


def test_progress_is_reported() -> None:
    likelihood = small()
    calls: list[tuple[str, int, int]] = []
    found = maximise(likelihood, likelihood.like, 5, 0.05, lambda *call: calls.append(call))
    steps = [(STAGE, done, 5) for done in range(found.iterations + 1)]
    assert calls == [*steps, (STAGE, 5, 5)]
