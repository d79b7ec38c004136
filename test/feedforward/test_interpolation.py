"""Motion between the points of a plan; test/ros2_control compares it with the controller's."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.interpolate import BPoly

from lip_id_ros.errors import DataError
from lip_id_ros.feedforward.interpolation import MOST_SAMPLES, Plan

NAMES = ('a', 'b')


def plan(seed: int, n_points: int = 5, n_given: int = 3) -> Plan:
    """Return a plan whose points have positions, then velocities, then accelerations."""
    rng = np.random.default_rng(seed)
    states = rng.normal(size=(3, n_points, 2))
    states[n_given:] = np.nan
    return Plan(NAMES, np.cumsum(rng.uniform(0.05, 2.0, n_points)), states)


@given(st.integers(0, 1000), st.sampled_from([1, 2, 3]))
def test_polynomials_take_what_both_points_have(seed: int, n_given: int) -> None:
    made = plan(seed, n_given=n_given)
    t, states = made.motion(0.01)
    oracle = BPoly.from_derivatives(made.t, np.moveaxis(made.states[:n_given], 0, 1))
    assert t[0] == made.t[0]
    np.testing.assert_allclose(t[-1], made.t[-1], atol=1e-5)
    assert np.diff(t).max() < 0.0101
    for order in range(3):
        expected = oracle(t) if order == 0 else oracle.derivative(order)(t)
        np.testing.assert_allclose(states[order], expected, rtol=1e-6, atol=1e-6)


def test_each_segment_takes_what_its_own_points_have() -> None:
    made = plan(0)
    made.states[2, 1] = made.states[1:, 3] = np.nan
    t, states = made.motion(0.01)
    for row, n_given in enumerate((2, 2, 1, 1)):
        within = (t >= made.t[row]) & (t < made.t[row + 1])
        pair = made.states[:n_given, row : row + 2]
        oracle = BPoly.from_derivatives(made.t[row : row + 2], np.moveaxis(pair, 0, 1))
        np.testing.assert_allclose(states[0, within], oracle(t[within]), atol=1e-6)


def test_points_without_velocities_are_counted() -> None:
    assert plan(0).caution == plan(0, n_given=2).caution == plan(0, 1, n_given=1).caution == ''
    assert plan(0, n_given=1).caution.startswith('5 of 5 points have no velocities')
    made = plan(0)
    made.states[1:, 3] = np.nan
    assert made.caution.startswith('1 of 5 points')


@given(st.integers(0, 1000), st.sampled_from([1, 2, 3]), st.floats(0.2, 5.0))
def test_a_slower_plan_is_the_slower_motion(seed: int, n_given: int, scale: float) -> None:
    made = plan(seed, n_given=n_given)
    slower = made.slowed(scale).motion(scale * 0.02)
    expected = made.motion(0.02).slowed(scale)
    np.testing.assert_allclose(slower.t, expected.t)
    np.testing.assert_allclose(slower.states, expected.states, rtol=1e-6, atol=1e-6)


def test_both_sides_of_a_point_are_looked_at() -> None:
    states = np.full((3, 3, 1), np.nan)
    states[0, :, 0], states[1] = [0.0, 1.0, 1.0], 0.0
    t, (_, _, ddq) = Plan(('a',), np.arange(3.0), states).motion(0.25)
    expected = [0.0, 0.25, 0.5, 0.75, 1.0, 1.0, 1.25, 1.5, 1.75, 2.0]
    np.testing.assert_allclose(t, expected, atol=1e-5)
    expected = [6.0, 3.0, 0.0, -3.0, -6.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(ddq[:, 0], expected, atol=1e-4)


@given(st.integers(0, 1000), st.floats(1e-4, 0.02))
def test_no_acceleration_hides_in_a_short_segment(seed: int, seconds: float) -> None:
    states = np.random.default_rng(seed).normal(size=(3, 2, 1))
    made = Plan(('a',), np.array([0.0, seconds]), states)
    largest = [np.abs(made.motion(step)[1][2]).max() for step in (0.005, seconds / 1000)]
    assert largest[0] > 0.9 * largest[1]


def test_a_plan_of_one_point_is_that_point() -> None:
    states = np.full((3, 1, 1), np.nan)
    states[0] = 0.7
    t, motion = Plan(('a',), np.ones(1), states).motion(0.1)
    np.testing.assert_array_equal(t, [1.0])
    np.testing.assert_array_equal(motion[:, 0, 0], [0.7, 0.0, 0.0])


def test_a_long_plan_gets_longer_steps() -> None:
    states = np.zeros((3, 2, 1))
    t, _ = Plan(('a',), np.array([0.0, 1e6]), states).motion(0.005)
    assert len(t) == MOST_SAMPLES + 1


def test_joints_are_brought_into_order() -> None:
    made = plan(1)
    ordered = made.in_order(['b'])
    assert ordered.joint_names == ('b',)
    np.testing.assert_array_equal(ordered.states[:, :, 0], made.states[:, :, 1])
    with pytest.raises(DataError, match='joint c expected in the plan, which has a, b'):
        made.in_order(['a', 'c'])


@pytest.mark.parametrize(
    ('t', 'field', 'value', 'sentence'),
    [
        ([0.0, 0.0], 0, 0.0, 'increase from point to point'),
        ([-1.0, 0.0], 0, 0.0, 'begin at 0 or later'),
        ([0.0, np.inf], 0, 0.0, 'begin at 0 or later'),
        ([], 0, 0.0, 'needs at least one point'),
        ([0.0, 1.0], 0, np.nan, 'needs a finite position of each joint'),
        ([0.0, 1.0], 2, np.inf, 'needs a finite position of each joint'),
        ([0.0, 1.0], 1, np.nan, 'with accelerations needs velocities too'),
    ],
)
def test_what_is_no_plan(t: list[float], field: int, value: float, sentence: str) -> None:
    states = np.zeros((3, len(t), 2))
    states[field, -1:] = value
    with pytest.raises(DataError, match=sentence):
        Plan(NAMES, np.array(t), states)
