"""The compiled filter against textbook formulas."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
from scipy.linalg import block_diag

from lip_id_ros.adaptation.kalman import DISTURBED, follow, HELD, keep_within, LEARNED, Walk
from lip_id_ros.arrays import Array

SIZE, N, COUNT = 4, 2, 5


class Case:
    """A random filter, its samples, and what the compiled filter makes of them."""

    def __init__(self, seed: int, bounds: float = np.inf) -> None:
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(SIZE, SIZE))
        self.mean, self.covariance = rng.normal(size=SIZE), root @ root.T + np.eye(SIZE)
        self.bounds = np.full(SIZE, -bounds), np.full(SIZE, bounds)
        self.steps = rng.uniform(0.0, 0.2, COUNT)
        self.torque = rng.normal(size=(COUNT, N))
        self.slopes = rng.normal(size=(COUNT, N, SIZE))
        self.measured = self.torque + 0.3 * rng.normal(size=(COUNT, N))
        self.noise = rng.uniform(1.0, 2.0, (COUNT, N))
        self.walked, self.growth = np.diag([2.0, 1.0]), rng.uniform(0.0, 0.1, COUNT)
        self.inflation = rng.uniform(1.0, 3.0, COUNT)

    def run(self, gate: float = 8.0, hold: float = 1.0, quiet: float = np.inf) -> dict[str, Array]:
        """Return what the filter found."""
        mean, covariance = self.mean.copy(), self.covariance.copy()
        out = np.empty((COUNT, N)), np.empty((COUNT, N)), np.empty(COUNT)
        follow(
            mean,
            covariance,
            *self.bounds,
            self.steps,
            self.walked,
            self.growth,
            self.torque,
            self.slopes,
            self.measured,
            self.noise,
            self.inflation,
            np.full(N, gate),
            hold,
            quiet,
            *out,
        )
        names = 'mean', 'covariance', 'predicted', 'variance', 'outcome'
        return dict(zip(names, (mean, covariance, *out), strict=True))


@given(seed=st.integers(0, 10_000))
@settings(max_examples=50, deadline=None)
def test_samples_one_torque_at_a_time_are_a_kalman_filter(seed: int) -> None:
    case = Case(seed)
    found = case.run()
    mean, covariance = case.mean, case.covariance
    for t in range(COUNT):
        covariance = covariance + case.growth[t] * block_diag(np.zeros((2, 2)), case.walked)
        slopes = case.slopes[t]
        expected = case.torque[t] + slopes @ (mean - case.mean)
        spread = slopes @ covariance @ slopes.T
        np.testing.assert_allclose(found['predicted'][t], expected, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found['variance'][t], np.diagonal(spread), rtol=1e-9)
        # innovations of more than three deviations count for less
        ratio = np.abs(case.measured[t] - expected) / np.sqrt(np.diagonal(spread) + case.noise[t])
        noise = case.inflation[t] * case.noise[t] * np.maximum(1.0, ratio / 3.0) ** 2
        gain = covariance @ slopes.T @ np.linalg.inv(spread + np.diag(noise))
        mean = mean + gain @ (case.measured[t] - expected)
        covariance = covariance - gain @ slopes @ covariance
    np.testing.assert_allclose(found['mean'], mean, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(found['covariance'], covariance, rtol=1e-7, atol=1e-9)
    assert (found['outcome'] == LEARNED).all()


def random_walk(seed: int) -> tuple[Walk, np.random.Generator]:
    """Return a walk of the last two numbers."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(2, 2))
    return Walk(rng.normal(size=(2, SIZE - 2)), root @ root.T, 0.3), rng


@given(seed=st.integers(0, 10_000), seconds=st.floats(0.0, 20.0))
@settings(max_examples=50, deadline=None)
def test_a_walk_returns_by_the_linear_map_of_its_process(seed: int, seconds: float) -> None:
    walk, rng = random_walk(seed)
    case, centre = Case(seed), rng.normal(size=SIZE)
    kept, one = np.exp(-walk.rate * seconds), np.eye(2)
    step = np.block([[one, 0.0 * one], [(1.0 - kept) * walk.slopes, kept * one]])
    mean, covariance = case.mean.copy(), case.covariance.copy()
    walk.go_back(mean, covariance, centre, seconds)
    np.testing.assert_allclose(mean, centre + step @ (case.mean - centre), atol=1e-12)
    np.testing.assert_allclose(covariance, step @ case.covariance @ step.T, atol=1e-12)
    np.testing.assert_allclose(walk.growth(np.array(seconds)), 1.0 - kept**2, atol=1e-12)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=50, deadline=None)
def test_numbers_stay_within_their_bounds(seed: int) -> None:
    found = Case(seed, bounds=0.2).run(gate=np.inf)
    assert (np.abs(found['mean']) <= 0.2).all()


def test_a_number_on_its_bound_moves_the_others_as_a_torque_would() -> None:
    """The projection in the metric of the covariance is a measurement without noise."""
    case = Case(3)
    mean, k = case.mean.copy(), 2
    lower, upper = case.bounds
    upper[k] = mean[k] - 0.1
    keep_within(mean, case.covariance, lower, upper)
    column = case.covariance[:, k] / case.covariance[k, k]
    np.testing.assert_allclose(mean, case.mean - 0.1 * column)


def test_nothing_is_learned_from_a_disturbance_nor_soon_after_it() -> None:
    case = Case(1)
    case.steps[:] = 0.4
    case.measured[1, 0] += 1e3
    found = case.run(gate=8.0, hold=1.0)
    expected = [LEARNED, DISTURBED, HELD, HELD, LEARNED]
    assert found['outcome'].tolist() == expected


def test_a_torque_of_infinite_noise_changes_nothing() -> None:
    case = Case(2)
    case.growth[:], case.noise[:] = 0.0, np.inf
    found = case.run()
    np.testing.assert_array_equal(found['mean'], case.mean)
    np.testing.assert_array_equal(found['covariance'], case.covariance)
