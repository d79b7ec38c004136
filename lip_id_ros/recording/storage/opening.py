"""Which files are storage files of bags, and opening them, compressed or not."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
import tempfile
from typing import BinaryIO, cast

from lip_id_ros.recording.storage.compression import FILE_SUFFIXES, unpack_file
from lip_id_ros.recording.storage.contents import DamageError, Storage
from lip_id_ros.recording.storage.mcap import McapFile
from lip_id_ros.recording.storage.ros1 import Ros1File
from lip_id_ros.recording.storage.sqlite import SqliteFile

SUFFIXES: dict[str, Callable[[Path], Storage]] = {
    '.mcap': McapFile,
    '.db3': SqliteFile,
    '.bag': Ros1File,
}
ACTIVE = '.active'
"""What rosbag and rosbag2 add to the name of a file that is still being written."""


def is_storage(path: Path) -> bool:
    """Whether a file has the name of a storage file, compressed or not."""
    return storage_suffix(path) in SUFFIXES


def storage_suffix(path: Path) -> str:
    """Return the suffix that tells the format, without that of compression."""
    name = Path(path.name.removesuffix(ACTIVE))
    return Path(name.stem).suffix if name.suffix in FILE_SUFFIXES else name.suffix


def open_storage(path: Path, stack: ExitStack) -> Storage:
    """
    Open a storage file; a compressed one is decompressed into a temporary file first.

    Parameters
    ----------
    path : path
        With a name that `is_storage`.
    stack : ExitStack
        Closes the file and removes what is temporary.

    Raises
    ------
    DamageError
        If it cannot be read as what its name says.
    OSError
        If it cannot be opened.

    """
    with open(path, 'rb') as source:  # so that errors of the file system keep their name
        if not source.read(1):
            raise DamageError('it is empty')
    suffix, method = storage_suffix(path), FILE_SUFFIXES.get(path.suffix)
    trouble = ''
    if method is not None:
        target = stack.enter_context(tempfile.NamedTemporaryFile(suffix=suffix))  # noqa: SIM115
        with open(path, 'rb') as source:
            trouble = unpack_file(source, cast(BinaryIO, target), method)
        target.flush()
        path = Path(target.name)
    storage = SUFFIXES[suffix](path)
    stack.callback(storage.close)
    if trouble:
        storage.notes[trouble] = None
    return storage
