"""Find and open the storage files of a bag, compressed or not."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path, PurePath
import re
import tempfile
from typing import Any, BinaryIO, cast

import yaml

from lip_id_ros.errors import SourceError
from lip_id_ros.files import require_regular_file
from lip_id_ros.recording.storage.contents import (
    DamageError,
    FILE_SUFFIXES,
    Storage,
    unpack_file,
)
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
METADATA = 'metadata.yaml'

_LONGEST_METADATA = 2**20
_SHOWN = 5


def is_storage(path: Path) -> bool:
    """Whether a file has the name of a storage file, compressed or not."""
    return storage_suffix(path) in SUFFIXES


def storage_suffix(path: Path) -> str:
    """Return the suffix of the format, without that of compression."""
    name = Path(path.name.removesuffix(ACTIVE))
    return Path(name.stem).suffix if name.suffix in FILE_SUFFIXES else name.suffix


def open_storage(path: Path, stack: ExitStack) -> Storage:
    """
    Open a storage file; a compressed one is decompressed into a temporary file first.

    The stack closes the file and removes what is temporary.

    Raises
    ------
    DamageError
        If it cannot be read in the format of its name.
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


def files_of(folder: Path) -> tuple[list[Path], list[str]]:
    """
    Return the storage files of a rosbag2 folder, and notes on its metadata.

    The files themselves are trusted: those that metadata.yaml names and that are there, and those
    of the same format that it does not name (a killed recorder never wrote them down). Where it
    is absent, unreadable or names none of them, all are taken. Order is that of their numbers.

    Raises
    ------
    SourceError
        If there is no storage file in the folder.
    OSError
        If the folder or its metadata cannot be opened.

    """
    files = (file for file in folder.iterdir() if is_storage(file) and file.is_file())
    there = {file.name: file for file in sorted(files, key=_by_number)}
    named, notes = _named(folder / METADATA)
    if not there:
        raise SourceError(_no_bag(folder, named))
    notes += [
        f'{METADATA} names {name}, which is not there' for name in named if name not in there
    ]
    formats = {storage_suffix(there[name]) for name in named if name in there}
    chosen = [
        file
        for file in there.values()
        if not (formats and storage_suffix(file) not in formats) and not _is_copy(file, there)
    ]
    if named:
        notes += [f'{METADATA} does not name {f.name}' for f in chosen if f.name not in named]
    notes += [f'{file.name} was left aside' for file in there.values() if file not in chosen]
    return chosen, notes


def _no_bag(folder: Path, named: list[str]) -> str:
    # a folder of recordings is a frequent mistake
    inside = sorted({f'{file.parent.name}/' for file in folder.glob('*/*') if is_storage(file)})
    inside += sorted(file.name for file in folder.glob('*.csv'))
    found = f'none of {", ".join(named)}, which {METADATA} names' if named else 'no such file'
    remedy = 'give the folder or file that was recorded'
    if inside:
        more = ', ...' if len(inside) > _SHOWN else ''
        found = f'recordings: {", ".join(inside[:_SHOWN])}{more}'
        remedy = 'give one or several of these by name'
    return f'{folder} must hold {", ".join(SUFFIXES)} files of one bag, but has {found}; {remedy}.'


def _named(path: Path) -> tuple[list[str], list[str]]:
    """Return the names of the files in metadata.yaml, and what is wrong with it."""
    try:
        require_regular_file(path)
        if path.stat().st_size > _LONGEST_METADATA:
            return [], [f'{METADATA} is too long to be read']
        text = path.read_bytes()
    except FileNotFoundError:
        return [], [f'{METADATA} is missing']
    except SourceError:
        return [], [f'{METADATA} is not a file']
    try:
        information: Any = yaml.safe_load(text)['rosbag2_bagfile_information']
        return [PurePath(name).name for name in information['relative_file_paths']], []
    except Exception as error:  # whatever nonsense makes the parser, or the look-up, raise
        return [], [f'{METADATA} cannot be read ({type(error).__name__})']


def _is_copy(file: Path, there: dict[str, Path]) -> bool:
    """Whether a compressed file lies beside its decompressed form."""
    return storage_suffix(file) != file.suffix and file.stem in there


def _by_number(file: Path) -> list[Any]:
    parts = re.split(r'(\d+)', file.name)
    return [int(part) if part.isdigit() else part for part in parts]
