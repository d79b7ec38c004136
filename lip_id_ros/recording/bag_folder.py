"""Which files of a folder are the bag, and what is wrong with its metadata.yaml."""

from __future__ import annotations

from pathlib import Path, PurePath
import re
from typing import Any

import yaml

from lip_id_ros.errors import SourceError
from lip_id_ros.recording.storage import is_storage, SUFFIXES
from lip_id_ros.recording.storage.opening import storage_suffix

METADATA = 'metadata.yaml'


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
        raise SourceError(
            f'{folder} must hold a bag, but there is no {", ".join(SUFFIXES)} file in it '
            f'({"; ".join(notes) or "metadata.yaml names " + ", ".join(named)}); give the folder '
            'or file that was recorded.'
        )
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


def _named(path: Path) -> tuple[list[str], list[str]]:
    """Return the names of the files in metadata.yaml, and what is wrong with it."""
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return [], [f'{METADATA} is missing']
    try:
        information: Any = yaml.safe_load(text)['rosbag2_bagfile_information']
        return [PurePath(str(name)).name for name in information['relative_file_paths']], []
    except Exception as error:  # whatever nonsense makes the parser, or the look-up, raise
        return [], [f'{METADATA} cannot be read ({type(error).__name__})']


def _is_copy(file: Path, there: dict[str, Path]) -> bool:
    """Whether a compressed file lies beside its decompressed form."""
    return storage_suffix(file) != file.suffix and file.stem in there


def _by_number(file: Path) -> list[Any]:
    parts = re.split(r'(\d+)', file.name)
    return [int(part) if part.isdigit() else part for part in parts]
