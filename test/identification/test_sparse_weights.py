"""Means by the weights of few samples against those of all."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np

from lip_id_ros.identification.process_parameters import sparse_weights
from lip_id_ros.model.remainder import correlation, near_and_beyond


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    count=st.integers(2, 200),
    length=st.floats(0.3, 6.0),
    share=st.floats(1e-3, 1.0),
)
def test_means_are_those_of_all_samples(
    seed: int, count: int, length: float, share: float
) -> None:
    rng = np.random.default_rng(seed)
    x, lengths = rng.standard_normal((count, 4)), np.full(4, length)
    gram = correlation(x, x, lengths) + 0.1 * np.eye(count)
    alpha = np.linalg.solve(gram, rng.standard_normal((count, 2)) * [1.0, 100.0])
    means = correlation(near_and_beyond(x), x, lengths) @ alpha
    tolerance = share * means.std(axis=0) + 1e-300
    few = sparse_weights(x, lengths, alpha, tolerance)
    got = correlation(near_and_beyond(x), x, lengths) @ few
    assert np.all(np.abs(got - means) <= 1.001 * tolerance)


def test_a_smooth_mean_needs_few_samples() -> None:
    rng = np.random.default_rng(0)
    x, lengths = rng.uniform(-1.0, 1.0, (400, 3)), np.full(3, 2.0)
    gram = correlation(x, x, lengths) + 0.1 * np.eye(400)
    alpha = np.linalg.solve(gram, np.sin(x @ np.ones((3, 1))))
    few = sparse_weights(x, lengths, alpha, np.array([0.01]))
    assert few.any(axis=1).sum() < 40


def test_a_mean_of_zero_needs_no_sample() -> None:
    x = np.random.default_rng(0).standard_normal((5, 2))
    few = sparse_weights(x, np.ones(2), np.zeros((5, 1)), np.array([0.1]))
    assert not few.any()
