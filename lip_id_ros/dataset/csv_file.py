"""Data sets as CSV files: t, segment, then q_, dq_, ddq_ and tau_ of every joint."""

from __future__ import annotations

from collections.abc import Sequence
import os
import re
from typing import Any, BinaryIO

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.dataset.csv_table import PathLike, read_header, read_table
from lip_id_ros.dataset.dataset import Dataset
from lip_id_ros.errors import DataError
from lip_id_ros.files import write_atomically

CSV_SUFFIX = '.csv'

_SIGNALS = ('q', 'dq', 'ddq', 'tau')
_TRUTH = ('kinetic', 'potential')


def joints_of(names: Sequence[str]) -> tuple[str, ...]:
    """Return the joints of which there is a position, in the order of the columns."""
    return tuple(name[2:] for name in names if re.match(r'q_.', name))


def has_accelerations(path: PathLike) -> bool:
    """
    Whether a CSV file is a data set, and not a log that is still to be prepared.

    Raises
    ------
    OSError
        If the file cannot be opened.
    DataError
        If its first line names no columns.

    """
    return any(re.match(r'ddq_.', name) for name in read_header(path))


def write_csv(path: PathLike, data: Dataset) -> None:
    """
    Write a data set as CSV, whole or not at all; every number reads back exactly.

    Joint types and provenance have no place in it.

    Raises
    ------
    OSError
        If the file cannot be written.

    """
    columns: dict[str, Any] = {'t': data.t, 'segment': data.segment}
    for signal in (*_SIGNALS, 'tau_noiseless'):
        values = getattr(data, signal)
        if values is not None:
            named = zip(data.joint_names, values.T, strict=True)
            columns |= {f'{signal}_{joint}': column for joint, column in named}
    columns |= {name: getattr(data, name) for name in _TRUTH if getattr(data, name) is not None}

    def put(file: BinaryIO) -> None:
        file.write(','.join(_quoted(name) for name in columns).encode() + b'\n')
        for row in zip(*(column.tolist() for column in columns.values()), strict=True):
            file.write(','.join(map(repr, row)).encode() + b'\n')

    write_atomically(path, put)


def read_csv(path: PathLike) -> Dataset:
    """
    Read a data set: t, q_NAME, dq_NAME, ddq_NAME, tau_NAME, and segment where there is one.

    All joints are taken for revolute. Other columns are left aside.

    Raises
    ------
    OSError
        If the file cannot be opened.
    DataError
        If a column is missing, or the data set contradicts itself; names the file.

    """
    table = read_table(path)
    joints = joints_of(list(table))
    wanted = ['t', *(f'{signal}_{joint}' for signal in _SIGNALS for joint in joints)]
    check_columns(path, table, wanted)
    fields: dict[str, Any] = {signal: per_joint(table, signal, joints) for signal in _SIGNALS}
    if all(f'tau_noiseless_{joint}' in table for joint in joints):
        fields['tau_noiseless'] = per_joint(table, 'tau_noiseless', joints)
    fields |= {name: table[name] for name in _TRUTH if name in table}
    try:
        return Dataset(
            t=table['t'],
            segment=table.get('segment', np.zeros(table['t'].size)),  # type: ignore[arg-type]
            joint_names=joints,
            joint_types=('revolute',) * len(joints),
            provenance={'sources': [{'source': os.fspath(path)}]},
            **fields,
        )
    except DataError as error:
        raise type(error)(f'in {os.fspath(path)}, {error}') from error


def per_joint(table: Any, signal: str, joints: Sequence[str]) -> Array:
    """Return the columns of a signal, shape (N, n)."""
    return np.column_stack([table[f'{signal}_{joint}'] for joint in joints])


def check_columns(path: PathLike, table: Any, wanted: Sequence[str]) -> None:
    """
    Fail where a column is missing.

    Raises
    ------
    DataError
        Names the first that is missing.

    """
    missing = [name for name in wanted if name not in table]
    if len(wanted) == 1 or missing:
        raise DataError(
            f'{os.fspath(path)} must have the columns t, q_NAME, tau_NAME of every joint NAME '
            f'(and dq_NAME, ddq_NAME where known), but {(missing or ["q_NAME"])[0]} is missing '
            f'beside {", ".join(table)}; name the columns so.'
        )


def _quoted(name: str) -> str:
    return '"' + name.replace('"', '""') + '"' if re.search(r'[",\s]', name) else name
