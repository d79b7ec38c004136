"""Statistics of the samples of a recording, of any number, in the memory of a few."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lip_id_ros.arrays import IndexArray
from lip_id_ros.dataset import Dataset
from lip_id_ros.identification.factor_sum import FactorSum
from lip_id_ros.identification.joint_rows import JointRows
from lip_id_ros.identification.linearisation import Linearisation, Samples
from lip_id_ros.identification.statistics import TorqueStatistics

CHUNK = 400
"""Samples whose features are in memory at one time."""


class Gathering:
    """Statistics that grow by samples, whose features are in memory together."""

    def __init__(self, around: Linearisation) -> None:
        self._around = around
        self._columns = [np.concatenate(own) for own in around.columns]
        self._sums = [FactorSum(column.size + 1) for column in self._columns]
        self._count = 0

    def add(self, samples: Samples) -> None:
        """Add samples."""
        parts, target = self._around.parts(samples)
        root = np.sqrt(self._around.noise.weights(samples.dq))
        for joint, (column, of_joint) in enumerate(zip(self._columns, self._sums, strict=True)):
            of_joint.add(JointRows(parts, joint, column, target, root), len(target))
        self._count += len(target)

    def statistics(self) -> TorqueStatistics:
        """Return the statistics of all samples."""
        factors = tuple(each.factor() for each in self._sums)
        counts = np.full(len(factors), float(self._count))
        return TorqueStatistics(tuple(self._columns), factors, counts)


def statistics_of(dataset: Dataset, rows: IndexArray, around: Linearisation) -> TorqueStatistics:
    """Return the statistics of some samples of a data set."""
    gathered = Gathering(around)
    for chunk in _chunks(rows):
        gathered.add(Samples.of(dataset, chunk))
    return gathered.statistics()


def _chunks(rows: IndexArray) -> Iterator[IndexArray]:
    """Yield rows that are in memory together: first some of the whole recording."""
    count = -(-rows.size // CHUNK)
    if count > 2:
        yield rows[::count]
        rows = rows[np.arange(rows.size) % count != 0]
    if count:
        yield from np.array_split(rows, -(-rows.size // CHUNK))
