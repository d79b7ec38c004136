"""The optimisation of the hyperparameters: where it goes, where it stops, what it reports."""

from __future__ import annotations

from gp.cases import random_likelihood, TYPES
from kernels.cases import MEMBERS
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.errors import FitError
from lip_id_ros.gp.training import (
    ALIKE,
    MarginalLikelihood,
    maximise,
    Objective,
    Optimum,
    RANGE,
    STAGE,
)


def small(member: str = 'recursive') -> MarginalLikelihood:
    return random_likelihood(member, TYPES, True, 12)


def improve(likelihood: MarginalLikelihood, iterations: int, prior_precision: float) -> Optimum:
    """Optimise from the likelihood's own point, which is also the centre of the prior."""
    objective = Objective(likelihood, likelihood.like, prior_precision)
    return maximise(objective, likelihood.like, iterations)


def value(likelihood: MarginalLikelihood, vector: Array) -> float:
    return likelihood.value_and_gradient(vector)[0]


@pytest.mark.parametrize('member', MEMBERS)
def test_the_likelihood_rises(member: str) -> None:
    likelihood = small(member)
    found = improve(likelihood, 8, 0.0)
    assert found.negative_log_likelihood < value(likelihood, likelihood.like.vector()) - 1.0
    end = found.hyperparameters.vector()
    assert found.negative_log_likelihood == pytest.approx(value(likelihood, end), rel=1e-12)
    assert 0 < found.iterations <= 8


def test_a_stationary_point_is_reached() -> None:
    """Of the likelihood times the prior."""
    likelihood = small()
    precision = 0.5
    found = improve(likelihood, 500, precision)
    assert found.converged
    assert found.at_bounds == ()
    start, end = likelihood.like.vector(), found.hyperparameters.vector()
    slope = likelihood.value_and_gradient(end)[1]
    noise = likelihood.like.noise_variance.size
    slope[:-noise] += precision * (end - start)[:-noise]
    cosines, sines = likelihood.like.cosines_and_sines()
    pull = ALIKE * ((end - start)[cosines] - (end - start)[sines])
    slope[cosines] += pull
    slope[sines] -= pull
    assert abs(slope).max() < 1e-2


@pytest.mark.parametrize('member', MEMBERS)
def test_the_gradient_is_that_of_the_objective(member: str) -> None:
    likelihood = small(member)
    objective = Objective(likelihood, likelihood.like, 0.5)
    rng = np.random.default_rng(0)
    at = likelihood.like.vector() + 0.3 * rng.standard_normal(likelihood.like.vector().size)
    way = rng.standard_normal(at.size)
    step = 1e-5
    ahead, behind = (objective.value_and_gradient(at + s * way)[0] for s in (step, -step))
    slope = objective.value_and_gradient(at)[1] @ way
    assert (ahead - behind) / (2 * step) == pytest.approx(slope, rel=1e-5)


def test_cosine_and_sine_are_alike_in_the_prior() -> None:
    likelihood = small()
    objective = Objective(likelihood, likelihood.like, 0.05)
    cosines, sines = likelihood.like.cosines_and_sines()
    at = likelihood.like.vector()
    at[cosines] += 1.0
    together = at.copy()
    together[sines] += 1.0
    assert objective.penalty(at) > 5.0 * objective.penalty(together)
    assert Objective(likelihood, likelihood.like, 0.0).penalty(at) == 0.0


def test_a_strong_prior_keeps_all_but_the_noise() -> None:
    likelihood = small()
    found = improve(likelihood, 30, 1e6)
    moved = abs(found.hyperparameters.vector() - likelihood.like.vector())
    noise = likelihood.like.noise_variance.size
    assert moved[:-noise].max() < 1e-3
    assert moved[-noise:].max() > 0.1


def test_no_iterations_keep_the_start() -> None:
    likelihood = small()
    found = improve(likelihood, 0, 0.05)
    start = likelihood.like.vector()
    np.testing.assert_allclose(found.hyperparameters.vector(), start, atol=1e-14)
    assert found.iterations == 0
    assert not found.converged
    assert found.negative_log_likelihood == pytest.approx(value(likelihood, start))


def test_what_runs_to_a_bound_is_named() -> None:
    """Noise explains random torques best: some weight goes as low as it may."""
    likelihood = small()
    found = improve(likelihood, 300, 0.0)
    assert found.at_bounds
    moved = abs(found.hyperparameters.vector() - likelihood.like.vector())
    assert moved.max() == pytest.approx(RANGE)
    assert len(found.at_bounds) == np.isclose(moved, RANGE, atol=1e-4).sum()


def test_the_start_need_not_be_the_centre_of_the_prior() -> None:
    """The objective depends on where a start is, not on how far it came."""
    likelihood = small()
    centre = likelihood.like.vector()
    objective = Objective(likelihood, likelihood.like, 0.5)
    away = likelihood.like.with_vector(centre + 0.3)
    noise = likelihood.like.noise_variance.size
    found = maximise(objective, away, 0)
    penalty = 0.5 * 0.5 * 0.3**2 * (len(centre) - noise)
    assert found.value == pytest.approx(value(likelihood, centre + 0.3) + penalty)
    assert found.negative_log_likelihood == pytest.approx(value(likelihood, centre + 0.3))


class Walled(MarginalLikelihood):
    """A likelihood that cannot be factorised further than `RADIUS` from where it is looked for."""

    RADIUS = 1.5

    def value_and_gradient(self, vector: Array) -> tuple[float, Array]:
        if np.linalg.norm(vector - self.like.vector()) > self.RADIUS:
            raise FitError('beyond the wall')
        return super().value_and_gradient(vector)


def test_a_step_too_far_is_shortened() -> None:
    likelihood = Walled(**vars(small()))
    found = improve(likelihood, 30, 0.0)
    assert found.rejected > 0
    start, end = likelihood.like.vector(), found.hyperparameters.vector()
    assert 0.5 < np.linalg.norm(end - start) <= Walled.RADIUS
    assert found.value < value(likelihood, start) - 1.0


def test_a_start_that_cannot_be_factorised_is_an_error() -> None:
    likelihood = Walled(**vars(small()))
    away = likelihood.like.with_vector(likelihood.like.vector() + 1.0)
    with pytest.raises(FitError, match='beyond the wall'):
        maximise(Objective(likelihood, likelihood.like, 0.0), away, 10)


def test_progress_is_reported() -> None:
    likelihood = small()
    calls: list[tuple[str, int, int]] = []
    objective = Objective(likelihood, likelihood.like, 0.05)
    found = maximise(objective, likelihood.like, 5, lambda *call: calls.append(call))
    steps = [(STAGE, done, 5) for done in range(found.iterations + 1)]
    assert calls == [*steps, (STAGE, 5, 5)]
    maximise(objective, likelihood.like, 0, lambda *call: calls.append(call), 'other')
    assert calls[-1] == ('other', 0, 0)
