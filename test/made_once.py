"""Files that one worker of a test run makes for all of them."""

from __future__ import annotations

from collections.abc import Callable
import fcntl
import os
from pathlib import Path

import pytest


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """Return a file or folder that the first worker that needs it makes, and nobody changes."""
    folder = factory.getbasetemp()
    if 'PYTEST_XDIST_WORKER' in os.environ:
        folder = folder.parent
    with open(folder / f'{name}.made', 'a') as note:
        fcntl.flock(note, fcntl.LOCK_EX)
        if not os.fstat(note.fileno()).st_size:
            make(folder / name)
            note.write('yes')
    return folder / name
