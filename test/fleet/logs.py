"""Lines that a module logs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import logging


class _Lines(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(record.getMessage())


@contextmanager
def logged(module: str) -> Iterator[list[str]]:
    """Collect lines; caplog does not see them where ROS's launch has replaced the loggers."""
    handler = _Lines()
    logger = logging.getLogger(module)
    logger.addHandler(handler)
    try:
        yield handler.lines
    finally:
        logger.removeHandler(handler)
