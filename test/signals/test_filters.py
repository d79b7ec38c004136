"""The causal low-pass against its transfer function."""

from __future__ import annotations

import numpy as np
import pytest

from lip_id_ros.signals.filters import LowPass

STEP_S = 1e-4


def last(low_pass: LowPass, t: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    for time, value in zip(t, values, strict=True):
        filtered = low_pass.add(float(time), np.array([value]))
    assert filtered is not None
    return float(filtered[0][0]), float(filtered[1][0])


@pytest.mark.parametrize('cutoff_hz', [2.0, 10.0])
def test_a_ramp_comes_late_by_two_time_constants(cutoff_hz: float) -> None:
    t = np.arange(0.0, 6.0 / cutoff_hz, STEP_S)
    value, slope = last(LowPass(cutoff_hz), t, 3.0 * t)
    delay = 2.0 / (2.0 * np.pi * cutoff_hz)
    assert slope == pytest.approx(3.0, rel=1e-3)
    assert t[-1] - value / 3.0 == pytest.approx(delay, rel=0.01)


@pytest.mark.parametrize('rate_hz', [25.0, 100.0])
def test_the_derivative_is_that_of_the_output_at_the_same_time(rate_hz: float) -> None:
    """Half a step between both would make acceleration look like friction."""
    low_pass, w, t = LowPass(10.0), 2.0 * np.pi, np.arange(0.0, 10.0, 1.0 / rate_hz)
    signals = np.column_stack([np.sin(w * t), w * np.cos(w * t)])
    given = [low_pass.add(float(time), row) for time, row in zip(t, signals, strict=True)]
    values, slopes = np.swapaxes([each for each in given if each is not None], 0, 1)
    velocity, slope = values[:, 1], slopes[:, 0]
    assert np.abs(slope - velocity).max() < 0.01 * w
