"""The rise time of torques is that of the low-pass in their provenance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks._drives import recording
from lip_id_ros.identification.friction_candidates import RISE_PERIODS, rise_time


@pytest.mark.parametrize(
    ('cutoffs', 'expected'),
    [
        ([], 0.0),
        ([4.0], RISE_PERIODS / 4.0),
        ([2.0, 8.0], RISE_PERIODS / 8.0),
        ([0.0], 0.0),
        ([np.nan, -1.0], 0.0),
    ],
)
def test_rise_time(cutoffs: list[float], expected: float) -> None:
    """Of several cut-offs that of the highest, which changes friction least."""
    _, dataset = recording(0, [])
    sources = [{'preprocessing': {'cutoff_hz': cutoff}} for cutoff in cutoffs]
    assert rise_time(replace(dataset, provenance={'sources': sources})) == expected
