"""Arrays with JSON, checked and without pickle: model files, and dataclasses as bytes."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
import json
import math
import os
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.arrays import digest
from lip_id_ros.errors import DataError, ModelError
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


@dataclass(frozen=True, eq=False)
class Packable:
    """A dataclass of arrays, texts and numbers that is stored as bytes, without pickle."""

    KIND: ClassVar[str]
    """Name of such results in a cache."""

    def to_bytes(self) -> bytes:
        """Return a line of JSON, then the numbers of all arrays; `from_bytes` reads it."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays = {name: x for name, x in values.items() if isinstance(x, np.ndarray)}
        texts = {name: x for name, x in values.items() if name not in arrays}
        shapes = {name: (x.dtype.str, x.shape) for name, x in arrays.items()}
        head = json.dumps([texts, shapes]).encode()
        return b'\n'.join([head, b''.join(x.tobytes() for x in arrays.values())])

    @classmethod
    def from_bytes(cls, content: bytes) -> Self:
        """Return the object that `to_bytes` gave; DataError if an entry is missing or damaged."""
        head, _, rest = content.partition(b'\n')
        try:
            texts, shapes = json.loads(head)
            values = {name: _immutable(value) for name, value in texts.items()}
            at = 0
            for name, (kind, shape) in shapes.items():
                count = math.prod(shape)
                flat = np.frombuffer(rest, kind, count, at).copy()  # aligned, not read-only
                at += flat.nbytes
                values[name] = flat.reshape(shape)
            return cls(**values)
        except (TypeError, ValueError) as error:
            raise DataError(
                f'a {cls.__name__} with all of its entries was expected, but the stored bytes '
                f'are damaged ({error}); make it anew.'
            ) from error


def _immutable(value: Any) -> Any:
    return tuple(map(_immutable, value)) if isinstance(value, list) else value
