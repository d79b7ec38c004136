"""The data that every method gets: one training set and the unseen motions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import hashlib
import os

import numpy as np

from lip_id_ros.dataset import Dataset

SIGNALS = ('q', 'dq', 'ddq', 'tau', 'tau_noiseless', 'kinetic', 'potential')


@dataclass(frozen=True)
class Case:
    """
    One training set and the motions on which its models are evaluated.

    Attributes
    ----------
    name : str
        Unique among the cases that are compared together.
    group : str
        Cases of one group make one table and one box plot.
    train : Dataset
    tests : mapping from str to Dataset
        Unseen motions by name, with the joints of `train` in its order.
    urdf : path, optional
        Robot description, for methods that need one.

    """

    name: str
    group: str
    train: Dataset
    tests: Mapping[str, Dataset]
    urdf: str | os.PathLike[str] | None = None

    def fingerprint(self) -> str:
        """Return a digest of all numbers of the data."""
        digest = hashlib.sha256()
        for data in (self.train, *self.tests.values()):
            for name in SIGNALS:
                values = getattr(data, name)
                digest.update(b'-' if values is None else np.ascontiguousarray(values).tobytes())
        digest.update(repr((self.name, self.group, list(self.tests))).encode())
        if self.urdf is not None:
            with open(self.urdf, 'rb') as file:
                digest.update(file.read())
        return digest.hexdigest()


def thinned(dataset: Dataset, count: int) -> Dataset:
    """Return `count` evenly spaced samples, or all where there are fewer."""
    if count >= dataset.n_samples:
        return dataset
    return dataset.select(np.linspace(0, dataset.n_samples - 1, count).round().astype(np.int64))
