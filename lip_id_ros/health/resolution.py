"""Steps, plateaus and clipped ends of a signal as it was recorded."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array

LEAST_REPETITION = 4
ON_GRID = 0.9
MOST_VALUES = 50_000
TOP_WIDTH = 0.002
LEAST_TOP = 0.005
TOP_OVER_NEXT = 5
LEAST_RUN = 5


def quantum(values: Array) -> float:
    """
    Return the step of a quantised signal, 0 where there is none to be seen.

    Parameters
    ----------
    values : ndarray, shape (N,)

    """
    values = values[:: max(1, values.size // MOST_VALUES)]
    levels = np.unique(values)
    if levels.size < 2 or LEAST_REPETITION * levels.size > values.size:
        return 0.0
    steps = np.diff(levels)
    step = float(np.median(steps[steps <= 1.5 * np.percentile(steps, 20)]))
    multiples = steps / step
    on_grid = np.abs(multiples - np.round(multiples)) < 0.1
    return step if on_grid.mean() > ON_GRID else 0.0


def longest_plateau(t: Array, values: Array) -> tuple[int, int]:
    """Return first and last row of the longest time [s] that a signal stays exactly the same."""
    changes = np.flatnonzero(np.diff(values) != 0.0)
    starts = np.concatenate([[0], changes + 1])
    ends = np.concatenate([changes, [values.size - 1]])
    longest = int(np.argmax(t[ends] - t[starts]))
    return int(starts[longest]), int(ends[longest])


def clipped_share(values: Array) -> float:
    """
    Return the share of samples that lie on a flat end of a signal's range.

    A sine that is only quantised has at most two and a half times as many samples on its last
    level as on the one before; a clipped signal has far more.

    Parameters
    ----------
    values : ndarray, shape (N,)

    """
    return max(_flat_top(values), _flat_top(-values))


def _flat_top(values: Array) -> float:
    extent = float(np.ptp(values))
    if extent == 0.0:
        return 0.0
    width = max(TOP_WIDTH * extent, 0.5 * quantum(values))
    depth = values.max() - values
    top = depth <= width
    following = int((depth <= 3.0 * width).sum() - top.sum())
    count = int(top.sum())
    share = float(count / values.size)
    steep = count >= TOP_OVER_NEXT * (following + 1) and _longest_run(top) >= LEAST_RUN
    return share if steep and share >= LEAST_TOP else 0.0


def _longest_run(mask: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
