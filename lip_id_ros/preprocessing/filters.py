"""Zero-phase smoothing of uniformly sampled signals, and how far its edges reach."""

from __future__ import annotations

from scipy import signal

from lip_id_ros.arrays import Array
from lip_id_ros.preprocessing.derivatives import HALF_STENCIL

_ORDER = 4


def is_filtered(rate_hz: float, cutoff_hz: float) -> bool:
    """Whether a low-pass changes anything: not with cut-off 0, nor at half the rate or above."""
    return 0.0 < cutoff_hz < 0.5 * rate_hz


def low_pass(values: Array, rate_hz: float, cutoff_hz: float) -> Array:
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
    smooth: Array = signal.sosfiltfilt(sections, values, axis=0, padlen=padding)
    return smooth


def edge_length(rate_hz: float, cutoff_hz: float, periods: float = 1.0) -> int:
    """
    Return how many samples at each end of a segment are not to be used.

    Some periods of the cut-off, over which the low-pass sees an invented continuation, and twice
    half the derivative's stencil, where it is one-sided: velocity and acceleration may both be
    derivatives.

    """
    lead_in = periods * rate_hz / cutoff_hz if is_filtered(rate_hz, cutoff_hz) else 0.0
    return round(lead_in) + 2 * HALF_STENCIL
