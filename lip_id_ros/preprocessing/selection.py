"""Fewer samples out of many."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import dataclasses

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.preprocessing.smoothing import is_filtered
from lip_id_ros.settings import PreprocessingSettings

SAMPLES_PER_PERIOD = 4
LEAST_LEFT = 0.25

MIN_VELOCITY = {'articulated': 0.0}
OTHER_MIN_VELOCITY = 0.05
"""By the kernel of the fit, where `min_velocity` is negative."""


def stride(rate_hz: float, settings: PreprocessingSettings) -> int:
    """
    Return k where every k-th sample of a recording is kept.

    Errors of low-passed samples are correlated: kept at the full rate, they would pass for many
    independent measurements, and the fit would trust them too much.

    """
    if settings.decimate > 0:
        return settings.decimate
    if not is_filtered(rate_hz, settings.cutoff):
        return 1
    return max(1, int(rate_hz / (SAMPLES_PER_PERIOD * settings.cutoff)))


def for_training(data: Dataset, settings: PreprocessingSettings, kernel: str) -> Dataset:
    """
    Leave out the samples at which a joint is nearly at rest; noted in the provenance.

    Near rest friction is anything between its two signs, and the sign of a small velocity is that
    of its noise. A model is judged there all the same, so that this is for training only. Where
    `min_velocity` would leave less than a quarter of the samples, as where joints are moved one
    after another, all are kept. The noise of an arm (`fit.kernel`) grows near rest, so that none
    need be left out for it.

    """
    share = settings.min_velocity
    if share < 0.0:
        share = MIN_VELOCITY.get(kernel, OTHER_MIN_VELOCITY)
    rows = moving(data.dq, share)
    left = int(rows.sum())
    if left == data.n_samples or left < LEAST_LEFT * data.n_samples:
        return data
    note = {'moving': {'samples': left, 'of': data.n_samples}}
    return dataclasses.replace(data.select(rows), provenance={**data.provenance, **note})


def moving(dq: Array, min_velocity: float) -> BoolArray:
    """
    Mark samples at which no joint is nearly at rest, shape (N,).

    A joint is, below a share of its root mean square velocity; one that never moves is not asked.

    """
    threshold = min_velocity * np.sqrt(np.mean(np.square(dq), axis=0))
    fast: BoolArray = (np.abs(dq) >= threshold).all(axis=1)
    return fast


def at_most(data: Dataset, settings: PreprocessingSettings) -> Dataset:
    """Return at most `max_samples` samples, chosen by `selection`; noted in the provenance."""
    count = settings.max_samples
    if not 0 < count < data.n_samples:
        return data
    chosen = data.select(SELECTIONS[settings.selection](data, count))
    note = {'selected': {'samples': chosen.n_samples, 'of': data.n_samples}}
    return dataclasses.replace(chosen, provenance={**data.provenance, **note})


def evenly_in_time(data: Dataset, count: int) -> IndexArray:
    """Return row numbers at even distances, the first and the last among them."""
    return np.linspace(0, data.n_samples - 1, count).round().astype(np.intp)


SELECTIONS: Mapping[str, Callable[[Dataset, int], IndexArray]] = {
    'coverage': Dataset.covering,
    'time': evenly_in_time,
}
"""By the name that `preprocessing.selection` has for them."""
