"""Tables of numbers in CSV files: one header line, commas, no empty cells."""

from __future__ import annotations

from collections.abc import Mapping
import csv
import os
import warnings

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError

PathLike = str | os.PathLike[str]


def read_header(path: PathLike) -> tuple[str, ...]:
    """
    Read the names of the columns.

    Raises
    ------
    OSError
        If the file cannot be opened.
    DataError
        If its first line names no columns, or a name twice.

    """
    try:
        with open(path, encoding='utf-8-sig', newline='') as file:
            names = tuple(name.strip() for name in next(csv.reader(file), []))
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(
            f'{os.fspath(path)} must be a text of numbers and commas, but is not ({error}); '
            'export it as CSV.'
        ) from error
    if not names or not all(names) or any(_is_number(name) for name in names):
        raise DataError(
            f'the first line of {os.fspath(path)} must name the columns, such as t,q_shoulder,'
            f'tau_shoulder, but is {",".join(names)[:80]!r}; add such a line.'
        )
    for name in names:
        if names.count(name) > 1:
            raise DataError(
                f'the columns of {os.fspath(path)} must have different names, but {name!r} comes '
                f'{names.count(name)} times; rename one of them.'
            )
    return names


def read_table(path: PathLike) -> Mapping[str, Array]:
    """
    Read every column, each of shape (N,), by its name.

    Raises
    ------
    OSError
        If the file cannot be opened.
    DataError
        If it has no header, no rows, or a cell that is no number; names the line.

    """
    names = read_header(path)
    try:
        with open(path, encoding='utf-8-sig') as file:
            next(file)
            lines = (line for line in file if line.strip())
            with warnings.catch_warnings(category=UserWarning, action='ignore'):  # no rows
                rows = np.loadtxt(lines, delimiter=',', ndmin=2, comments=None, quotechar='"')
    except UnicodeDecodeError as error:
        raise DataError(
            f'{os.fspath(path)} must be a text of numbers and commas, but is not ({error}); '
            'export it as CSV.'
        ) from error
    except ValueError as error:
        raise DataError(_wrong_row(path, names)) from error
    if rows.size == 0:
        raise DataError(f'{os.fspath(path)} must hold rows of numbers, but has none; record some.')
    if rows.shape[1] != len(names):
        raise DataError(_wrong_row(path, names))
    return dict(zip(names, rows.T, strict=True))


def _wrong_row(path: PathLike, names: tuple[str, ...]) -> str:
    with open(path, encoding='utf-8-sig', newline='') as file:
        for number, cells in enumerate(csv.reader(file), start=1):
            if number == 1 or not any(cell.strip() for cell in cells):
                continue
            if len(cells) != len(names):
                return (
                    f'line {number} of {os.fspath(path)} must have {len(names)} cells as the '
                    f'first line, but has {len(cells)}; correct it or leave it out.'
                )
            for name, cell in zip(names, cells, strict=True):
                if not _is_number(cell):
                    return (
                        f'{name} in line {number} of {os.fspath(path)} must be a number, not '
                        f'{cell!r}; correct it or leave the line out.'
                    )
    return f'{os.fspath(path)} must hold numbers separated by commas; export it again.'


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
