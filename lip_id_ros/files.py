"""Atomic writes of files, and npz files with a JSON header."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
import errno
import fcntl
import glob
import json
import math
import os
from pathlib import Path
import shutil
import stat
import tempfile
import time
from typing import Any, BinaryIO, cast, IO
import uuid
import zipfile
import zlib

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.errors import ConfigError, shortened, SourceError

PathLike = str | os.PathLike[str]

HEADER = 'header_json'

HEX_DIGITS = 32  # of the random part of a temporary name
SWEEP_AFTER_S = 60.0
ROOM = 2**20  # bytes, about those of a model
SCRATCH = 'lip_id_ros_scratch_'
LARGE_BYTES = 2**28
MOST_EXPANSION = 200  # of an archive larger than that; measured data compress by less than 10
READ_HEADER = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}

DAMAGE = (
    *(zipfile.BadZipFile, zlib.error),
    *(EOFError, KeyError, NotImplementedError, OSError, RuntimeError),
)
"""Errors of reading a damaged, truncated or encrypted archive."""
OF_CONTENTS = None, errno.EINVAL
"""Numbers of the OSErrors that damaged contents cause; any other may go away by itself."""


def write_whole(path: PathLike, content: bytes) -> None:
    """Write a file at once, as `write_atomically` does."""
    write_atomically(path, lambda file: file.write(content))


def write_atomically(path: PathLike, writer: Callable[[BinaryIO], object]) -> None:
    """
    Write a file under a temporary name in its folder, which must exist, then rename it.

    A reader never sees half a file, and a failure leaves the old file, even after a power cut. A
    link is followed, the mode of an existing file is kept. A pipe or a device is written to and
    not replaced. Temporary files of killed writes are removed.

    OSError if the folder does not exist or cannot be written.
    """
    if is_stream(path_text(path)):
        with tempfile.TemporaryFile() as whole:
            writer(whole)
            whole.seek(0)
            with open(path, 'wb') as stream:
                shutil.copyfileobj(whole, stream)
        return
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), os.fspath(path))
    _sweep(target)
    temporary = _temporary_beside(target)
    try:
        with open(temporary, 'xb') as file:
            with suppress(OSError):  # some file systems have no locks, and are not swept
                fcntl.flock(file, fcntl.LOCK_EX)  # until it is closed: see _sweep
            writer(file)
            _finish(file, target)
            os.replace(temporary, target)
        sync_folder(target.parent)
    except BaseException as error:
        with suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError) and error.filename in (None, os.fspath(temporary)):
            error.filename = os.fspath(path)  # the name that the caller knows
        raise


def move_into_place(finished: Path, path: PathLike) -> None:
    """Give a finished file of the same folder its name, as `write_atomically` does."""
    target = Path(os.path.realpath(path))
    with open(finished, 'rb+') as file:
        _finish(file, target)
    os.replace(finished, target)
    sync_folder(target.parent)


def sync_folder(folder: Path) -> None:
    """Have the names in a folder survive a power cut, where its file system can do that."""
    with suppress(OSError):
        sync(folder)


def sync(path: Path) -> None:
    """Have a file survive a power cut; OSError if the disk fails."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def state_folder(node: str) -> Path:
    """Return the folder in which a node, by its full name, keeps what outlives it."""
    home = os.environ.get('XDG_STATE_HOME') or os.path.expanduser('~/.local/state')
    return Path(home, 'ros', 'lip_id_ros', node.strip('/'))


def require_writable(path: PathLike) -> None:
    """Raise a ConfigError unless a file can be written at a path, with some room on its disk."""
    target = Path(os.path.realpath(path))
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        with tempfile.TemporaryFile(dir=target.parent) as probe:
            probe.write(bytes(ROOM))  # a full or read-only disk has modes that say otherwise
    except OSError as error:
        raise ConfigError(
            f'{os.fspath(path)} cannot be written ({error.strerror or error}); name another file, '
            'or mend its folder.'
        ) from error


def require_suffix(path: PathLike, suffix: str, what: str) -> None:
    """Raise a ConfigError unless a path ends in the suffix of a format."""
    if Path(path_text(path)).suffix != suffix:
        raise ConfigError(
            f'{os.fspath(path)} must end in {suffix}, the format of {what}; rename it.'
        )


def is_stream(path: PathLike) -> bool:
    """Whether a path is a pipe, a device or the like, which is written to but not replaced."""
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return False
    return not stat.S_ISREG(mode) and not stat.S_ISDIR(mode)


def _temporary_beside(target: Path) -> Path:
    # Names have 255 bytes at most.
    short = os.fsencode(target.name)[:200].decode(errors='ignore')
    return target.with_name(f'.{short}.{uuid.uuid4().hex}')


def _finish(file: IO[bytes], target: Path) -> None:
    with suppress(FileNotFoundError):
        os.fchmod(file.fileno(), stat.S_IMODE(target.stat().st_mode))
    file.flush()
    os.fsync(file.fileno())


def _sweep(target: Path) -> None:
    """Remove temporary files that killed writes of the same file left: nobody locks them."""
    prefix = _temporary_beside(target).name[:-HEX_DIGITS]
    with suppress(OSError):
        old = time.time() - SWEEP_AFTER_S
        for left in list(target.parent.iterdir()):
            digits = left.name.removeprefix(prefix)
            is_ours = left.name.startswith(prefix) and len(digits) == HEX_DIGITS
            if is_ours and left.is_file() and left.stat().st_mtime < old:
                _remove_unlocked(left)


def _remove_unlocked(path: Path) -> None:
    with suppress(OSError), open(path, 'rb') as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        path.unlink()


@contextmanager
def scratch_folder(prefix: str = SCRATCH, place: Path | None = None) -> Iterator[str]:
    """
    Give a folder for temporary files while the context lasts; remove those of killed ones.

    `place`: folder in which it is made; that for temporary files where it is not given.
    """
    _sweep_scratch(prefix, Path(tempfile.gettempdir()) if place is None else place)
    with tempfile.TemporaryDirectory(prefix=prefix, dir=place) as folder:
        lock = os.open(folder, os.O_RDONLY)
        try:
            with suppress(OSError):
                fcntl.flock(lock, fcntl.LOCK_EX)  # until it ends, however it does
            yield folder
        finally:
            os.close(lock)


def _sweep_scratch(prefix: str, place: Path) -> None:
    old = time.time() - SWEEP_AFTER_S
    for left in place.glob(f'{glob.escape(prefix)}*'):
        with suppress(OSError):
            if left.lstat().st_mtime > old or left.is_symlink():
                continue
            lock = os.open(left, os.O_RDONLY | os.O_DIRECTORY)
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(left)
            finally:
                os.close(lock)


def write_npz(
    path: PathLike,
    arrays: Mapping[str, NDArray[Any]],
    header: Mapping[str, Any],
) -> None:
    """
    Write named arrays and a JSON-able header into one npz file, as `write_atomically` does.

    No suffix is added to the path. The header is the array `header_json`.
    """
    text = np.array(json.dumps(dict(header), sort_keys=True))
    named: dict[str, Any] = {HEADER: text, **arrays}
    write_atomically(path, lambda file: np.savez_compressed(file, **named))


def read_npz(path: PathLike) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """
    Read the arrays and the JSON header of an npz file; never unpickles.

    The header is empty where the file has none (an npz file from elsewhere).

    OSError if the file does not exist or cannot be opened; ValueError if it is not an npz file, is
    damaged, or holds pickled objects.
    """
    return _read(path, lambda name: True)


def read_header(path: PathLike) -> dict[str, Any]:
    """Read only the JSON header of an npz file; see `read_npz`, also for the errors."""
    return _read(path, lambda name: name == HEADER)[1]


def _read(
    path: PathLike, wanted: Callable[[str], bool]
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    require_regular_file(path)
    with open(path, 'rb') as file:
        try:
            with zipfile.ZipFile(file) as archive:
                _check_expansion(archive)
                members = {_array_name(info): info for info in archive.filelist}
                arrays = {
                    name: _array(archive, info) for name, info in members.items() if wanted(name)
                }
        except MemoryError as error:
            raise OSError(errno.ENOMEM, os.strerror(errno.ENOMEM), os.fspath(path)) from error
        except DAMAGE as error:
            if isinstance(error, OSError) and error.errno not in OF_CONTENTS:
                raise
            if isinstance(error, zipfile.BadZipFile) and not zipfile.is_zipfile(file):
                raise ValueError('not an npz archive, or only a part of one') from error
            raise ValueError(f'damaged archive: {str(error) or "it ends too early"}') from error
    text = arrays.pop(HEADER, None)
    try:
        header = json.loads(str(text)) if text is not None else {}
    except RecursionError as error:
        raise ValueError('the header is nested too deeply') from error
    if not isinstance(header, dict):
        raise ValueError('the header is not a JSON object')
    return arrays, header


def path_text(path: Any) -> str:
    """Return a path as text; SourceError where it is none."""
    name = os.fspath(path) if isinstance(path, (str, os.PathLike)) else None
    if not isinstance(name, str):
        raise SourceError(f'a path must be a text or a Path, not {shortened(path)}; name a file.')
    if '\0' in name:
        raise SourceError(f'a path must not contain NUL, but {name!r} does; correct the name.')
    return name


def require_regular_file(path: PathLike) -> None:
    """
    Raise an error unless a path is a regular file, links followed.

    A device, a pipe or a socket may block for ever or never end.

    OSError if there is no such file, SourceError if it is anything else than a file.
    """
    name = path_text(path)
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode):
        kind = 'a folder' if stat.S_ISDIR(mode) else 'a device, a pipe or a socket'
        raise SourceError(f'{name!r} must be a regular file, but is {kind}; name a file.')


def _check_expansion(archive: zipfile.ZipFile) -> None:
    size = sum(info.file_size for info in archive.filelist)
    packed = sum(info.compress_size for info in archive.filelist)
    packed = min(packed, os.fstat(cast('BinaryIO', archive.fp).fileno()).st_size)
    if size > LARGE_BYTES and size > MOST_EXPANSION * packed:
        raise ValueError(f'{packed} bytes that expand to {size}, more than data do')


def _array_name(info: zipfile.ZipInfo) -> str:
    if not info.filename.endswith('.npy'):
        raise ValueError(f'{info.filename!r}, which is not an array, in the archive')
    return info.filename.removesuffix('.npy')


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> NDArray[Any]:
    """Read one array, after its claimed shape was compared with its size."""
    with archive.open(info) as member:
        version = np.lib.format.read_magic(member)
        read_header = READ_HEADER.get(version)
        if read_header is None:
            raise ValueError(f'an array of the unknown format {version}')
        shape, _, dtype = read_header(member)
        if math.prod(shape) * dtype.itemsize > info.file_size:
            raise ValueError(f'an array of shape {shape} in only {info.file_size} bytes')
    with archive.open(info) as member:
        array: NDArray[Any] = np.lib.format.read_array(member, allow_pickle=False)
    return array
