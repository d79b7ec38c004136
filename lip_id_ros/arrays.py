"""Types of numpy arrays, whose shapes and units stand in docstrings, and runs of marks."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


def runs(marks: BoolArray) -> tuple[IndexArray, IndexArray]:
    """Return where runs of true marks, shape (N,), begin, and the rows after their ends."""
    edges = np.flatnonzero(np.diff(marks, prepend=False, append=False))
    return edges[::2], edges[1::2]
