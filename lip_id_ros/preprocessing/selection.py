"""Fewer samples out of many."""

from __future__ import annotations

import dataclasses

import numpy as np

from lip_id_ros.config import PreprocessingSettings
from lip_id_ros.dataset import Dataset
from lip_id_ros.preprocessing.filters import is_filtered

SAMPLES_PER_PERIOD = 4


def stride(rate_hz: float, settings: PreprocessingSettings) -> int:
    """
    Return k where every k-th sample is kept.

    Errors of low-passed samples are correlated: kept at the full rate, they would pass for many
    independent measurements, and the fit would trust them too much.

    Parameters
    ----------
    rate_hz : float
        Of the recording.
    settings : PreprocessingSettings
        A `decimate` above 0 is taken as it is.

    """
    if settings.decimate > 0:
        return settings.decimate
    if not is_filtered(rate_hz, settings.cutoff_hz):
        return 1
    return max(1, int(rate_hz / (SAMPLES_PER_PERIOD * settings.cutoff_hz)))


def at_most(data: Dataset, max_samples: int) -> Dataset:
    """
    Return at most so many samples, evenly spread in time and noted in the provenance.

    Parameters
    ----------
    data : Dataset
        Any.
    max_samples : int
        0 for all.

    """
    if not 0 < max_samples < data.n_samples:
        return data
    rows = np.linspace(0, data.n_samples - 1, max_samples).round().astype(np.intp)
    note = {'selected': {'samples': max_samples, 'of': data.n_samples}}
    return dataclasses.replace(data.select(rows), provenance={**data.provenance, **note})
