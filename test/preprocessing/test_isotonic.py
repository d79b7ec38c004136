"""Isotonic regression is that of SciPy."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from lip_id_ros.preprocessing.isotonic import isotonic

optimize = pytest.importorskip('scipy.optimize')


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=50))
def test_values_are_those_of_scipy(values: list[float]) -> None:
    if not hasattr(optimize, 'isotonic_regression'):
        pytest.skip('SciPy has isotonic_regression from 1.12 on')
    expected = optimize.isotonic_regression(np.array(values)).x
    assert isotonic(np.array(values)) == pytest.approx(expected, abs=1e-9)
