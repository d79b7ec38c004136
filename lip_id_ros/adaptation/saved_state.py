"""The file in which `adapt` keeps what it has learned, from one start to the next."""

from __future__ import annotations

from collections.abc import Mapping
import os
from pathlib import Path

import numpy as np

from lip_id_ros.adaptation.adaptation import Adaptation
from lip_id_ros.arrays import Array
from lip_id_ros.errors import SourceError
from lip_id_ros.files import read_npz, write_npz

SCHEMA, VERSION = 'lip_id_ros/adaptation', 1


def save(path: str, adaptation: Adaptation, counter: int, now: float) -> None:
    """
    Write what was learned, whole or not at all; OSError if that fails.

    `counter`: of the last update. `now`: time by the clock of the computer [s].

    """
    header = {
        'schema': SCHEMA,
        'version': VERSION,
        'model': adaptation.commissioned.fingerprint,
        'counter': counter,
        'saved_at': now,
    }
    write_npz(path, adaptation.state(), header)


def resume(path: str, adaptation: Adaptation, now: float) -> int:
    """
    Go on from a file; return the counter of the last update, 0 where there is no file.

    A file that cannot be used is put aside: SourceError says why, and where it lies.

    """
    if not os.path.exists(path):
        return 0
    try:
        arrays, header = read_npz(path)
        _check(header, adaptation.commissioned.fingerprint)
        counter, seconds = int(header['counter']), now - float(header['saved_at'])
        adaptation.resume(_numbers(arrays), seconds)
    except (ValueError, TypeError, KeyError, OverflowError) as error:
        kept = _put_aside(Path(path))
        raise SourceError(
            f'{path} must be what adapt has saved of this model, but has {error}; it is kept as '
            f'{kept}, and what was learned begins anew.'
        ) from error
    return counter


def _numbers(arrays: Mapping[str, Array]) -> dict[str, Array]:
    return {name: np.asarray(each, dtype=np.float64) for name, each in arrays.items()}


def _check(header: Mapping[str, object], model: str) -> None:
    if header.get('schema') != SCHEMA or header.get('version') != VERSION:
        raise ValueError('another format')
    if header.get('model') != model:
        raise ValueError('the state of another model')


def _put_aside(path: Path) -> Path:
    """Give a file a name that no other has."""
    number = 1
    while (kept := path.with_name(f'{path.name}.{number}')).exists():
        number += 1
    os.replace(path, kept)
    return kept
