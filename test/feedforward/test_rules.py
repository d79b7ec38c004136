"""Training range and standard deviation: what is doubtful is counted and treated as chosen."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.settings import Policy
from lip_id_ros.feedforward.shaping import factors, std_excess, TrainingRange

BOX = TrainingRange(np.array([[-1.0, 0.0]] * 3), np.array([[1.0, 4.0]] * 3))


@given(arrays(np.float64, (3, 5, 2), elements=st.integers(-99, 99).map(lambda k: k / 10)))
def test_excess_is_above_one_outside_and_only_there(states: Array) -> None:
    inside = ((states >= [-1.0, 0.0]) & (states <= [1.0, 4.0])).all(axis=(0, 2))
    excess = BOX.excess(states)
    np.testing.assert_array_equal(excess <= 1.0 + 1e-12, inside)
    for column in range(5):
        assert BOX.excess(states[:, column]) == excess[column]


def test_a_margin_widens_the_range_of_its_joint() -> None:
    states = np.array([[0.0, 4.4], [0.0, 2.0], [0.0, 2.0]])
    assert BOX.excess(states) == pytest.approx(1.2)
    assert BOX.widened(np.array([0.0, 0.5])).excess(states) == pytest.approx(0.8)
    assert BOX.widened(np.array([0.5, 0.0])).excess(states) == pytest.approx(1.2)


def test_a_joint_that_did_not_move_may_not_move() -> None:
    still = TrainingRange(np.full((3, 1), 0.5), np.full((3, 1), 0.5))
    assert still.excess(np.full((3, 1), 0.5)) == 0.0
    assert still.excess(np.full((3, 1), 0.6)) > 2.0


def test_the_worst_joint_decides_on_the_standard_deviation() -> None:
    assert std_excess(np.array([1.0, 6.0]), np.array([4.0, 3.0])) == 2.0
    assert std_excess(np.array([np.inf, 1.0]), np.array([4.0, 3.0])) == np.inf


@pytest.mark.parametrize(
    ('policy', 'expected'),
    [
        (Policy.WARN, [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
        (Policy.SCALE, [1.0, 1.0, 0.75, 0.0, 0.0, 0.0]),
        (Policy.ZERO, [1.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
    ],
)
def test_policies(policy: Policy, expected: list[float]) -> None:
    counts: Counter[str] = Counter()
    excess = np.array([0.0, 1.0, 1.25, 3.0, np.inf, np.nan])
    np.testing.assert_array_equal(factors(policy, excess, counts, 'far'), expected)
    assert counts == {'far': 4}
