"""What the tests of engines run in other processes."""

from __future__ import annotations

import os
from pathlib import Path
import signal
from typing import Any

from lip_id_ros.errors import SourceError


def square(number: int) -> tuple[int, int]:
    return number**2, os.getpid()


def troubled(item: str) -> str:
    """Fail in the way that an item names; `once` dies unless a file says that it has."""
    kind, _, place = item.partition(' ')
    if kind == 'error':
        raise SourceError('the bag\nis empty.')
    if kind == 'defect':
        raise ZeroDivisionError('of a library')
    if kind == 'dies' or (kind == 'once' and not Path(place).exists()):
        if place:
            Path(place).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return kind


def waits(item: tuple[str, Any]) -> str:
    kind, place = item
    if kind == 'wait':
        Path(place).touch()
        signal.pause()
    return kind
