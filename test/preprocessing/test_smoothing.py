"""Smoothing, differentiating and resampling against motions that are known exactly."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from preprocessing.motions import relative_error, Sinusoids, uniform
import pytest

from lip_id_ros.arrays import Array
from lip_id_ros.preprocessing.smoothing import (
    edge_length,
    is_filtered,
    low_pass,
    resample,
    savitzky_golay,
    uniform_times,
)

derivative = savitzky_golay


def sine(frequency: float, rate: float) -> Array:
    wave: Array = np.sin(2.0 * np.pi * frequency * uniform(int(20 * rate), rate))[:, np.newaxis]
    return wave


@pytest.mark.parametrize('rate', [30.0, 125.0, 500.0])
@pytest.mark.parametrize('frequency', [0.5, 1.0, 2.0])
def test_low_pass_keeps_slow_motion_in_place(rate: float, frequency: float) -> None:
    wave = sine(frequency, rate)
    edge = edge_length(rate, 4.0)
    gain = 1.0 / (1.0 + (np.tan(np.pi * frequency / rate) / np.tan(np.pi * 4.0 / rate)) ** 8)
    inner = slice(edge, -edge)
    np.testing.assert_allclose(low_pass(wave, rate, 4.0)[inner], gain * wave[inner], atol=5e-3)


@pytest.mark.parametrize('rate', [30.0, 125.0, 500.0])
def test_low_pass_removes_what_is_fast(rate: float) -> None:
    edge = edge_length(rate, 4.0)
    smooth = np.abs(low_pass(sine(12.0, rate), rate, 4.0))
    assert smooth[edge:-edge].max() < 2e-2
    assert smooth[3 * edge : -3 * edge].max() < 1e-3


@pytest.mark.parametrize('cutoff', [0.0, 15.0, 100.0])
def test_no_low_pass_where_there_is_nothing_to_remove(cutoff: float) -> None:
    wave = sine(1.0, 30.0)
    assert not is_filtered(30.0, cutoff)
    np.testing.assert_array_equal(low_pass(wave, 30.0, cutoff), wave)
    assert edge_length(30.0, cutoff) == 4


@pytest.mark.parametrize('share', [0.46, 0.49])
def test_a_cut_off_just_below_half_the_rate_is_filtered(share: float) -> None:
    noise = np.random.default_rng(0).standard_normal((400, 1))
    assert is_filtered(30.0, 30.0 * share)
    assert low_pass(noise, 30.0, 30.0 * share).std() < 0.995 * noise.std()


@given(st.lists(st.floats(-10, 10), min_size=5, max_size=5), st.floats(1.0, 1000.0))
def test_derivative_of_a_quartic_is_exact(coefficients: list[float], rate: float) -> None:
    polynomial = np.polynomial.Polynomial(coefficients)
    t = np.arange(12) / rate
    slope = derivative(polynomial(t)[:, None], rate)[:, 0]
    scale = 1.0 + rate * np.abs(polynomial(t)).max()
    np.testing.assert_allclose(slope / scale, polynomial.deriv()(t) / scale, atol=1e-9)


@pytest.mark.parametrize(
    ('rate', 'noise', 'allowed'),
    [(30, 0.0, 3e-4), (125, 0.0, 3e-4), (500, 0.0, 3e-4), (30, 0.01, 0.04), (125, 0.01, 0.02)],
)
def test_acceleration_of_noisy_sinusoids(rate: float, noise: float, allowed: float) -> None:
    motion = Sinusoids()
    t = uniform(int(30 * rate), rate)
    measured = motion.velocity(t) + noise * np.random.default_rng(1).normal(size=(t.size, 2))
    edge = 2 * edge_length(rate, 4.0)
    estimate = derivative(low_pass(measured, rate, 4.0), rate)[edge:-edge]
    assert relative_error(estimate, motion.acceleration(t)[edge:-edge]) < allowed


def test_errors_beyond_the_edge_are_those_of_the_middle() -> None:
    motion = Sinusoids()
    rate, cutoff = 125.0, 4.0
    t = uniform(int(20 * rate), rate)
    edge = edge_length(rate, cutoff)
    errors = []
    for seed in range(20):
        noise = 0.01 * np.random.default_rng(seed).normal(size=(t.size, 2))
        smooth = low_pass(motion.velocity(t) + noise, rate, cutoff)
        errors.append(derivative(smooth, rate) - motion.acceleration(t))
    rms = np.sqrt(np.mean(np.square(errors), axis=(0, 2)))
    middle = np.median(rms)
    assert rms[0] > 5 * middle
    assert rms[edge] < 3 * middle
    assert rms[-edge - 1] < 3 * middle


@given(st.integers(2, 50), st.floats(0.5, 2.0))
def test_uniform_times_stay_within_the_samples(count: int, factor: float) -> None:
    t = 5.0 + uniform(count, 100.0)
    times = uniform_times(t, factor * 100.0)
    assert times[0] == t[0]
    assert times[-1] <= t[-1]
    assert t[-1] - times[-1] < 0.01 / factor
    np.testing.assert_allclose(np.diff(times), 0.01 / factor, atol=1e-7)


def test_resampling_uniform_samples_changes_nothing() -> None:
    t = 1e-9 + uniform(500, 125.0)
    values = np.random.default_rng(0).normal(size=(500, 3))
    times = uniform_times(t, 125.0)
    assert times.size == 500
    np.testing.assert_allclose(resample(t, values, times), values, atol=1e-9)


def test_resampling_of_jitter_and_loss_is_better_than_linear() -> None:
    rng = np.random.default_rng(0)
    motion, rate = Sinusoids(), 30.0
    t = uniform(int(30 * rate), rate) + rng.uniform(-0.3, 0.3, 900) / rate
    t = t[rng.uniform(size=900) > 0.1]
    times = uniform_times(t, rate)
    values = motion.velocity(t)
    linear = np.column_stack([np.interp(times, t, column) for column in values.T])
    truth = motion.velocity(times)
    assert relative_error(resample(t, values, times), truth) < 0.5 * relative_error(linear, truth)


@given(st.integers(0, 100))
def test_resampling_never_overshoots(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.001, 1.0, 30) ** 4)
    values = rng.normal(size=(30, 1))
    dense = resample(t, values, np.linspace(t[0], t[-1], 500))
    assert dense.min() >= values.min() - 1e-12
    assert dense.max() <= values.max() + 1e-12
