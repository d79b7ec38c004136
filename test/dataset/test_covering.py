"""Which samples are chosen: distinct ones, as many as asked for, those at the edge first."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from kernels.cases import random_states
import numpy as np

from lip_id_ros.arrays import Array, IntArray
from lip_id_ros.dataset import Dataset

TYPES = ('revolute', 'prismatic')
SIZES = {'n_samples': st.integers(1, 40), 'count': st.integers(1, 50), 'seed': st.integers(0, 99)}


def spread(types: tuple[str, ...], q: Array, dq: Array, ddq: Array, count: int) -> IntArray:
    """Return the numbers of the chosen samples."""
    data = Dataset(
        t=np.arange(float(len(q))),
        q=q,
        dq=dq,
        ddq=ddq,
        tau=q,
        joint_names=tuple(f'joint_{i + 1}' for i in range(q.shape[1])),
        joint_types=types,
        segment=np.zeros(len(q), dtype=np.int64),
    )
    return data.covering(count)


@given(**SIZES)
def test_chosen_rows(n_samples: int, count: int, seed: int) -> None:
    q, dq, ddq = random_states(n_samples, 2, np.random.default_rng(seed))
    rows = spread(TYPES, q, dq, ddq, count)
    assert len(rows) == min(count, n_samples)
    assert (np.diff(rows) > 0).all()
    assert rows[0] >= 0
    assert rows[-1] < n_samples


@given(**SIZES)
def test_more_samples_keep_the_fewer(n_samples: int, count: int, seed: int) -> None:
    """Farthest-point selection is greedy: a larger choice holds the smaller."""
    q, dq, ddq = random_states(n_samples, 2, np.random.default_rng(seed))
    fewer = spread(TYPES, q, dq, ddq, count)
    assert set(fewer) <= set(spread(TYPES, q, dq, ddq, count + 1))


# Position, velocity and acceleration of both joints, but for the angle, which has no extremes.
NUMBERS = [(0, 1), (1, 0), (1, 1), (2, 0), (2, 1)]


@given(place=st.integers(0, 29), number=st.sampled_from(NUMBERS))
def test_an_extreme_sample_is_among_the_first_two(place: int, number: tuple[int, int]) -> None:
    states = random_states(30, 2, np.random.default_rng(0))
    states[number[0]][place, number[1]] = 50.0
    assert place in spread(TYPES, *states, 2)


@given(repeats=st.integers(2, 5), count=st.integers(4, 7))
def test_repeated_samples_are_chosen_once(repeats: int, count: int) -> None:
    q, dq, ddq = (
        np.repeat(x, repeats, axis=0) for x in random_states(4, 2, np.random.default_rng(0))
    )
    rows = spread(TYPES, q, dq, ddq, count)
    np.testing.assert_array_equal(rows // repeats, np.arange(4))


def test_turns_are_the_same_angle() -> None:
    """A revolute joint is measured by its features, not by its number of turns."""
    q, dq, ddq = random_states(20, 1, np.random.default_rng(0))
    expected = spread(('revolute',), q, dq, ddq, 6)
    turns = 2.0 * np.pi * np.random.default_rng(1).integers(-3, 4, size=q.shape)
    np.testing.assert_array_equal(spread(('revolute',), q + turns, dq, ddq, 6), expected)
