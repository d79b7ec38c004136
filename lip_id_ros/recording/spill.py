"""
Arrays that may exceed the memory: large ones lie in temporary files.

A mapped file counts as memory of the process as long as its pages are mapped. So large arrays are
read and written in blocks of rows, and the pages of each block are released.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import mmap
import os
import tempfile
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from lip_id_ros.arrays import Array, BoolArray, IndexArray

LARGE_BYTES = 32 * 2**20
"""Arrays beyond this size lie in a temporary file."""
BLOCK_ROWS = 65_536


def row_blocks(size: int) -> Iterator[slice]:
    """Yield slices that cover `size` rows, `BLOCK_ROWS` at a time."""
    for start in range(0, size, BLOCK_ROWS):
        yield slice(start, min(start + BLOCK_ROWS, size))


def large_array(*shape: int, dtype: DTypeLike = np.float64) -> NDArray[Any]:
    """Return a column-major array to fill; OSError if the temporary folder has no room for it."""
    size = np.dtype(dtype).itemsize * int(np.prod(shape))
    if size <= LARGE_BYTES:
        return np.empty(shape, dtype, order='F')
    with tempfile.TemporaryFile(prefix='lip_id_') as file:
        _reserve(file.fileno(), size)
        return np.memmap(file, dtype, 'r+', shape=shape, order='F')


def _reserve(descriptor: int, size: int) -> None:
    """Give a file its size; where the system can, a full disk is an error here, not a signal."""
    if hasattr(os, 'posix_fallocate'):
        os.posix_fallocate(descriptor, 0, size)
    else:
        os.ftruncate(descriptor, size)


def release(*arrays: NDArray[Any]) -> None:
    """Give the memory of mapped pages back; the arrays keep their values."""
    for array in arrays:
        base: Any = array
        while isinstance(base, np.ndarray):
            base = base.base
        if isinstance(base, mmap.mmap):
            base.madvise(mmap.MADV_DONTNEED)


def mapped(function: Callable[..., NDArray[Any]], *arrays: NDArray[Any]) -> NDArray[Any]:
    """Return a function of arrays of equal length, which treats each row by itself."""
    size, nothing = len(arrays[0]), function(*(array[:0] for array in arrays))
    result = large_array(size, *nothing.shape[1:], dtype=nothing.dtype)
    for rows in row_blocks(size):
        result[rows] = function(*(array[rows] for array in arrays))
        release(result, *arrays)
    return result


def row_numbers(size: int) -> IndexArray:
    """Return 0, 1, 2, ... up to `size`."""
    result = large_array(size, dtype=np.intp)
    for rows in row_blocks(size):
        result[rows] = np.arange(rows.start, rows.stop)
        release(result)
    return result


def marked(condition: Callable[[NDArray[Any]], BoolArray], values: NDArray[Any]) -> BoolArray:
    """Return which rows satisfy a condition, shape (N,)."""
    return mapped(condition, values)


def gathered(values: NDArray[Any], rows: IndexArray) -> NDArray[Any]:
    """Return rows of an array, in any order."""

    def taken(numbers: IndexArray) -> NDArray[Any]:
        some = values[numbers]
        release(values)
        return some

    return mapped(taken, rows)


def steps(values: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Yield the differences of successive values of shape (N,), block by block."""
    for rows in row_blocks(len(values) - 1):
        yield np.diff(values[rows.start : rows.stop + 1])
        release(values)


def some_blocks(size: int, most: int, count: int) -> list[slice]:
    """Return all rows, or of more than `most` so many blocks from the beginning to the end."""
    if size <= most:
        return [slice(0, size)]
    length = most // count
    starts = np.linspace(0, size - length, count).astype(int).tolist()
    return [slice(start, start + length) for start in starts]


def extent(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the least and the largest value of each column; there is at least one row."""
    ends = []
    for rows in row_blocks(len(values)):
        ends.append((values[rows].min(axis=0), values[rows].max(axis=0)))
        release(values)
    least, largest = zip(*ends, strict=True)
    return np.min(least, axis=0), np.max(largest, axis=0)


def thinned(values: Array, most: int) -> Array:
    """Return every k-th value of shape (N,), fewer than 2 `most` of them."""
    every = max(1, len(values) // most)
    if every == 1:
        return values
    pieces = []
    for rows in row_blocks(len(values)):
        pieces.append(values[rows][-rows.start % every :: every].copy())
        release(values)
    return np.concatenate(pieces)
