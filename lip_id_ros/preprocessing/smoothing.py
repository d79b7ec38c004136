"""
Raw samples brought to uniform steps, low-passed without delay, and differentiated.

Filters and derivatives need uniform steps, recordings have jitter and lost messages. Monotone
cubic interpolation (PCHIP) was chosen by measurement: where stamps jitter by 30 % of the step or a
tenth of the messages is lost, the error it adds to accelerations is 3 to 10 times smaller than
that of linear interpolation at 30 Hz; and it never overshoots, where a cubic spline turns bursts
of nearly equal stamps into accelerations wrong by 14 % at noise that others take for 2 to 3 %.

Measured on sums of 20 sinusoids up to 1 Hz at 30 Hz, low-passed at 4 Hz: the error of the
acceleration is 0.007 % with Savitzky-Golay of five points and order four, 0.45 % with central
differences, and about 2.4 % with both where the velocity has noise of 0.01 rad/s, because then the
low-pass decides (`test/preprocessing/test_smoothing.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
import math
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

from lip_id_ros.arrays import Array
from lip_id_ros.recording.timing import gap_starts, GAP_STEPS, median_step
from lip_id_ros.settings import PreprocessingSettings

Derivative = Callable[[Array, float], Array]
"""Differentiates uniform samples, shape (N, ...), at a rate [Hz] along the first axis."""

MIN_SAMPLES = 5
"""Fewer samples cannot be differentiated by every method."""
HALF_STENCIL = 2
"""So many samples at each end have a one-sided derivative at the most."""

BRIDGED_PERIODS = 0.25
"""Longest hole that is interpolated over whatever the rate, in periods of the cut-off."""

_ORDER = 4
_LONGEST_EDGE = 1e12  # samples, more than any recording has
_ROUNDING = 1e-6
_WINDOW = 50_000
_SETTLED_PERIODS = 20.0
"""After so many periods of its cut-off the low-pass has forgotten its start, to rounding."""
_NEIGHBOURS = 3
"""So many samples on both sides decide the interpolation."""


def savitzky_golay(values: Array, rate_hz: float, points: int = 5, degree: int = 4) -> Array:
    """Return the slope of a polynomial fitted to neighbours; exact for those of its degree."""
    from scipy import signal  # brings scipy.stats, which takes a third of a second

    slope: Array = signal.savgol_filter(
        values, points, degree, deriv=1, delta=1.0 / rate_hz, axis=0
    )
    return slope


def central_differences(values: Array, rate_hz: float) -> Array:
    """Return the difference of the two neighbours; damps what is fast."""
    slope: Array = np.gradient(values, 1.0 / rate_hz, axis=0)
    return slope


DERIVATIVES: Mapping[str, Derivative] = {
    'savitzky_golay': savitzky_golay,
    'central_differences': central_differences,
}
"""By the name that `preprocessing.derivative` has for them."""


def is_filtered(rate_hz: float, cutoff_hz: float) -> bool:
    """Whether a low-pass changes anything: not with cut-off 0, nor at half the rate or above."""
    return 0.0 < cutoff_hz < 0.5 * rate_hz


def low_pass(values: Array, rate_hz: float, cutoff_hz: float) -> Array:
    """
    Low-pass uniform samples, shape (N, ...), by a zero-phase Butterworth filter of fourth order.

    The cut-off is the frequency whose amplitude is halved [Hz]. With 0, or at half the rate and
    above, where a sampled signal has no content to remove, the values are returned unchanged.
    """
    if not is_filtered(rate_hz, cutoff_hz):
        return values
    from scipy import signal  # see above

    sections = signal.butter(_ORDER, cutoff_hz, fs=rate_hz, output='sos')
    padding = min(len(values) - 1, round(rate_hz / cutoff_hz))
    smooth: Array = signal.sosfiltfilt(sections, values, axis=0, padlen=padding)
    return smooth


def edge_length(
    rate_hz: float, cutoff_hz: float, periods: float = 1.0, delay_s: float = 0.0
) -> int:
    """
    Return how many samples at each end of a segment are not to be used.

    Some periods of the cut-off, over which the low-pass sees an invented continuation, twice
    half the derivative's stencil, where it is one-sided (velocity and acceleration may both be
    derivatives), and the largest delay of an effort [s], for which there is none.
    """
    lead_in = periods * rate_hz / cutoff_hz if is_filtered(rate_hz, cutoff_hz) else 0.0
    return round(min(lead_in, _LONGEST_EDGE)) + 2 * HALF_STENCIL + math.ceil(delay_s * rate_hz)


def uniform_times(t: Array, rate_hz: float, first: int = 0, last: int | None = None) -> Array:
    """Return times at a rate, from the first of `t` and not beyond the last [s], or some."""
    numbers = np.arange(first, grid_size(t, rate_hz) if last is None else last)
    times: Array = np.minimum(t[0] + numbers / rate_hz, t[-1])
    return times


def resample(t: Array, values: Array, times: Array) -> Array:
    """Interpolate samples at times t, shape (N, n), to times within, shape (K, n); monotone."""
    interpolated: Array = PchipInterpolator(t, values, axis=0)(times)
    return interpolated


def resample_early(t: Array, values: Array, times: Array, delays_s: Sequence[float]) -> Array:
    """
    Interpolate as `resample` does, column j at times `delays_s[j]` later [s].

    Beyond the samples the first or the last one is repeated.
    """
    if not any(delays_s):
        return resample(t, values, times)
    later = (np.clip(times + delay, t[0], t[-1]) for delay in delays_s)
    columns = [resample(t, values[:, j], each) for j, each in enumerate(later)]
    return np.stack(columns, axis=1)


class Window(NamedTuple):
    """
    A part of a segment that is smoothed at once, with enough beside it that no edge is seen.

    `rows`: samples of the segment that it needs.
    `times`, shape (K,): uniform times to bring them to [s].
    `first`: number of the first of these times on the grid of the segment.
    `start`, `stop`: on that grid, what is to be taken from this window.
    """

    rows: slice
    times: Array
    first: int
    start: int
    stop: int


def windows(
    t: Array, rate_hz: float, cutoff_hz: float, delay_s: float = 0.0, hold: int = 1
) -> Iterator[Window]:
    """
    Cut the uniform grid of a segment, times t [s], into windows that overlap.

    What they give together differs from smoothing the segment at once by rounding only, also
    where efforts are taken from up to `delay_s` earlier or later, and where only every `hold`-th
    sample of a signal is new.
    """
    size = grid_size(t, rate_hz)
    margin = 4 * HALF_STENCIL
    if is_filtered(rate_hz, cutoff_hz):
        # near half the rate its poles forget as slowly as at frequencies near zero
        slowest = min(cutoff_hz, 0.5 * rate_hz - cutoff_hz)
        margin += math.ceil(_SETTLED_PERIODS * rate_hz / slowest)
    length, beside = max(_WINDOW, 8 * margin), 2 * _NEIGHBOURS * hold
    for start in range(0, size, length):
        stop = min(start + length, size)
        if size - stop < length // 2:  # no short rest
            stop = size
        first, last = max(0, start - margin), min(size, stop + margin)
        times = uniform_times(t, rate_hz, first, last)
        begin, end = np.searchsorted(t, [times[0] - delay_s, times[-1] + delay_s])
        rows = slice(max(0, int(begin) - beside), min(t.size, int(end) + 1 + beside))
        yield Window(rows, times, first, start, stop)
        if stop == size:
            return


def longest_step(t: Array, cutoff_hz: float) -> float:
    """
    Return the longest step between samples that is no gap [s].

    Five median steps, or a part of the period of the low-pass, within which the motion that it
    keeps does not change its course.
    """
    bridged = BRIDGED_PERIODS / cutoff_hz if cutoff_hz > 0.0 else 0.0
    return max(GAP_STEPS * median_step(t), bridged)


def cut(t: Array, max_gap_s: float) -> list[slice]:
    """Return the rows between steps longer than `max_gap_s` [s]."""
    ends = [*(gap_starts(t, max_gap_s) + 1).tolist(), t.size]
    return [slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True)]


def is_long_enough(
    t: Array, rate_hz: float, settings: PreprocessingSettings, delay_s: float = 0.0
) -> bool:
    """Whether a segment lasts as long as the settings ask, and has samples between its edges."""
    if t.size < 2:
        return False
    duration = float(t[-1] - t[0])
    edges = 2 * edge_length(rate_hz, settings.cutoff, settings.edge_periods, delay_s)
    return duration >= settings.min_segment_s and duration * rate_hz >= max(edges, MIN_SAMPLES)


def grid_size(t: Array, rate_hz: float) -> int:
    """Return how many times `uniform_times` has."""
    return int((t[-1] - t[0]) * rate_hz + _ROUNDING) + 1
