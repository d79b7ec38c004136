"""Filters of our own against those of scipy.signal, whose import takes long."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
from numpy.testing import assert_allclose
import pytest
from scipy import signal

from lip_id_ros.arrays import Array
from lip_id_ros.preprocessing.filters import (
    BLOCK,
    polynomial_derivative,
    zero_phase_butterworth,
)

LENGTHS = [1, 2, 5, BLOCK - 1, BLOCK, BLOCK + 1, 1000]


def walk(count: int, seed: int = 0, columns: int = 3) -> Array:
    return np.cumsum(np.random.default_rng(seed).standard_normal((count, columns)), axis=0)


def assert_as_scipy(values: Array, cutoff: float, padding: int) -> None:
    sections = signal.butter(4, cutoff, fs=1.0, output='sos')
    expected = signal.sosfiltfilt(sections, values, axis=0, padlen=padding)
    found = zero_phase_butterworth(values, cutoff, padding)
    assert found.shape == values.shape
    assert found.flags.c_contiguous
    # scipy's coefficients lose the square of the cut-off
    rounding = 1e-13 + 1e-17 / cutoff**2
    assert_allclose(found, expected, atol=10.0 * rounding * np.abs(values).max())


@given(
    count=st.integers(1, 700),
    cutoff=st.floats(1e-3, 0.49),
    share=st.floats(0.0, 1.0),
    seed=st.integers(0, 1000),
)
def test_low_pass_is_that_of_scipy(count: int, cutoff: float, share: float, seed: int) -> None:
    assert_as_scipy(walk(count, seed), cutoff, round(share * (count - 1)))


@pytest.mark.parametrize('count', LENGTHS)
def test_low_pass_of_any_number_of_samples(count: int) -> None:
    assert_as_scipy(walk(count), 0.07, min(count - 1, 14))


def test_low_pass_of_a_single_signal() -> None:
    assert_as_scipy(walk(300)[:, 0], 0.1, 10)


@pytest.mark.parametrize('cutoff', [1e-4, 1e-3, 0.01, 0.1, 0.4])
def test_what_is_constant_stays(cutoff: float) -> None:
    """To 1e-12 at cut-offs at which scipy has lost seven digits."""
    found = zero_phase_butterworth(np.full((5000, 1), 7.0), cutoff, 4999)
    assert_allclose(found, 7.0, rtol=2e-12)


@pytest.mark.parametrize(('points', 'degree'), [(5, 4), (7, 4), (9, 2), (3, 1)])
@pytest.mark.parametrize('count', [9, 10, 300])
def test_derivative_is_that_of_scipy(points: int, degree: int, count: int) -> None:
    values = walk(count)
    expected = signal.savgol_filter(values, points, degree, deriv=1, delta=0.01, axis=0)
    found = polynomial_derivative(values, 0.01, points, degree)
    assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def test_derivative_of_as_few_samples_as_points() -> None:
    """All are of one polynomial."""
    t = 0.1 * np.arange(5)
    found = polynomial_derivative((t**4 - t)[:, None], 0.1, 5, 4)
    assert_allclose(found[:, 0], 4.0 * t**3 - 1.0, atol=1e-12)
