"""
Square-root statistics of one recording, for block angular least squares (maths.md, 14).

The first rows of each factor have the friction of this recording in them; the rest adds up over
recordings (Björck, Numerical Methods for Least Squares Problems, 1996, 6.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.folds import recurrent_folds
from lip_id_ros.identification.linearisation import Linearisation
from lip_id_ros.identification.statistics import TorqueStatistics
from lip_id_ros.packable import Packable

CHUNK = 1000
"""Samples whose features are in memory at one time."""


@dataclass(frozen=True, eq=False)
class RecordingFactors(Packable):
    """
    Statistics of the B blocks of a recording.

    Triangles are the upper ones of the joints' factors, row by row.
    """

    KIND = 'statistics'
    triangles: Array  # (B, sum of (k_i + p_i + 1) (k_i + p_i + 2) / 2)
    counts: Array  # (B, n)


def gather(
    dataset: Dataset, around: Linearisation, blocks: int = 1, kept: BoolArray | None = None
) -> RecordingFactors:
    """
    Gather the statistics of the samples of a recording that are kept.

    Blocks are of motions with their repetitions, at most so many.
    """
    rows = np.arange(dataset.n_samples) if kept is None else np.flatnonzero(kept)
    number = recurrent_folds(dataset.select(rows), blocks) if rows.size else rows
    count = int(number.max()) + 1 if number.size else 1
    found = [_statistics(dataset, rows[number == k], around) for k in range(count)]
    return RecordingFactors(
        np.array([packed(each.factors) for each in found]),
        np.array([each.counts for each in found]),
    )


def _statistics(dataset: Dataset, rows: IndexArray, around: Linearisation) -> TorqueStatistics:
    statistics = empty_statistics(around)
    for chunk in np.array_split(rows, -(-rows.size // CHUNK)) if rows.size else []:
        statistics = updated(statistics, dataset.select(chunk), around)
    return statistics


def empty_statistics(around: Linearisation) -> TorqueStatistics:
    """Return the statistics of no samples."""
    return TorqueStatistics.empty([np.concatenate(own) for own in around.columns])


def updated(
    statistics: TorqueStatistics, dataset: Dataset, around: Linearisation
) -> TorqueStatistics:
    """Return statistics with further samples, whose features are in memory together."""
    features, target = around.rows(dataset)
    return statistics.update(features, target, around.noise.weights(dataset.dq))


def packed(factors: Sequence[Array]) -> Array:
    """Return the upper triangles of the joints' factors, one after another."""
    return np.concatenate([factor[np.triu_indices(len(factor))] for factor in factors])


def unpacked(triangles: Array, around: Linearisation, joint: int) -> Array:
    """Return the factors of a joint, (..., s, s), of triangles of all joints."""
    sizes = [own.size + others.size + 1 for own, others in around.columns]
    lengths = [size * (size + 1) // 2 for size in sizes]
    at, size = sum(lengths[:joint]), sizes[joint]
    factor = np.zeros((*triangles.shape[:-1], size, size))
    factor[..., *np.triu_indices(size)] = triangles[..., at : at + lengths[joint]]
    return factor
