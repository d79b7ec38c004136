"""A few samples that stand for a recording, also where a copy is float32 or has fewer messages."""

from __future__ import annotations

from collections.abc import Sequence
import re

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.recording.joint_samples import row_hashes
from lip_id_ros.recording.spill import release, row_blocks

SKETCH = 'sketch'
"""Of a source, in the provenance; several are one after another."""

KEPT, LEAST = 32, 3
"""Hashes that are kept, the smallest, and those that two recordings of one source share."""

BITS = 14
"""Of the mantissa: few enough that float32 hardly ever rounds otherwise."""

DIGITS = 12

OFTEN = 1e-3
"""Positions of a larger share of the samples are those of an arm at rest, as others may have."""


def content_sketch(joint_names: Sequence[str], *signals: Array) -> str:
    """
    Return the smallest hashes of the samples, signals (N, n): positions, then others as efforts.

    A copy with every k-th sample keeps about one in k of them (Broder, On the resemblance and
    containment of documents, 1997).
    """
    kept = np.empty(0, np.uint64)
    for block in row_blocks(len(signals[0])):
        rows = [_rounded(signal[block]) for signal in signals]
        hashes = row_hashes(joint_names, rows)[_seldom(row_hashes(joint_names, rows[:1]))]
        kept = np.union1d(kept, hashes >> np.uint64(64 - 4 * DIGITS))[:KEPT]
        release(*signals)
    return ''.join(f'{number:0{DIGITS}x}' for number in kept.tolist())


def have_common_samples(one: str, other: str) -> bool:
    """Whether two sketches are of one recording, or of parts of it."""
    first, second = (set(re.findall('.' * DIGITS, each)) for each in (one, other))
    return len(first & second) >= LEAST


def _seldom(hashes: NDArray[np.uint64]) -> BoolArray:
    """Mark what is not found again and again."""
    _, place, counts = np.unique(hashes, return_inverse=True, return_counts=True)
    seldom: BoolArray = counts[place] <= max(1.0, OFTEN * hashes.size)
    return seldom


def _rounded(values: Array) -> Array:
    mantissa, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.round(np.ldexp(mantissa, BITS)), exponent - BITS) + 0.0)
