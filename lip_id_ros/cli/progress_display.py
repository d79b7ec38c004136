"""How far long work is: bars on a terminal, now and then a line elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import sys
import time
from typing import TextIO

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.progress import (
    Progress as Bars,
)

from lip_id_ros.progress import Progress

QUIET_SECONDS = 10.0


@contextmanager
def progress_display() -> Iterator[Progress]:
    """Give a progress callback that shows itself on standard error while the block runs."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Lines(sys.stderr)
        return
    columns = (TextColumn('{task.description:<24}'), BarColumn(), MofNCompleteColumn())
    with Bars(*columns, TimeElapsedColumn(), console=console, transient=True) as bars:
        yield _Stages(bars)


class Lines:
    """
    A line of text at most every ten seconds, none for what takes less.

    Parameters
    ----------
    stream : text file
        Where to.
    clock : callable
        Seconds that only go forward.

    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream = stream
        self._clock = clock
        self._last = clock()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Take a report."""
        now = self._clock()
        if now - self._last >= QUIET_SECONDS:
            self._last = now
            print(f'{stage}: {done} of {total}' if total else stage, file=self._stream, flush=True)


class _Stages:
    """One bar per stage, in the order in which they report."""

    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}

    def __call__(self, stage: str, done: int, total: int) -> None:
        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(stage, total=None)
        self._bars.update(self._tasks[stage], completed=done, total=total or None)
