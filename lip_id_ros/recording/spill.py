"""
Arrays of any length in little memory: what is large lies in temporary files.

A mapped file counts as memory of the process as long as its pages are mapped. So whoever goes
through a large array does it in blocks of rows and releases the pages behind.

"""

from __future__ import annotations

from collections.abc import Iterator
import mmap
import os
import tempfile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import Array

LARGE_BYTES = 64 * 2**20
"""Arrays beyond this size lie in a temporary file."""
BLOCK_ROWS = 65_536

_FIRST_ROWS = 1024


def row_blocks(size: int) -> Iterator[slice]:
    """Yield slices that cover `size` rows, `BLOCK_ROWS` at a time."""
    for start in range(0, size, BLOCK_ROWS):
        yield slice(start, min(start + BLOCK_ROWS, size))


def column_array(rows: int, width: int) -> Array:
    """
    Return an array of shape (rows, width) to be filled, column-major.

    Raises
    ------
    OSError
        If the temporary folder has no room for it.

    """
    size = 8 * rows * width
    if size <= LARGE_BYTES:
        return np.empty((rows, width), order='F')
    with tempfile.TemporaryFile(prefix='lip_id_') as file:
        _reserve(file.fileno(), size)
        return np.memmap(file, np.float64, 'r+', shape=(rows, width), order='F')


def _reserve(descriptor: int, size: int) -> None:
    """Give a file its size; where the system can, a full disk is an error here, not a signal."""
    if hasattr(os, 'posix_fallocate'):
        os.posix_fallocate(descriptor, 0, size)
    else:
        os.ftruncate(descriptor, size)


def release(*arrays: NDArray[Any]) -> None:
    """Give the memory of mapped pages back; the arrays stay what they are."""
    for array in arrays:
        base: Any = array
        while isinstance(base, np.ndarray):
            base = base.base
        if isinstance(base, mmap.mmap):
            base.madvise(mmap.MADV_DONTNEED)


class RowStore:
    """Rows of float64 that grow at their end, in a temporary file once they are many."""

    def __init__(self, width: int) -> None:
        self._width = width
        self._array = np.empty((_FIRST_ROWS, width))
        self._size = 0
        self._file: Any = None

    def extend(self, rows: Array) -> None:
        """
        Append rows.

        Raises
        ------
        OSError
            If the temporary folder has no room for them.

        """
        needed = self._size + len(rows)
        if self._file is None and 8 * needed * self._width > LARGE_BYTES:
            self._file = tempfile.TemporaryFile(prefix='lip_id_')  # noqa: SIM115  values() closes
            self._array[: self._size].tofile(self._file)
            self._array = np.empty((0, self._width))
        if self._file is not None:
            np.ascontiguousarray(rows).tofile(self._file)
        else:
            if needed > len(self._array):
                self._array = grown(self._array, needed)
            self._array[self._size : needed] = rows
        self._size = needed

    def values(self) -> Array:
        """Return the rows, without a copy; nothing may be appended any more."""
        if self._file is None:
            return self._array[: self._size]
        with self._file as file:
            file.flush()
            return np.memmap(file, np.float64, 'r', shape=(self._size, self._width))


def grown(array: NDArray[Any], needed: int) -> NDArray[Any]:
    """Return an array with room for `needed` rows, and more, so that growth stays linear."""
    capacity = max(needed, 3 * len(array) // 2)
    array.resize((capacity, *array.shape[1:]), refcheck=False)  # no view of it exists
    return array
