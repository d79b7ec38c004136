"""The response of the low-pass that measured torques went through (maths.md, section 12)."""

from __future__ import annotations

from lip_id_ros.dataset import cutoffs_hz, Dataset

RISE_PERIODS = 0.194
"""
Rise time of the low-pass of preprocessing in periods of its cut-off: the one for which
tanh(t / rise_time) is nearest to its response to a step from -1 to 1.
"""


def rise_time(dataset: Dataset) -> float:
    """Return the rise time of the low-pass of a data set [s]; 0 where none is known."""
    known = [cutoff for cutoff in cutoffs_hz(dataset.provenance) if cutoff and cutoff > 0.0]
    return RISE_PERIODS / max(known) if known else 0.0
