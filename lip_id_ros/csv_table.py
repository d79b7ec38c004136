"""
Tables of numbers in CSV files: a line of names, then lines of numbers, no empty cells.

Cells are separated by commas, or else by semicolons, tabs or blanks; decimal commas are read then.
Lines that begin with # or % are left out; the last one before the numbers may have the names.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
import csv
import os
import re
from typing import NamedTuple
import warnings

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.errors import DataError, missing_joints
from lip_id_ros.files import require_regular_file

CSV_SUFFIX = '.csv'

_DELIMITERS = (',', ';', '\t', ' ')
_COMMENT = ('#', '%')
_MOST_COLUMNS = 20_000
_SHOWN, _LONGEST = 12, 40
_NAMELESS = ('q_', 'dq_', 'tau_')

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


class _Header(NamedTuple):
    """Names of the columns, number of their line, what separates them, and ends every line."""

    names: tuple[str, ...]
    line: int
    delimiter: str
    is_ended: bool


def _header(path: PathLike) -> _Header:
    require_regular_file(path)
    try:
        with open(path, encoding='utf-8-sig') as file:
            line, text = _line_of_names(file)
        separating = (each for each in _DELIMITERS if len(_names(text, each)) > 1)
        delimiter = next(separating, _DELIMITERS[0])
        names = _names(text, delimiter)
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataError(_no_text(path, error)) from error
    if not any(names) or not all(names[1:]) or any(_is_number(name) for name in names):
        raise DataError(
            f'the first line of {os.fspath(path)} must name the columns, such as t,q_shoulder,'
            f'tau_shoulder, but is {",".join(names[:_SHOWN])[:80]!r}; add such a line.'
        )
    if nameless := [name for name in names if name in _NAMELESS]:
        raise DataError(
            f'a column {nameless[0]!r} of {os.fspath(path)} must end in the name of its joint, '
            'but has none; name it.'
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
    return _Header(names, line, delimiter, text.rstrip(' \r\n').endswith(delimiter))


def _line_of_names(file: Iterable[str]) -> tuple[int, str]:
    """Return number and text of the first line that is no comment, or of a comment before it."""
    comment = (1, '')
    for number, text in enumerate(file, start=1):
        if text.startswith(_COMMENT):
            comment = number, text.lstrip(''.join(_COMMENT))
        elif text.strip():
            cell = re.split(r'[;,\s]', text.strip())[0]
            return comment if comment[1] and _is_number(cell) else (number, text)
    return comment


def _names(text: str, delimiter: str) -> tuple[str, ...]:
    """Return the names in a line, without what follows a last delimiter."""
    cells = text.split() if delimiter == ' ' else next(csv.reader([text], delimiter=delimiter), [])
    names = [cell.strip() for cell in cells]
    return tuple(names[:-1] if names[-1:] == [''] else names)


def read_table(path: PathLike) -> CsvTable:
    """
    Read every column.

    A last line that was cut short is left out, and noted.

    OSError if the file cannot be opened; SourceError if it is not a regular file; DataError if it
    has no header, no rows, a first column without a name that does not number the rows, or a cell
    that is no number; names the line.
    """
    header = _header(path)
    rows = _numbers(path, header, None)
    notes: tuple[str, ...] = ()
    if rows is None:
        last = _only_last_line_wrong(path, header)
        rows = _numbers(path, header, last)
        notes = (f'line {last}, the last one, was cut short and left out',)
    if rows is None or rows.size == 0:
        raise DataError(f'{os.fspath(path)} must hold rows of numbers, but has none; record some.')
    columns = dict(zip(header.names, rows.T, strict=True))
    index = columns.pop('', np.zeros(0))
    steps = np.diff(index)  # of tables that lost rows or were joined, some are not 1
    if np.any(index % 1.0) or (steps.size and np.median(steps) < 1.0):
        raise DataError(
            f'the first column of {os.fspath(path)} must have a name or number the rows, but has '
            f'no name and begins with {", ".join(f"{each:.4g}" for each in index[:3])}; name it.'
        )
    return CsvTable(columns, notes)


def joints_of(names: Sequence[str]) -> tuple[str, ...]:
    """Return the joints of which there is a position, in the order of the columns."""
    return tuple(name[2:] for name in names if re.match(r'q_.', name))


def check_columns(path: PathLike, table: CsvTable, wanted: Sequence[str]) -> None:
    """Raise a DataError that names the first column that is missing."""
    missing = [name for name in wanted if name not in table.columns]
    known = joints_of([*table.columns])
    if known and missing and (absent := joints_of(missing)) and len(absent) == len(missing):
        raise DataError(missing_joints(absent, os.fspath(path), known[:_SHOWN]))
    if len(wanted) == 1 or missing:
        present = [*table.columns][:_SHOWN]
        more, first = len(table.columns) - len(present), (missing or ['q_NAME'])[0]
        raise DataError(
            f'{os.fspath(path)} must have the columns t, q_NAME, tau_NAME of every joint NAME '
            f'(and dq_NAME where known), in s, rad and N m, but {first} is missing '
            f'beside {", ".join(present)}{f" and {more} more" if more else ""}; name the columns '
            'so.'
        )


def check_efforts(path: PathLike, table: CsvTable, joints: Sequence[str]) -> None:
    """Raise a DataError where efforts are absent, but columns of other names may be these."""
    signals = ('q', 'dq', 'tau')
    read = {'t', *(f'{signal}_{joint}' for signal in signals for joint in joints)}
    others = [name[:_LONGEST] for name in table.columns if name not in read]
    if others and not any(f'tau_{joint}' in table.columns for joint in joints):
        raise DataError(
            f'{os.fspath(path)} must have tau_{joints[0]} [N m] beside q_{joints[0]} [rad], but '
            f'has {", ".join(others[:_SHOWN])}; name the columns by the joints, in these units.'
        )


def quoted(name: str) -> str:
    """Return the name of a column as a header line needs it."""
    return '"' + name.replace('"', '""') + '"' if re.search(r'[",\s]', name) else name


def _numbers(path: PathLike, header: _Header, before: int | None) -> Array | None:
    """Read the rows above a line; None where a cell or a row is wrong."""
    try:
        with warnings.catch_warnings(category=UserWarning, action='ignore'):  # no rows
            lines = (text for _, text in _lines(path, header, before))
            rows = np.loadtxt(lines, delimiter=',', ndmin=2, comments=None, quotechar='"')
    except UnicodeDecodeError as error:
        raise DataError(_no_text(path, error)) from error
    except ValueError:
        return None
    return None if rows.size and rows.shape[1] != len(header.names) else rows


def _lines(
    path: PathLike, header: _Header, before: int | None = None
) -> Iterator[tuple[int, str]]:
    """Yield number and text of the lines of numbers, with commas between these only."""
    with open(path, encoding='utf-8-sig') as file:
        for number, text in enumerate(file, start=1):
            if number == before:
                return
            if number > header.line and text.strip() and not text.startswith(_COMMENT):
                yield number, _with_commas(text, header)


def _with_commas(text: str, header: _Header) -> str:
    """Return a line of numbers with decimal points, and commas between the numbers only."""
    if header.delimiter == ' ':
        text = ' '.join(text.split()) + '\n' * text.endswith('\n')
    if header.delimiter != ',':
        text = text.replace(',', '.').replace(header.delimiter, ',')
    return re.sub(r', *$', '', text) if header.is_ended else text


def _only_last_line_wrong(path: PathLike, header: _Header) -> int:
    """Return the number of the last line; DataError where another one is wrong too."""
    number, wrong = header.line, ''
    for following, text in _lines(path, header):
        if wrong:
            raise DataError(wrong)
        number = following
        wrong = _fault(path, number, text, header.names)
    is_cut = not text.endswith('\n')
    if not wrong or not is_cut or number == header.line + 1:
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
                f'{shown!r}; correct it, or leave out the line or the column.'
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
        return text.isascii() and '_' not in text  # float reads more than numpy does
    return False
