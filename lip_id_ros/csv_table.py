"""Tables of numbers in CSV files: one header line, commas, no empty cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
import csv
import os
import re
from typing import NamedTuple
import warnings

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError
from lip_id_ros.files import require_regular_file

CSV_SUFFIX = '.csv'

_MOST_COLUMNS = 20_000
_SHOWN = 12

PathLike = str | os.PathLike[str]


class CsvTable(NamedTuple):
    """Columns of numbers (N,) by name; notes, a phrase each, on what was left out of the file."""

    columns: dict[str, Array]
    notes: tuple[str, ...] = ()

    @property
    def n_rows(self) -> int:
        """Number of rows N."""
        return len(next(iter(self.columns.values())))

    def per_joint(self, signal: str, joints: Sequence[str]) -> Array:
        """Return the columns of a signal, shape (N, n)."""
        return np.column_stack([self.columns[f'{signal}_{joint}'] for joint in joints])


def read_header(path: PathLike) -> tuple[str, ...]:
    """
    Read the names of the columns.

    Raises
    ------
    OSError
        If the file cannot be opened.
    SourceError
        If it is not a regular file.
    DataError
        If its first line names no columns, or a name twice.

    """
    require_regular_file(path)
    try:
        with open(path, encoding='utf-8-sig', newline='') as file:
            names = tuple(name.strip() for name in next(csv.reader(file), []))
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(_no_text(path, error)) from error
    if not names or not all(names) or any(_is_number(name) for name in names):
        raise DataError(
            f'the first line of {os.fspath(path)} must name the columns, such as t,q_shoulder,'
            f'tau_shoulder, but is {",".join(names[:_SHOWN])[:80]!r}; add such a line.'
        )
    if len(names) > _MOST_COLUMNS:
        raise DataError(
            f'{os.fspath(path)} must have at most {_MOST_COLUMNS} columns, not {len(names)}; '
            'export only those of the arm.'
        )
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise DataError(
            f'the columns of {os.fspath(path)} must have different names, but {name!r} comes '
            f'{count} times; rename one of them.'
        )
    return names


def read_table(path: PathLike) -> CsvTable:
    """
    Read every column.

    A last line that was cut short is left out, and noted.

    Raises
    ------
    OSError
        If the file cannot be opened.
    SourceError
        If it is not a regular file.
    DataError
        If it has no header, no rows, or a cell that is no number; names the line.

    """
    names = read_header(path)
    rows = _numbers(path, len(names), None)
    notes: tuple[str, ...] = ()
    if rows is None:
        last = _only_last_line_wrong(path, names)
        rows = _numbers(path, len(names), last)
        notes = (f'line {last}, the last one, was cut short and left out',)
    if rows is None or rows.size == 0:
        raise DataError(f'{os.fspath(path)} must hold rows of numbers, but has none; record some.')
    return CsvTable(dict(zip(names, rows.T, strict=True)), notes)


def joints_of(names: Sequence[str]) -> tuple[str, ...]:
    """Return the joints of which there is a position, in the order of the columns."""
    return tuple(name[2:] for name in names if re.match(r'q_.', name))


def has_accelerations(path: PathLike) -> bool:
    """Whether a CSV file is a data set, and not a log; see `read_header` for the errors."""
    return any(re.match(r'ddq_.', name) for name in read_header(path))


def check_columns(path: PathLike, table: CsvTable, wanted: Sequence[str]) -> None:
    """Raise a DataError that names the first column that is missing."""
    missing = [name for name in wanted if name not in table.columns]
    if len(wanted) == 1 or missing:
        present = [*table.columns][:_SHOWN]
        more = len(table.columns) - len(present)
        raise DataError(
            f'{os.fspath(path)} must have the columns t, q_NAME, tau_NAME of every joint NAME '
            f'(and dq_NAME, ddq_NAME where known), but {(missing or ["q_NAME"])[0]} is missing '
            f'beside {", ".join(present)}{f" and {more} more" if more else ""}; name the columns '
            'so.'
        )


def quoted(name: str) -> str:
    """Return the name of a column as a header line needs it."""
    return '"' + name.replace('"', '""') + '"' if re.search(r'[",\s]', name) else name


def _numbers(path: PathLike, width: int, before: int | None) -> Array | None:
    """Read the rows above a line; None where a cell or a row is wrong."""
    try:
        with warnings.catch_warnings(category=UserWarning, action='ignore'):  # no rows
            lines = (text for _, text in _lines(path, before))
            rows = np.loadtxt(lines, delimiter=',', ndmin=2, comments=None, quotechar='"')
    except UnicodeDecodeError as error:
        raise DataError(_no_text(path, error)) from error
    except ValueError:
        return None
    return None if rows.size and rows.shape[1] != width else rows


def _lines(path: PathLike, before: int | None = None) -> Iterator[tuple[int, str]]:
    """Yield number and text of the lines that are not empty, without the first."""
    with open(path, encoding='utf-8-sig') as file:
        for number, text in enumerate(file, start=1):
            if number == before:
                return
            if number > 1 and text.strip():
                yield number, text


def _only_last_line_wrong(path: PathLike, names: tuple[str, ...]) -> int:
    """Return the number of the last line; DataError where another one is wrong too."""
    number, wrong = 1, ''
    for following, text in _lines(path):
        if wrong:
            raise DataError(wrong)
        number = following
        wrong = _fault(path, number, text, names)
    is_cut = not text.endswith('\n')
    if not wrong or not is_cut or number == 2:
        raise DataError(
            wrong or f'{os.fspath(path)} must hold numbers separated by commas; export it.'
        )
    return number


def _fault(path: PathLike, number: int, text: str, names: tuple[str, ...]) -> str:
    """Return what is wrong with a line, empty where nothing is."""
    cells = [cell.strip().strip('"') for cell in text.rstrip('\r\n').split(',')]
    if len(cells) != len(names):
        return (
            f'line {number} of {os.fspath(path)} must have {len(names)} cells as the first line, '
            f'but has {len(cells)}; correct it or leave it out.'
        )
    for name, cell in zip(names, cells, strict=True):
        if not _is_number(cell):
            shown = cell if len(cell) <= 80 else f'{cell[:80]}...'
            return (
                f'{name} in line {number} of {os.fspath(path)} must be a number, not '
                f'{shown!r}; correct it or leave the line out.'
            )
    return ''


def _no_text(path: PathLike, error: Exception) -> str:
    return (
        f'{os.fspath(path)} must be a text of numbers and commas, but is not ({error}); '
        'export it as CSV.'
    )


def _is_number(text: str) -> bool:
    with suppress(ValueError):
        float(text)
        return True
    return False
