"""Outputs of a verb: checks before the work, tables, JSON files and progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import errno
import json
import os
from pathlib import Path
import sys
import time
from typing import Any, TextIO

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bars
from rich.text import Text

from lip_id_ros.errors import ConfigError
from lip_id_ros.files import is_stream, require_writable, write_whole
from lip_id_ros.progress import Progress

DASH = '-'
"""Standard output as the place of `--json`."""

PLAIN_WIDTH = 100
QUIET_SECONDS = 10.0


def check_file(
    path: str | None,
    inputs: Sequence[str],
    is_own: Callable[[Path], bool],
    kind: str,
    force: bool,
) -> None:
    """
    Refuse an output file that cannot be written, or would replace something else.

    `path`: None for no output. `inputs`: files that the work reads. `is_own`: whether an existing
    file is of the `kind` that will be written. `force`: allow to replace any file. ConfigError has
    the reason.
    """
    if path is None:
        return
    _require_name(path)
    if is_stream(path):
        return
    require_writable(path)
    target = Path(os.path.realpath(path))
    if not target.exists() or force:
        return
    if any(os.path.exists(each) and os.path.samefile(each, target) for each in inputs):
        raise ConfigError(
            f'{path} is an input and would be replaced; name another output, or give --force.'
        )
    if target.stat().st_size and not is_own(target):
        raise ConfigError(
            f'{path} exists and is not {kind}; name another output, or give --force to replace it.'
        )


def check_json(path: str | None, inputs: Sequence[str], force: bool) -> None:
    """Refuse a place of `--json` as `check_file` does; standard output is one."""
    if path != DASH:
        check_file(path, inputs, is_json, 'a JSON object', force)


def check_distinct(*paths: str | None) -> None:
    """Refuse two outputs at one place by a ConfigError: the second would replace the first."""
    places: dict[str, str] = {}
    for path in paths:
        if path is None or path == DASH:
            continue
        _require_name(path)
        place = os.path.realpath(path)
        if place in places:
            raise ConfigError(
                f'every output needs a file of its own, but {places[place]} and {path} are one; '
                'name another.'
            )
        places[place] = path


def check_folder(folder: str | None, force: bool) -> None:
    """Refuse a report's folder that cannot be made, or holds other files and not `force`."""
    if folder is None:
        return
    _require_name(folder)
    path = Path(folder)
    if not path.exists():
        return
    if not path.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), folder)
    if not force and any(path.iterdir()) and not _is_report(path):
        raise ConfigError(
            f'{folder} is not empty and has no report of lip_id; name another folder, or give '
            '--force to write into it.'
        )


def is_json(path: Path) -> bool:
    """Whether a file is a JSON object, as every `--json` writes."""
    try:
        return isinstance(json.loads(path.read_bytes()), dict)
    except (ValueError, RecursionError):
        return False


def is_page(path: Path) -> bool:
    """Whether a file is a page of this package."""
    from lip_id_ros.evaluation.report.page import MAKER

    with open(path, 'rb') as file:
        return MAKER.encode() in file.read(1000)


def console(json_target: str | None = None) -> Console:
    """Return where tables go: standard output, or standard error where JSON takes that."""
    stream = sys.stderr if json_target == DASH else sys.stdout
    width = None if stream.isatty() else PLAIN_WIDTH
    return Console(stderr=stream is sys.stderr, width=width, highlight=False)


def write_json(target: str | None, content: Mapping[str, Any]) -> None:
    """Write figures without nan as JSON to a file, '-' for standard output, None for nowhere."""
    if target is None:
        return
    text = json.dumps(dict(content), indent=2, allow_nan=False) + '\n'
    if target == DASH:
        sys.stdout.write(text)
        return
    write_whole(target, text.encode())


@contextmanager
def progress_display() -> Iterator[Progress]:
    """Yield a progress callback that shows bars, or lines, on standard error."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Lines(sys.stderr)
        return
    columns = (TextColumn('{task.description:<24}'), BarColumn(), MofNCompleteColumn())
    times = _Rate(), TimeElapsedColumn(), TimeRemainingColumn()
    with Bars(*columns, *times, console=console, transient=True) as bars:
        yield _Stages(bars)


class Lines:
    """One line for each stage, then at most one every ten seconds; a stage may begin anew."""

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream = stream
        self._clock = clock
        self._last = clock()
        self._lines: set[str] = set()
        self._begun: dict[str, tuple[float, int]] = {}
        self._done: dict[str, int] = {}

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Take a report."""
        line = f'{stage}: {done} of {total}' if total else stage
        now = self._clock()
        if done < self._done.get(stage, 0):
            self._begun[stage] = now, done
            self._lines = {each for each in self._lines if not each.startswith(f'{stage}: ')}
        self._done[stage] = done
        is_new_stage = stage not in self._lines
        if line in self._lines or not (is_new_stage or now - self._last >= QUIET_SECONDS):
            return
        self._lines |= {stage, line}
        self._last = now
        begun, first = self._begun.setdefault(stage, (now, done))
        if total and done > first:
            rate = (done - first) / (now - begun)
            line += f', {(total - done) / rate:.0f} s left at most'
        print(stage if is_new_stage else line, file=self._stream, flush=True)


class _Rate(ProgressColumn):
    def render(self, task: Task) -> Text:
        return Text('' if task.speed is None else f'{task.speed:.3g}/s')


class _Stages:
    """One bar per stage, in the order in which they report."""

    def __init__(self, bars: Bars) -> None:
        self._bars = bars
        self._tasks: dict[str, TaskID] = {}
        self._done: dict[str, int] = {}

    def __call__(self, stage: str, done: int, total: int) -> None:
        if stage not in self._tasks:
            self._tasks[stage] = self._bars.add_task(stage, total=None)
        task = self._tasks[stage]
        if done < self._done.get(stage, 0):  # the stage begins anew
            self._bars.reset(task)
        self._done[stage] = done
        self._bars.update(task, completed=done, total=total or None)


def _require_name(path: str) -> None:
    if path in ('', DASH) or '\0' in path:
        raise ConfigError(f'an output must have a name without NUL, but {path!r} came; name it.')


def _is_report(folder: Path) -> bool:
    from lip_id_ros.evaluation.report.page import INDEX

    index = folder / INDEX
    return index.is_file() and is_page(index)
