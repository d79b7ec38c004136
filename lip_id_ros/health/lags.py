"""Signals shifted against each other, never across a gap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.health.motion import Stretch


def shifted(stretches: Sequence[Stretch], name: str, reach: int, lag: int) -> Array:
    """
    Return a signal `lag` samples later, without the first and last `reach` of every stretch.

    Parameters
    ----------
    stretches : sequence of Stretch
        Each longer than twice the reach.
    name : str
        Of the signal.
    reach, lag : int
        The lag is from -reach to reach.

    """
    parts = [getattr(stretch, name) for stretch in stretches]
    return np.concatenate([part[reach + lag : len(part) - reach + lag] for part in parts])


def peak(values: Array, rate_hz: float) -> float:
    """
    Return the lag of the largest of 2 reach + 1 values [s], between samples by a parabola.

    nan where the largest lies at an end, since the true one may lie beyond.

    """
    at = int(np.argmax(values))
    if not 0 < at < len(values) - 1:
        return float('nan')
    left, top, right = values[at - 1 : at + 2]
    bend = left - 2.0 * top + right
    between = 0.5 * (left - right) / bend if bend < 0.0 else 0.0
    return float((at + between - len(values) // 2) / rate_hz)
