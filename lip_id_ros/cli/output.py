"""Where results go: standard output and JSON files."""

from __future__ import annotations

from collections.abc import Mapping
import errno
import json
import os
from pathlib import Path
import sys
from typing import Any

from rich.console import Console

from lip_id_ros.files import write_whole

STANDARD_OUTPUT = '-'
PLAIN_WIDTH = 100


def require_folder(path: str | None) -> None:
    """
    Fail before the work, not after it, where a file cannot be written.

    Parameters
    ----------
    path : str or None
        A file to be written; None and '-' need no folder.

    Raises
    ------
    OSError
        If its folder does not exist or is not writable, or the path is a folder itself.

    """
    if path is None or path == STANDARD_OUTPUT:
        return
    folder = Path(path).parent
    if Path(path).is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
    if not folder.is_dir():
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(folder))
    if not os.access(folder, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))


def require_no_file(folder: str | None) -> None:
    """
    Fail before the work, not after it, where a folder cannot be made.

    Parameters
    ----------
    folder : str or None
        To be made, or there already.

    Raises
    ------
    OSError
        If a file is in its place.

    """
    if folder is not None and Path(folder).exists() and not Path(folder).is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), folder)


def console(json_target: str | None = None) -> Console:
    """Return where tables go: standard output, or standard error where JSON takes that."""
    to_stderr = json_target == STANDARD_OUTPUT
    stream = sys.stderr if to_stderr else sys.stdout
    width = None if stream.isatty() else PLAIN_WIDTH
    return Console(stderr=to_stderr, width=width, highlight=False)


def write_json(target: str | None, content: Mapping[str, Any]) -> None:
    """
    Write figures as JSON, whole or not at all.

    Parameters
    ----------
    target : str or None
        A file, '-' for standard output, None for nowhere.
    content : mapping
        JSON-able, without nan.

    Raises
    ------
    OSError
        If the file cannot be written.

    """
    if target is None:
        return
    text = json.dumps(dict(content), indent=2, allow_nan=False) + '\n'
    if target == STANDARD_OUTPUT:
        sys.stdout.write(text)
        return
    write_whole(target, text.encode())
