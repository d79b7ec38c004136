"""Reports of progress: a callback; nothing below the command line prints."""

from collections.abc import Callable

Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``; `total` is 0 while it is not known."""


def silent(stage: str, done: int, total: int) -> None:
    """Report nothing."""
