"""Files that are either whole or absent, and the one container format: npz with a JSON header."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
import json
import os
from pathlib import Path
import stat
from typing import Any, BinaryIO
import uuid
import zipfile
import zlib

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.errors import SourceError

HEADER = 'header_json'

DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    KeyError,
    NotImplementedError,
    OSError,
    RuntimeError,
)
"""What reading a damaged, truncated or encrypted archive raises."""


def write_whole(path: str | os.PathLike[str], content: bytes) -> None:
    """
    Write a file at once, as `write_atomically` does.

    Raises
    ------
    OSError
        If the folder does not exist or cannot be written.

    """

    def put(file: BinaryIO) -> None:
        file.write(content)

    write_atomically(path, put)


def write_atomically(path: str | os.PathLike[str], writer: Callable[[BinaryIO], None]) -> None:
    """
    Write a file under a temporary name beside its place, then rename it.

    A reader never sees half a file, and a failure leaves what was there before, even where the
    power goes.

    Parameters
    ----------
    path : path
        Where the file ends up; its folder must exist.
    writer : callable
        Gets the open binary file.

    Raises
    ------
    OSError
        If the folder does not exist or cannot be written.

    """
    target = Path(path)
    temporary = target.with_name(f'.{target.name}.{uuid.uuid4().hex}')
    try:
        with open(temporary, 'xb') as file:
            writer(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and error.filename == os.fspath(temporary):
            error.filename = os.fspath(target)  # the name that the caller knows
        raise


def write_npz(
    path: str | os.PathLike[str],
    arrays: Mapping[str, NDArray[Any]],
    header: Mapping[str, Any],
) -> None:
    """
    Write arrays and a JSON header into one npz file, atomically.

    Parameters
    ----------
    path : path
        Taken as it is, no suffix is added.
    arrays : mapping
        Named arrays of numbers or strings.
    header : mapping
        JSON-able; stored as the array `header_json`.

    Raises
    ------
    OSError
        If the file cannot be written.

    """
    text = np.array(json.dumps(dict(header), sort_keys=True))
    named: dict[str, Any] = {HEADER: text, **arrays}
    write_atomically(path, lambda file: np.savez_compressed(file, **named))


def read_npz(path: str | os.PathLike[str]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """
    Read the arrays and the JSON header of an npz file; never unpickles.

    Parameters
    ----------
    path : path
        An npz file.

    Returns
    -------
    arrays : dict
        Every array but the header.
    header : dict
        Empty where the file has none (an npz file from elsewhere).

    Raises
    ------
    OSError
        If the file does not exist or cannot be opened.
    ValueError
        If it is not an npz file, is damaged, or holds pickled objects.

    """
    with open(path, 'rb') as file:
        if not zipfile.is_zipfile(file):
            raise ValueError('not an npz archive, or only a part of one')
        file.seek(0)
        try:
            with np.load(file, allow_pickle=False) as npz:
                arrays = {name: npz[name] for name in npz.files}
        except DAMAGE as error:
            raise ValueError(f'damaged archive: {str(error) or "it ends too early"}') from error
    text = arrays.pop(HEADER, None)
    header = json.loads(str(text)) if text is not None else {}
    if not isinstance(header, dict):
        raise ValueError('the header is not a JSON object')
    return arrays, header


def require_regular_file(path: str | os.PathLike[str]) -> None:
    """
    Raise an error unless a path is a regular file, links followed.

    A device, a pipe or a socket may block for ever or never end.

    Raises
    ------
    OSError
        If there is no such file.
    SourceError
        If it is something else than a file.

    """
    name = os.fspath(path)
    if '\0' in name:
        raise SourceError(f'a path must not contain NUL, but {name!r} does; correct the name.')
    if not stat.S_ISREG(os.stat(path).st_mode):
        raise SourceError(f'{name!r} must be a regular file, but is none; give a recorded file.')
