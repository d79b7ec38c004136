"""Descents near points whose cost or Jacobian is not finite."""

from __future__ import annotations

from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.identification.levenberg_marquardt import minimise


@dataclass(frozen=True)
class At:
    """A number and its cost."""

    x: float
    cost: float


@dataclass(frozen=True)
class NearAWall:
    """
    Half a square of exp(x) - target, so that steps from the left are far too long.

    Beyond `wall` the cost is not finite, beyond `steep` the Jacobian is not.

    """

    target: float
    wall: float
    steep: float

    def at(self, x: float) -> At:
        cost = 0.5 * (np.exp(x) - self.target) ** 2 if x < self.wall else np.nan
        return At(x, float(cost))

    def normal_equations(self, point: At) -> tuple[Array, Array]:
        slope = np.exp(point.x) if point.x < self.steep else np.inf
        return np.array([[slope**2]]), np.array([slope * (np.exp(point.x) - self.target)])

    def stepped(self, point: At, step: Array) -> At:
        assert np.isfinite(step).all()
        return self.at(point.x + float(step[0]))


@given(start=st.floats(-3.0, -0.5), target=st.floats(0.7, 2.0), beyond=st.floats(0.02, 0.3))
def test_steps_beyond_the_finite_are_refused(start: float, target: float, beyond: float) -> None:
    steep = np.log(target) + beyond
    problem = NearAWall(target, steep + beyond, steep)
    found = minimise(problem, problem.at(start), 200, 1e-12)
    assert found.x == pytest.approx(np.log(target), abs=1e-3)


@given(start=st.floats(-1.5, -0.5), evaluations=st.integers(1, 5))
def test_no_step_to_a_higher_cost_is_taken(start: float, evaluations: int) -> None:
    problem = NearAWall(1.0, 5.0, 5.0)
    at = problem.at(start)
    assert minimise(problem, at, evaluations, 1e-12).cost <= at.cost


def test_a_start_without_a_jacobian_is_returned() -> None:
    problem = NearAWall(1.0, 5.0, -5.0)
    start = problem.at(-1.0)
    assert minimise(problem, start, 50, 1e-12) is start


def test_a_descent_from_a_cost_of_zero_ends() -> None:
    problem = NearAWall(1.0, 5.0, 5.0)
    assert minimise(problem, problem.at(0.0), 50, 1e-12).cost == 0.0
