"""Files of a fleet's recordings: addresses, marks of their content, copies of remote ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
import hashlib
from io import RawIOBase
import logging
import os
from pathlib import Path
import tempfile
import time
from typing import Any
import uuid

import fsspec
from fsspec.implementations.local import LocalFileSystem

from lip_id_ros.errors import TransferError

ATTEMPTS = 5
"""How often a connection may break while one file is copied."""

WAITS_S = (1.0, 2.0, 4.0, 8.0)
"""Before each attempt but the first."""

BLOCK_BYTES = 4 * 2**20
PROBES, PROBE_BYTES = 16, 65536
"""Blocks of a large local file that its fingerprint is made of; of another it is all bytes."""

UNMARKED = 'unmarked '
_CONTENT = (
    *('md5Hash', 'crc32c', 'ETag', 'etag', 'content_md5', 'Content-MD5', 'Digest', 'checksum'),
    'generation',
)
_TIMES = 'Last-Modified', 'LastModified', 'last_modified', 'modify', 'mtime', 'updated', 'created'
_LOG = logging.getLogger(__name__)

Details = dict[str, Any]
"""Of a file, as its file system gives them."""


@dataclass(frozen=True)
class StoredFile:
    """A file somewhere; its mark changes with the content."""

    url: str  # with credentials, where it has some
    size: int | None  # [bytes]; None where the store has none
    mark: str


def public(url: str) -> str:
    """Return an address without passwords and the queries of HTTP, which may grant access."""
    scheme, mark, rest = url.partition('://')
    if not mark:
        return url
    if _is_http(url):
        rest = rest.partition('?')[0]
    place, slash, path = rest.partition('/')
    user, _, host = place.rpartition('@')
    return f'{scheme}://{host if ":" in user or _is_http(url) else place}{slash}{path}'


def _is_http(url: str) -> bool:
    return url.startswith(('http://', 'https://'))


def reason_of(error: BaseException, url: str) -> str:
    """Return an error as a text without the credentials of an address."""
    text = ' '.join(f'{type(error).__name__}: {error}'.split())
    return text.replace(url, public(url))


def fetch(file: StoredFile, target: Path, sleep: Callable[[float], None] = time.sleep) -> None:
    """
    Copy a remote file; after a broken connection go on from where it broke.

    TransferError if it broke `ATTEMPTS` times, the disk is full, or the file is not the one that
    was found. FileNotFoundError, PermissionError if there is no such file, or it must not be read.
    """
    system, path = fsspec.core.url_to_fs(file.url)
    name = public(file.url)
    with open(target, 'wb', buffering=0) as copy:
        for attempt in range(1, ATTEMPTS + 1):
            before = copy.tell()
            try:
                _copy_rest(system, path, copy)
                _check_whole(system, path, file, copy.tell())
                return
            except TransferError:
                raise
            except (FileNotFoundError, PermissionError) as error:
                raise type(error)(
                    error.errno, error.strerror or 'cannot be opened', name
                ) from None
            except Exception as error:  # every file system has its own kinds
                reason = reason_of(error, file.url)
                if attempt == ATTEMPTS:
                    raise TransferError(
                        f'{name} cannot be copied: the connection broke {ATTEMPTS} times '
                        f'({reason}); try again, or copy it by other means.'
                    ) from None
                wait_s = WAITS_S[attempt - 1]
                _LOG.warning(
                    '%s: connection broke after %d bytes (%s); attempt %d of %d in %g s',
                    *(name, copy.tell(), reason, attempt + 1, ATTEMPTS, wait_s),
                )
                sleep(wait_s)
                if copy.tell() == before:  # some servers cannot go on
                    copy.seek(0)
                    copy.truncate()


def _copy_rest(system: Any, path: str, copy: RawIOBase) -> None:
    with system.open(path, 'rb', block_size=BLOCK_BYTES, cache_type='none') as remote:
        remote.seek(copy.tell())
        while block := remote.read(BLOCK_BYTES):
            _write(copy, block, path)


def _write(copy: RawIOBase, block: bytes, path: str) -> None:
    try:
        while block:
            block = block[copy.write(block) :]
    except OSError as error:
        raise TransferError(
            f'{public(path)} cannot be copied to {tempfile.gettempdir()} '
            f'({error.strerror or error}); free some of that disk, or set TMPDIR.'
        ) from error


def _check_whole(system: Any, path: str, file: StoredFile, copied: int) -> None:
    """Raise an error where the copy is short, or the file is no longer the one that was found."""
    system.invalidate_cache()
    details = system.info(path)
    if _contradict(mark_of(system, details), file.mark):
        raise TransferError(
            f'{public(file.url)} has changed since it was found; fit again when nobody writes it.'
        )
    size = details.get('size')
    if size is not None and copied != size:
        raise ConnectionError(f'{copied} of {size} bytes arrived')


def mark_of(system: Any, details: Details) -> str:
    """
    Return a text that changes with the content of a file.

    A store has a checksum of its own, or a time. Of a local file, size, time of modification and
    blocks spread over it are taken, since to read all of a fleet would take as long as the fit.
    Where nothing is known, each text is another.
    """
    size = details.get('size')
    if is_local(system):
        try:
            with open(details['name'], 'rb') as file:
                status = os.fstat(file.fileno())  # not of a link to it
                return f'{status.st_size} {status.st_mtime} {_probed(file, status.st_size)}'
        except OSError as error:  # of this file alone, as whoever reads it will report
            return str(error)
    known = [f'{key}={details[key]}' for key in _CONTENT if details.get(key)]
    known = known or [f'{key}={_plain(details[key])}' for key in _TIMES if details.get(key)]
    return '\n'.join([f'size={size}', *known]) if known else f'{UNMARKED}{uuid.uuid4().hex}'


def _plain(time: Any) -> Any:
    """Return a time as a number where it is one: lists and details may have it in two forms."""
    return time.timestamp() if isinstance(time, datetime) else time


def _contradict(mark: str, other: str) -> bool:
    """Return whether two marks differ in what both tell, since calls of a store tell several."""
    first, second = (
        dict(line.partition('=')[::2] for line in each.splitlines()) for each in (mark, other)
    )
    return any(first[key] != second[key] for key in first.keys() & second.keys())


def is_unmarked(mark: str) -> bool:
    """Whether a store tells nothing that changes with the content."""
    return mark.startswith(UNMARKED)


def _probed(file: Any, size: int) -> str:
    if size <= PROBES * PROBE_BYTES:
        return hashlib.sha256(file.read()).hexdigest()
    digest = hashlib.sha256()
    for k in range(PROBES):
        file.seek((size - PROBE_BYTES) * k // (PROBES - 1))
        digest.update(file.read(PROBE_BYTES))
    return digest.hexdigest()


def is_local(system: Any) -> bool:
    """Whether a file system is that of this machine."""
    return isinstance(system, LocalFileSystem)
