"""
Smoothing and differentiation of uniformly sampled signals, without delay.

The choices below were measured on sums of 20 sinusoids up to 1 Hz in velocity noise of 0.01 rad/s,
sampled at 30, 125 and 500 Hz and low-passed at 4 Hz (`test/preprocessing/test_filters.py` repeats
the essential ones). Error of the acceleration without noise at 30 Hz: 0.45 % with three-point
central differences, 1.5 % with Savitzky-Golay of five points and order two, 0.007 % with five
points and order four; with noise the three lie within 0.2 % of each other.

"""

from __future__ import annotations

from scipy import signal

from lip_id_ros.recording.joint_samples import Floats

_ORDER = 4
_STENCIL = 5
_DEGREE = 4
_EDGE_PERIODS = 1.0

MIN_SAMPLES = _STENCIL
"""Fewer samples cannot be differentiated."""


def is_filtered(rate_hz: float, cutoff_hz: float) -> bool:
    """Whether a low-pass changes anything: not with cut-off 0, nor at half the rate or above."""
    return 0.0 < cutoff_hz < 0.5 * rate_hz


def low_pass(values: Floats, rate_hz: float, cutoff_hz: float) -> Floats:
    """
    Zero-phase Butterworth low-pass of fourth order, run forward and backward.

    Parameters
    ----------
    values : ndarray, shape (N, ...)
        Uniform samples along the first axis.
    rate_hz : float
        Sampling rate [Hz].
    cutoff_hz : float
        Frequency whose amplitude is halved [Hz]; with 0, or at half the rate and above, where
        a sampled signal has no content to remove, the values are returned as they are.

    """
    if not is_filtered(rate_hz, cutoff_hz):
        return values
    sections = signal.butter(_ORDER, cutoff_hz, fs=rate_hz, output='sos')
    padding = min(len(values) - 1, round(rate_hz / cutoff_hz))
    smooth: Floats = signal.sosfiltfilt(sections, values, axis=0, padlen=padding)
    return smooth


def derivative(values: Floats, rate_hz: float) -> Floats:
    """
    Differentiate by time: Savitzky-Golay with five points and order four.

    Parameters
    ----------
    values : ndarray, shape (N, ...)
        At least `MIN_SAMPLES` uniform samples along the first axis.
    rate_hz : float
        Sampling rate [Hz].

    """
    slope: Floats = signal.savgol_filter(
        values, _STENCIL, _DEGREE, deriv=1, delta=1.0 / rate_hz, axis=0
    )
    return slope


def edge_length(rate_hz: float, cutoff_hz: float) -> int:
    """
    Return how many samples at each end of a segment are not to be used.

    One period of the cut-off, over which the low-pass sees an invented continuation, and twice
    half the derivative's stencil, where it is one-sided.

    """
    lead_in = _EDGE_PERIODS * rate_hz / cutoff_hz if is_filtered(rate_hz, cutoff_hz) else 0.0
    return round(lead_in) + 2 * (_STENCIL // 2)
