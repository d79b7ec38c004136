"""Results of earlier fits to fleets, by content, settings and code."""

from __future__ import annotations

from contextlib import suppress
import functools
import hashlib
from importlib.metadata import version
import logging
import os
from pathlib import Path
import tempfile

from lip_id_ros.files import write_whole

CHECKSUM_BYTES = 16
MADE_BY = (
    *('arrays.py', 'checked_file.py', 'csv_table.py', 'files.py', 'joint_types.py'),
    *('linear_algebra.py', 'numba_jit.py'),
    *('dataset', 'description', 'evaluation', 'export', 'fleet', 'friction', 'gp', 'health'),
    *('identification', 'kernels', 'loading', 'model', 'preprocessing', 'recording'),
    *('rigid_body', 'settings'),
)
"""Modules and rooms that results depend on: another text of one of them makes another version."""

PACKAGES = 'numpy', 'scipy', 'numba'
"""Packages that compute them."""

_LOG = logging.getLogger(__name__)


class FolderCache:
    """
    Bytes in files of a folder; any number of fits may use it at once.

    An entry is written whole or not at all; a damaged one is removed and counts as absent. Where
    the folder cannot be written, a warning is logged and the fit goes on.

    `folder`: made where it does not exist; entries lie in a folder of the code's version.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self._folder = Path(folder) / code_version()
        self._has_failed = False

    def get(self, key: str) -> bytes | None:
        """Return the bytes of a key (hexadecimal digits, dot, kind); None where there are none."""
        path = self._path(key)
        try:
            content = path.read_bytes()
        except OSError:
            return None
        if content[:CHECKSUM_BYTES] == _checksum(content[CHECKSUM_BYTES:]):
            return content[CHECKSUM_BYTES:]
        with suppress(OSError):
            path.unlink()
        return None

    def __setitem__(self, key: str, content: bytes) -> None:
        """Keep bytes under a key."""
        path = self._path(key)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(path, _checksum(content) + content)
        except OSError as error:
            if not self._has_failed:
                _LOG.warning('results are not kept, since %s cannot be written: %s', path, error)
            self._has_failed = True

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / key


def _checksum(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=CHECKSUM_BYTES).digest()


def default_folder() -> Path:
    """Return where results are kept unless a folder is named: a temporary one without a home."""
    try:
        base = os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache'
    except RuntimeError:  # in containers: neither HOME nor an entry of the user
        base = Path(tempfile.gettempdir()) / f'cache_of_{os.getuid()}'
    return Path(base) / 'lip_id_ros' / 'fleet'


@functools.cache
def code_version() -> str:
    """Return a text that changes with the sources and packages that results depend on."""
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256(repr([version(name) for name in PACKAGES]).encode())
    for name in MADE_BY:
        place = root / name
        for path in sorted(place.rglob('*.py')) if place.is_dir() else [place]:
            digest.update(path.relative_to(root).as_posix().encode() + b'\0')
            digest.update(path.read_bytes() + b'\0')
    return digest.hexdigest()[:16]
