"""Recordings of a fleet, on disk or in any store that fsspec knows: find, group, fetch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import hashlib
from itertools import takewhile
import os
from pathlib import Path, PurePosixPath
import re
import shutil
import tempfile
from typing import Any

import fsspec
import yaml

from lip_id_ros.csv_table import CSV_SUFFIX
from lip_id_ros.dataset import DATASET_SUFFIX
from lip_id_ros.errors import ConfigError, SourceError, TransferError
from lip_id_ros.files import scratch_folder
from lip_id_ros.fleet.stored_files import (
    Details,
    fetch,
    is_local,
    is_unmarked,
    mark_of,
    public,
    reason_of,
    StoredFile,
)
from lip_id_ros.recording.bags import is_storage, METADATA

ABSENT = 404
"""Status of HTTP."""

SPARE_BYTES = 2**30
"""Free space that a copy of a remote recording leaves on the disk for temporary files."""

METADATA_GROUP = 'metadata:'
SUFFIXES = DATASET_SUFFIX, CSV_SUFFIX


@dataclass(frozen=True)
class StoredRecording:
    """A recording somewhere, by path or URL without credentials; files are those of its folder."""

    name: str
    group: str
    files: tuple[StoredFile, ...]
    is_folder: bool

    @property
    def size(self) -> int:
        """Of all its files [bytes]."""
        return sum(each.size or 0 for each in self.files)

    @property
    def fingerprint(self) -> str:
        """Changes with the content of the files."""
        names = (PurePosixPath(public(each.url)).name for each in self.files)
        marks = [
            f'{name if self.is_folder else ""} {each.mark}'
            for name, each in zip(names, self.files, strict=True)
        ]
        return hashlib.sha256('\n'.join(marks).encode()).hexdigest()

    @contextmanager
    def local(self) -> Iterator[str]:
        """
        Give its path on this machine while the context lasts.

        Remote ones are copied for so long. TransferError if there is no space, the connection
        broke `ATTEMPTS` times, or a file has changed since it was found; OSError if a file does
        not exist or must not be read.
        """
        if '://' not in self.name:
            yield self.name
            return
        with scratch_folder() as scratch:
            if self.size + SPARE_BYTES > (free := shutil.disk_usage(scratch).free):
                raise TransferError(
                    f'{self.name} needs {self.size} bytes in {tempfile.gettempdir()} and '
                    f'{SPARE_BYTES} to spare, but {free} are free; free some, or set TMPDIR.'
                )
            place = Path(scratch) / PurePosixPath(self.name).name
            if self.is_folder:
                place.mkdir()
            for file in self.files:
                name = PurePosixPath(public(file.url)).name
                fetch(file, place / name if self.is_folder else place)
            yield str(place)


def find(patterns: Sequence[str], group_by: str | None = None) -> list[StoredRecording]:
    """
    Return the recordings that patterns name, in the order of their addresses, each once.

    `patterns`: paths, patterns such as ``bags/**/*.mcap``, and URLs such as ``s3://bucket/arm7/``.
    A folder with a metadata.yaml is one bag; of any other folder, all that is in it is taken.
    `group_by`: a regular expression with one group, which is searched for in the address, or
    ``metadata:KEY`` for an entry of custom_data in the metadata.yaml of a bag. SourceError if a
    pattern names no recording. ConfigError if `group_by` cannot be used, or a recording has no
    such group, or no file system is known for a URL.
    """
    group_of = _grouping(group_by)
    found: dict[str, StoredRecording] = {}
    for pattern in patterns:
        some = _matching(pattern, group_of)
        if not some:
            raise SourceError(
                f'{public(pattern)} must name recordings, but there is none; correct it. '
                'Patterns need quotes, and ** for folders in folders.'
            )
        found |= {each.name: each for each in some}
    return [found[name] for name in sorted(found)]


Grouping = Callable[[Any, str, str], str]
"""Group by file system, path of the bag and address."""


def _matching(pattern: str, group_of: Grouping) -> list[StoredRecording]:
    try:
        system, path = fsspec.core.url_to_fs(pattern)
    except (ValueError, ImportError) as error:
        raise ConfigError(
            f'{public(pattern)} must be a path or a URL that fsspec can open, but it cannot '
            f'({reason_of(error, pattern)}); install what it names, or correct the address.'
        ) from None
    try:
        files, named = _listed(system, path, pattern)
    except Exception as error:  # every store has its own kinds
        cause = error.__cause__ or error  # HTTP calls all that it meets an absent file
        if isinstance(cause, FileNotFoundError) or getattr(cause, 'status', 0) == ABSENT:
            return []
        if is_local(system):
            raise
        raise TransferError(
            f'{public(pattern)} must be in a store that can be listed, but it cannot '
            f'({reason_of(cause, pattern)}); check the address, the credentials and the network.'
        ) from None
    return _recordings(system, files, named, group_of, pattern)


def _listed(system: Any, path: str, pattern: str) -> tuple[dict[str, Details], set[str]]:
    """Return details of the files that a pattern names or its folders hold, and those it names."""
    has_magic = any(letter in public(pattern) for letter in '*?[')
    if has_magic and not (is_local(system) and os.path.exists(pattern)):
        matches = system.glob(path, detail=True)
    else:
        matches = {path: system.info(path)}
    files = {place: each for place, each in matches.items() if each['type'] != 'directory'}
    named = set(files)
    for folder in matches.keys() - named:
        files |= system.find(folder, detail=True)
    linked = {path for path, each in files.items() if each.get('islink') and os.path.isdir(path)}
    for folder in linked:  # which a listing does not look into
        del files[folder]
        files |= system.find(folder, detail=True)
    return files, named - linked


def _recordings(
    system: Any, files: dict[str, Details], named: set[str], group_of: Grouping, pattern: str
) -> list[StoredRecording]:
    """Put the files of a bag together; files that were named themselves stay alone."""
    folders = {path: str(PurePosixPath(path).parent) for path in files}
    bags = {
        folder
        for path, folder in folders.items()
        if PurePosixPath(path).name == METADATA and path not in named
    }
    members: dict[str, list[str]] = {}
    for path in sorted(files):
        if path not in named and folders[path] in bags:
            members.setdefault(folders[path], []).append(path)
        elif is_storage(name := Path(public(path))) or name.suffix in SUFFIXES:
            members[path] = [path]
    return [
        _recording(system, path, [files[each] for each in some], group_of, pattern)
        for path, some in members.items()
    ]


def _recording(
    system: Any, path: str, details: list[Details], group_of: Grouping, pattern: str
) -> StoredRecording:
    is_folder = [each['name'] for each in details] != [path]
    name = public(_address(system, path, pattern))
    files = []
    for each in details:
        if not is_local(system) and is_unmarked(mark_of(system, each)):
            each = each | system.info(each['name'])  # lists of HTTP have names alone
        url = _address(system, each['name'], pattern)
        files.append(StoredFile(url, each.get('size'), mark_of(system, each)))
    return StoredRecording(
        name=name,
        group=group_of(system, path if is_folder else str(PurePosixPath(path).parent), name),
        files=tuple(files),
        is_folder=is_folder,
    )


def _address(system: Any, path: str, pattern: str) -> str:
    """Return a path as it was given: file systems drop the hosts and accounts of addresses."""
    if is_local(system):
        return path if os.path.isabs(pattern) else os.path.relpath(path)
    given = pattern if pattern.endswith('://') else pattern.rstrip('/')
    stripped = str(system._strip_protocol(pattern)).rstrip('/')
    pairs = zip(reversed(given), reversed(stripped), strict=False)
    alike = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    return given[: len(given) - alike] + path[len(stripped) - alike :]


def _grouping(group_by: str | None) -> Grouping:
    if group_by is None:
        return lambda system, folder, name: ''
    if group_by.startswith(METADATA_GROUP):
        key = group_by.removeprefix(METADATA_GROUP)
        return lambda system, folder, name: _of_metadata(system, folder, name, key)
    try:
        pattern = re.compile(group_by)
    except re.error as error:
        raise ConfigError(
            f'--group-by must be a regular expression, but {group_by!r} is none ({error}); '
            'correct it.'
        ) from error
    if pattern.groups != 1:
        raise ConfigError(
            f'--group-by must have one group in parentheses, but {group_by!r} has '
            f'{pattern.groups}; put the part that names the robot in parentheses.'
        )
    return lambda system, folder, name: _of_address(pattern, name)


def _of_address(pattern: re.Pattern[str], name: str) -> str:
    if (match := pattern.search(name)) is None or match[1] is None:
        raise ConfigError(
            f'--group-by must match every recording, but {pattern.pattern!r} does not match '
            f'{name}; correct it, or leave that recording out.'
        )
    return match[1]


def _of_metadata(system: Any, folder: str, name: str, key: str) -> str:
    try:
        text = system.cat_file(f'{folder}/{METADATA}')
        custom = yaml.safe_load(text)['rosbag2_bagfile_information']['custom_data']
        return str(custom[key])
    except Exception as error:  # whatever nonsense makes the parser, or the look-up, raise
        raise ConfigError(
            f'--group-by {METADATA_GROUP}{key} needs {key} in custom_data of the {METADATA} of '
            f'{name}, but it has none ({type(error).__name__}); group by the path instead.'
        ) from error
