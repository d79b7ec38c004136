"""Fewer samples out of many."""

from __future__ import annotations

import dataclasses

import numpy as np

from lip_id_ros.dataset import Dataset


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
