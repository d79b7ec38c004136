"""Folds leave a motion out together with its repetitions."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.identification.folds import first_passes, recurrent_folds

RATE_HZ = 20.0


def sinusoids(phase: Array, seed: int, joints: int = 4) -> tuple[Array, Array]:
    """Return positions at phases and their slopes, periodic in 2 pi."""
    rng = np.random.default_rng(seed)
    size, shift = rng.uniform(0.2, 1.0, (3, joints)), rng.uniform(0.0, 6.0, (3, joints))
    order = np.arange(1.0, 4.0)[:, None, None]
    angle = order * phase[:, None] + shift[:, None]
    q, slope = size[:, None] * np.sin(angle), size[:, None] * order * np.cos(angle)
    return q.sum(axis=0), slope.sum(axis=0)


def moved(period_s: float, seconds: float, seed: int = 0, drift: float = 0.0) -> Dataset:
    """Return a periodic motion whose period grows by a share at every pass."""
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    phase = 2.0 * np.pi * t / period_s * (1.0 - 0.5 * drift * t / period_s)
    q, slope = sinusoids(phase, seed)
    dq = slope * np.gradient(phase, t)[:, None]
    return Dataset.from_arrays(q, dq, np.gradient(dq, t, axis=0), np.zeros_like(q), t=t)


@pytest.mark.parametrize('drift', [0.0, 0.02])
def test_a_later_pass_is_in_the_fold_of_the_first(drift: float) -> None:
    data, period = moved(6.53, 40.0, drift=drift), 6.53
    fold = recurrent_folds(data, 6)
    phase = (data.t / period * (1.0 - 0.5 * drift * data.t / period)) % 1.0
    first = data.t < period
    expected = np.interp(phase, data.t[first] / period, np.arange(first.sum()), period=1.0)
    same = fold == fold[np.round(expected).astype(int) % first.sum()]
    assert same.mean() > 0.9  # but for samples at the borders of folds
    assert np.unique(fold[first]).size == 6


def test_new_motion_is_cut_into_equal_stretches_of_time() -> None:
    data = moved(200.0, 60.0)
    fold = recurrent_folds(data, 6)
    assert np.all(np.diff(fold) >= 0)
    assert np.ptp(np.bincount(fold)) <= 4


def test_the_same_motion_in_another_recording_is_a_repetition() -> None:
    data = moved(200.0, 60.0)
    fold = recurrent_folds(concatenate([data, data]), 6).reshape(2, -1)
    assert np.mean(fold[0] == fold[1]) > 0.97


def test_a_rest_is_one_sample_repeated() -> None:
    data = moved(200.0, 30.0)
    still = np.zeros((400, 4))
    t = data.t[-1] + (1 + np.arange(400)) / RATE_HZ
    rest = {'q': still + data.q[-1], 'dq': still, 'ddq': still, 'tau': still}
    joined = {name: np.vstack([getattr(data, name), rows]) for name, rows in rest.items()}
    states = joined['q'], joined['dq'], joined['ddq'], joined['tau']
    held = Dataset.from_arrays(*states, t=np.concatenate([data.t, t]))
    fold = recurrent_folds(held, 6)
    assert np.unique(fold[-380:]).size == 1
    assert np.unique(fold[: data.n_samples]).size == 6


@settings(max_examples=20)
@given(st.integers(1, 60), st.integers(1, 8), st.floats(0.5, 50.0))
def test_every_sample_has_a_fold_and_every_fold_a_sample(
    samples: int, count: int, period: float
) -> None:
    data = moved(period, samples / RATE_HZ + 1e-9)
    fold = recurrent_folds(data, count)
    assert fold.shape == (data.n_samples,)
    assert set(fold) == set(range(fold.max() + 1))
    assert fold.max() < count


def test_a_first_pass_is_its_own_and_earlier() -> None:
    data = moved(5.0, 30.0)
    first = first_passes(data, np.arange(data.n_samples))
    assert np.all(first <= np.arange(first.size))
    assert np.all(first[first] == first)
