"""Types of numpy arrays, whose shapes and units stand in docstrings; hashes, runs of marks."""

from __future__ import annotations

from collections.abc import Mapping
import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]
Rows = IndexArray | slice

EVERY = slice(None)
"""All rows."""


def digest(arrays: Mapping[str, NDArray[Any]], *texts: str) -> str:
    """Return a hash of named arrays, with their types and shapes, and of texts."""
    found = hashlib.sha256('\0'.join(texts).encode())
    for name in sorted(arrays):
        values = np.ascontiguousarray(arrays[name])
        found.update(repr((name, values.dtype.str, values.shape)).encode())
        found.update(values.tobytes())
    return found.hexdigest()


def runs(marks: BoolArray) -> tuple[IndexArray, IndexArray]:
    """Return where runs of true marks, shape (N,), begin, and the rows after their ends."""
    edges = np.flatnonzero(np.diff(marks, prepend=False, append=False))
    return edges[::2], edges[1::2]
