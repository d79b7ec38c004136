"""Recordings of a fleet, on disk or in any store that fsspec knows: find, group, fetch."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
import hashlib
import logging
import os
from pathlib import Path, PurePosixPath
import re
import shutil
import tempfile
import time
from typing import Any

import fsspec
from fsspec.implementations.local import LocalFileSystem
import yaml

from lip_id_ros.csv_table import CSV_SUFFIX
from lip_id_ros.dataset import DATASET_SUFFIX
from lip_id_ros.errors import ConfigError, SourceError, TransferError
from lip_id_ros.recording.bags import is_storage, METADATA

ATTEMPTS = 5
"""How often a connection may break while one file is copied."""

WAITS_S = (1.0, 2.0, 4.0, 8.0)
"""Before each attempt but the first."""

BLOCK_BYTES = 4 * 2**20
SPARE_BYTES = 2**30
"""Free space that a copy of a remote recording leaves on the disk for temporary files."""

PROBES, PROBE_BYTES = 16, 65536
"""Blocks of a large local file that its fingerprint is made of; of another it is all bytes."""

METADATA_GROUP = 'metadata:'
_CONTENT = ('md5Hash', 'crc32c', 'ETag', 'etag', 'content_md5', 'checksum', 'generation')
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class StoredRecording:
    """
    A recording somewhere.

    Attributes
    ----------
    name : str
        Address: a path, or a URL.
    group : str
        Robot; empty where recordings are not grouped.
    size : int
        Of all its files [bytes].
    fingerprint : str
        Changes with the content of the files.
    files : tuple of str
        URLs; those of a bag that is a folder are in it.
    is_folder : bool

    """

    name: str
    group: str
    size: int
    fingerprint: str
    files: tuple[str, ...]
    is_folder: bool

    @contextmanager
    def local(self) -> Iterator[str]:
        """
        Give the path of the recording on this machine while the context lasts.

        A remote one is copied into a folder for temporary files and removed afterwards.

        Raises
        ------
        TransferError
            If there is no space for it, or the connection broke `ATTEMPTS` times.
        OSError
            If a file does not exist or must not be read.

        """
        if '://' not in self.name:
            yield self.name
            return
        with tempfile.TemporaryDirectory(prefix='lip_id_ros_') as scratch:
            if self.size + SPARE_BYTES > (free := shutil.disk_usage(scratch).free):
                raise TransferError(
                    f'{self.name} needs {self.size} bytes in {tempfile.gettempdir()} and '
                    f'{SPARE_BYTES} to spare, but {free} are free; free some, or set TMPDIR.'
                )
            place = Path(scratch) / PurePosixPath(self.name).name
            if self.is_folder:
                place.mkdir()
            for url in self.files:
                target = place / PurePosixPath(url).name if self.is_folder else place
                fetch(url, target)
            yield str(place)


def fetch(url: str, target: Path, sleep: Callable[[float], None] = time.sleep) -> None:
    """
    Copy a remote file; after a broken connection go on from where it broke.

    Raises
    ------
    TransferError
        If it broke `ATTEMPTS` times.
    FileNotFoundError, PermissionError
        If there is no such file, or it must not be read.

    """
    system, path = fsspec.core.url_to_fs(url)
    with open(target, 'wb') as file:
        for attempt in range(1, ATTEMPTS + 1):
            try:
                _copy_rest(system, path, file)
                return
            except (FileNotFoundError, PermissionError):
                raise
            except Exception as error:  # every file system has its own kinds
                reason = ' '.join(f'{type(error).__name__}: {error}'.split())
                if attempt == ATTEMPTS:
                    raise TransferError(
                        f'{url} cannot be copied: the connection broke {ATTEMPTS} times '
                        f'({reason}); try again, or copy it by other means.'
                    ) from error
                wait_s = WAITS_S[attempt - 1]
                _LOG.warning(
                    '%s: connection broke after %d bytes (%s); attempt %d of %d in %g s',
                    *(url, file.tell(), reason, attempt + 1, ATTEMPTS, wait_s),
                )
                sleep(wait_s)


def _copy_rest(system: Any, path: str, file: Any) -> None:
    with system.open(path, 'rb', block_size=BLOCK_BYTES, cache_type='none') as remote:
        remote.seek(file.tell())
        while block := remote.read(BLOCK_BYTES):
            file.write(block)


def find(patterns: Sequence[str], group_by: str | None = None) -> list[StoredRecording]:
    """
    Return the recordings that patterns name, in the order of their addresses, each once.

    Parameters
    ----------
    patterns : sequence of str
        Paths, patterns such as ``bags/**/*.mcap``, and URLs such as ``s3://bucket/arm7/``. A
        folder with a metadata.yaml is one bag; of any other folder, all that is in it is taken.
    group_by : str, optional
        A regular expression with one group, which is searched for in the address, or
        ``metadata:KEY`` for an entry of custom_data in the metadata.yaml of a bag.

    Raises
    ------
    SourceError
        If a pattern names no recording.
    ConfigError
        If `group_by` cannot be used, or a recording has no such group, or no file system is known
        for a URL.

    """
    group_of = _grouping(group_by)
    found: dict[str, StoredRecording] = {}
    for pattern in patterns:
        some = _matching(pattern, group_of)
        if not some:
            raise SourceError(
                f'{pattern} must name recordings, but there is none; correct it. Patterns need '
                'quotes, and ** for folders in folders.'
            )
        found |= {each.name: each for each in some}
    return [found[name] for name in sorted(found)]


Details = dict[str, Any]
"""Of a file, as its file system gives them."""

Grouping = Callable[[Any, str, str], str]
"""Group by file system, path of the bag and address."""


def _matching(pattern: str, group_of: Grouping) -> list[StoredRecording]:
    try:
        system, path = fsspec.core.url_to_fs(pattern)
    except (ValueError, ImportError) as error:
        raise ConfigError(
            f'{pattern} must be a path or a URL that fsspec can open, but it cannot ({error}); '
            'install what it names, or correct the address.'
        ) from error
    try:
        files, named = _listed(system, path, pattern)
    except FileNotFoundError:
        return []
    except Exception as error:  # every store has its own kinds
        if _is_local(system):
            raise
        reason = ' '.join(f'{type(error).__name__}: {error}'.split())
        raise TransferError(
            f'{pattern} must be in a store that can be listed, but it cannot ({reason}); check '
            'the address, the credentials and the network.'
        ) from error
    return _recordings(system, files, named, group_of, pattern)


def _listed(system: Any, path: str, pattern: str) -> tuple[dict[str, Details], set[str]]:
    """Return details of the files that a pattern names or its folders hold, and those it names."""
    has_magic = any(letter in pattern for letter in '*?[')
    if has_magic and not (_is_local(system) and os.path.exists(pattern)):
        matches = system.glob(path, detail=True)
    else:
        matches = {path: system.info(path)}
    files = {place: each for place, each in matches.items() if each['type'] != 'directory'}
    named = set(files)
    for folder in matches.keys() - named:
        files |= system.find(folder, detail=True)
    return files, named


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
        elif is_storage(Path(path)) or Path(path).suffix in (DATASET_SUFFIX, CSV_SUFFIX):
            members[path] = [path]
    return [
        _recording(system, path, [files[each] for each in some], group_of, pattern)
        for path, some in members.items()
    ]


def _recording(
    system: Any, path: str, details: list[Details], group_of: Grouping, pattern: str
) -> StoredRecording:
    is_folder = [each['name'] for each in details] != [path]
    name = _address(system, path, pattern)
    urls = tuple(_address(system, each['name'], pattern) for each in details)
    marks = [
        f'{PurePosixPath(each["name"]).name if is_folder else ""} {_fingerprint(system, each)}'
        for each in details
    ]
    return StoredRecording(
        name=name,
        group=group_of(system, path if is_folder else str(PurePosixPath(path).parent), name),
        size=sum(int(each.get('size') or 0) for each in details),
        fingerprint=hashlib.sha256('\n'.join(marks).encode()).hexdigest(),
        files=urls,
        is_folder=is_folder,
    )


def _address(system: Any, path: str, pattern: str) -> str:
    if not _is_local(system):
        return str(system.unstrip_protocol(path))
    return path if os.path.isabs(pattern) else os.path.relpath(path)


def _fingerprint(system: Any, details: Details) -> str:
    """
    Return a text that changes with the content of a file.

    A store has a checksum of its own. Of a local file, size, time of modification and blocks
    spread over it are taken, since to read all of a fleet would take as long as the fit.

    """
    size = details.get('size')
    if _is_local(system):
        try:
            with open(details['name'], 'rb') as file:
                return f'{size} {details["mtime"]} {_probed(file, int(size or 0))}'
        except OSError as error:  # of this file alone, as whoever reads it will report
            return str(error)
    known = [f'{key}={details[key]}' for key in _CONTENT if details.get(key)]
    return f'{size} {" ".join(known)}' if known else str(system.ukey(details['name']))


def _probed(file: Any, size: int) -> str:
    if size <= PROBES * PROBE_BYTES:
        return hashlib.sha256(file.read()).hexdigest()
    digest = hashlib.sha256()
    for k in range(PROBES):
        file.seek((size - PROBE_BYTES) * k // (PROBES - 1))
        digest.update(file.read(PROBE_BYTES))
    return digest.hexdigest()


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


def _is_local(system: Any) -> bool:
    return isinstance(system, LocalFileSystem)
