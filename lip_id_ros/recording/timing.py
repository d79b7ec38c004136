"""Clocks, rates and gaps of recordings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.recording.joint_samples import Floats

GAP_STEPS = 5.0
"""A step of more than so many median steps is a gap, unless a setting says otherwise."""

_MIN_FORWARD = 0.25


def header_stamps_usable(stamps_ns: Sequence[int]) -> bool:
    """
    Whether header stamps tell the time.

    They do if they advance: at least a quarter of the steps go forward, and more of them forward
    than back. A first stamp of 0 or 1 ns is as good as any; stamps that are constant (never
    filled in) or random are not usable.

    Parameters
    ----------
    stamps_ns : sequence of int
        Stamps in the order of recording [ns].

    """
    steps = np.diff(np.asarray(stamps_ns, dtype=np.int64))
    forward, backward = int((steps > 0).sum()), int((steps < 0).sum())
    return forward >= _MIN_FORWARD * steps.size and forward >= backward


def median_step(t: Floats) -> float:
    """Return the median step of increasing times [s]; 0 for fewer than two."""
    return float(np.median(np.diff(t))) if t.size > 1 else 0.0


def gap_starts(t: Floats, longest_s: float) -> NDArray[np.intp]:
    """Return the index of the last sample before each step longer than `longest_s`."""
    return np.flatnonzero(np.diff(t) > longest_s)
