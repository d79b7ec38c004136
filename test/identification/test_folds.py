"""Folds leave a motion out together with its repetitions."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.dataset import concatenate, Dataset
from lip_id_ros.identification.folds import (
    at_rest,
    first_passes,
    motion_s,
    NEAR,
    PAST_S,
    recurrent_folds,
)

RATE_HZ, PERIOD_S = 20.0, 6.53


def sinusoids(phase: Array, seed: int, joints: int = 4) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    size, shift = rng.uniform(0.2, 1.0, (3, joints)), rng.uniform(0.0, 6.0, (3, joints))
    order = np.arange(1.0, 4.0)[:, None, None]
    angle = order * phase[:, None] + shift[:, None]
    q, slope = size[:, None] * np.sin(angle), size[:, None] * order * np.cos(angle)
    return q.sum(axis=0), slope.sum(axis=0)


def moved(
    period_s: float, seconds: float, seed: int = 0, drift: float = 0.0, rate_hz: float = RATE_HZ
) -> Dataset:
    t = np.arange(0.0, seconds, 1.0 / rate_hz)
    phase = 2.0 * np.pi * t / period_s * (1.0 - 0.5 * drift * t / period_s)
    q, slope = sinusoids(phase, seed)
    dq = slope * np.gradient(phase, t)[:, None]
    return Dataset.from_arrays(q, dq, np.gradient(dq, t, axis=0), np.zeros_like(q), t=t)


@pytest.mark.parametrize(
    ('rate_hz', 'seconds', 'drift'),
    [(20.0, 40.0, 0.0), (20.0, 40.0, 0.02), (10.0, 3600.0, 0.0), (1000.0, 30.0, 0.0)],
)
def test_a_later_pass_is_in_the_fold_of_the_first(
    rate_hz: float, seconds: float, drift: float
) -> None:
    data = moved(PERIOD_S, seconds, drift=drift, rate_hz=rate_hz)
    fold, passes = recurrent_folds(data, 6), data.t / PERIOD_S
    phase = (passes * (1.0 - 0.5 * drift * passes)) % 1.0
    first = passes < 1.0
    expected = np.interp(phase, passes[first], np.arange(first.sum()), period=1.0)
    same = fold == fold[np.round(expected).astype(int) % first.sum()]
    assert same.mean() > 0.95  # but for samples at the borders of folds
    assert np.unique(fold[first]).size == 6


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


def held(seconds: float, noise: float) -> Dataset:
    """Return 20 s of motion without repetitions, with a rest in its middle."""
    data, still = moved(200.0, 20.0), np.zeros((round(seconds * RATE_HZ), 4))
    dq = noise * np.random.default_rng(0).standard_normal(still.shape)
    half = data.n_samples // 2
    rest = {'q': still + data.q[half], 'dq': dq, 'ddq': still, 'tau': still}
    q, dq, ddq, tau = (np.insert(getattr(data, each), half, rest[each], axis=0) for each in rest)
    return Dataset.from_arrays(q, dq, ddq, tau, t=np.arange(len(q)) / RATE_HZ)


def test_a_long_rest_is_no_motion_whatever_its_noise() -> None:
    """Of all samples the speed is a tenth of that in motion."""
    data = held(2000.0, 0.002 * float(np.sqrt(np.mean(moved(200.0, 20.0).dq ** 2))))
    np.testing.assert_allclose(motion_s(data), 20.0, atol=0.2)


def test_a_rest_that_was_left_out_is_no_motion() -> None:
    data = held(200.0, 0.0)
    np.testing.assert_allclose(motion_s(data.select(~at_rest(data))), 20.0, atol=0.6)


@settings(max_examples=20)
@given(st.integers(1, 60), st.integers(1, 8), st.floats(0.5, 50.0))
def test_every_sample_has_a_fold_and_all_of_them(samples: int, count: int, period: float) -> None:
    data = moved(period, samples / RATE_HZ + 1e-9)
    fold = recurrent_folds(data, count)
    assert fold.shape == (data.n_samples,)
    assert set(fold) == set(range(fold.max() + 1))
    assert fold.max() < count


@settings(max_examples=20)
@given(st.floats(2.0, 50.0), st.floats(2.0, 100.0))
def test_a_first_pass_is_its_own_and_earlier(period: float, rate_hz: float) -> None:
    data = moved(period, 30.0, rate_hz=rate_hz)
    first = first_passes(data)
    assert np.all(first <= np.arange(first.size))
    assert np.all(first[first] == first)


def test_samples_repeat_what_a_plain_search_finds_near() -> None:
    """Every state that is new is far from all those of an earlier time, and no other is."""
    data = moved(PERIOD_S, 25.0)
    first, own = first_passes(data), np.arange(data.n_samples)
    states = np.hstack([data.q / data.q.std(axis=0), data.dq / data.dq.std(axis=0)])
    states /= np.sqrt(states.shape[1])
    distance = np.linalg.norm(states[:, None] - states, axis=2)
    earlier = data.t[:, None] - data.t > 4.0 * PAST_S
    nearest = np.where(earlier, distance, np.inf).min(axis=1)
    assert np.all(nearest[first == own] > 0.8 * NEAR)
    assert np.all(distance[own, first][first < own] < 2.0 * NEAR)
    assert np.mean(first < own) > 0.7
