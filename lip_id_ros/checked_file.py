"""Model files: npz with a JSON header, checked against a hash of both; no pickle."""

from __future__ import annotations

from collections.abc import Collection, Mapping
import json
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import digest
from lip_id_ros.errors import ModelError
from lip_id_ros.files import read_header, read_npz, write_npz

Arrays = dict[str, NDArray[Any]]

MODEL = 'lip_id_ros/model'
"""What `InverseDynamicsModel` is called in its header."""


def write_checked(
    path: str | os.PathLike[str], version: int, arrays: Arrays, rest: Mapping[str, Any]
) -> None:
    """Write arrays and a header that says what they are; OSError if that fails."""
    header = {**rest, 'schema': MODEL, 'version': version}
    write_npz(path, arrays, {**header, 'sha256': _digest(arrays, header)})


def read_checked(
    path: str | os.PathLike[str], versions: Collection[int]
) -> tuple[Arrays, dict[str, Any]]:
    """
    Return arrays and header as they were written.

    OSError if the file does not exist or cannot be opened; ModelError if it is damaged, of another
    kind, or from a version of the format that is not among some.
    """
    try:
        arrays, header = read_npz(path)
    except ValueError as error:
        raise ModelError(
            f'{os.fspath(path)} must be a model that `lip_id fit` wrote, but is none ({error}); '
            'pass the file that it wrote, or fit again.'
        ) from error
    _check(path, versions, arrays, header)
    _check_contents(path, arrays, header)
    return arrays, header


def is_model(path: str | os.PathLike[str]) -> bool:
    """Whether a file says that it is a model; OSError if it cannot be opened."""
    try:
        return read_header(path).get('schema') == MODEL
    except ValueError:
        return False


def contradiction(path: str | os.PathLike[str], error: Exception) -> ModelError:
    """Return what to raise where a file has its hash, but no model can be made of it."""
    return ModelError(
        f'{os.fspath(path)} says it is a model but lacks or contradicts itself in {error}; '
        'fit again or copy the file anew.'
    )


def _check(
    path: str | os.PathLike[str],
    versions: Collection[int],
    arrays: Arrays,
    header: Mapping[str, Any],
) -> None:
    found = header.get('schema')
    if found != MODEL:
        raise ModelError(
            f'{os.fspath(path)} is not a model of lip_id_ros (its schema is '
            f'{found!r}, expected {MODEL!r}); pass the file that a fit wrote.'
        )
    if header.get('version') not in versions:
        raise ModelError(
            f'{os.fspath(path)} has model format {header.get("version")!r}, but this program '
            f'reads format {" or ".join(map(str, versions))}; fit again or use the version that '
            'wrote it.'
        )
    if header.get('sha256') != _digest(arrays, header):
        raise ModelError(
            f'{os.fspath(path)} is damaged: its contents do not match their hash; '
            'fit again or copy the file anew.'
        )


def _check_contents(
    path: str | os.PathLike[str], arrays: Arrays, header: Mapping[str, Any]
) -> None:
    # A hash can be computed anew for any contents.
    for name, values in arrays.items():
        if values.dtype.kind in 'fc' and not np.isfinite(values).all():
            raise contradiction(path, ValueError(f'{name!r}, which is not finite'))
    for name in ('summary', 'provenance'):
        if not isinstance(header.get(name, {}), dict):
            raise contradiction(path, TypeError(f'{name!r}, which is not a mapping'))


def _digest(arrays: Arrays, header: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in header.items() if key != 'sha256'}
    return digest(arrays, json.dumps(rest, sort_keys=True))
