"""A fit, or the making of a data set, in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
import json
import subprocess
import sys
from typing import Any, IO

from lip_id_ros.errors import LipIdError
from lip_id_ros.processes import end


@dataclass(frozen=True)
class Task:
    """
    What is asked of a job.

    Attributes
    ----------
    kind : str
        'fit' or 'dataset'.
    settings : mapping
        Settings of a fit by ``section.name``.
    path : str
        Where the result is saved.
    bags : sequence of str
        Recordings and data sets that are used as well.
    holdout : float
        Share of the samples that is kept out of a fit, to judge it by.
    niceness : int
        How much it gives way to other processes.

    """

    kind: str
    settings: Mapping[str, object]
    path: str
    bags: Sequence[str] = ()
    holdout: float = 0.0
    niceness: int = 0


@dataclass(frozen=True)
class JobState:
    """
    Where a job stands.

    Attributes
    ----------
    task : str
        'fit' or 'dataset'; 'none' before the first.
    state : str
        'idle', 'running', 'done' or 'failed'.
    stage, done, total
        The last progress; `total` is 0 while it is not known.
    result : mapping
        What the process reported when it was done.
    error : str
        One sentence when it failed.

    """

    task: str = 'none'
    state: str = 'idle'
    stage: str = ''
    done: int = 0
    total: int = 0
    result: Mapping[str, Any] = field(default_factory=dict)
    error: str = ''


class Job:
    """
    One run of `job_process`.

    A process, not a thread: the interpreter stays free for messages, and a crash stays there. It
    gets a session of its own, so that Ctrl-C in a terminal reaches it only through the node.

    Parameters
    ----------
    task : Task
    recording : str
        Folder of the samples.

    """

    def __init__(self, task: Task, recording: str) -> None:
        request = json.dumps({**asdict(task), 'recording': recording})
        self.state = started(task)
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'lip_id_ros.acquisition.job_process', request],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def wait(self) -> Mapping[str, Any]:
        """
        Follow the process to its end.

        Returns
        -------
        mapping
            Its result.

        Raises
        ------
        LipIdError
            With the sentence of its failure.

        """
        if self._process.stdout is not None:
            self._follow(self._process.stdout)
        status = self._process.wait()
        if self.state.state == 'running':
            error = f'the process of the {self.state.task} ended with status {status}.'
            self.state = replace(self.state, state='failed', error=error)
        if self.state.state == 'failed':
            raise LipIdError(self.state.error)
        return self.state.result

    def stop(self) -> None:
        """End the process; what it had not saved is not saved."""
        end(self._process)

    def _follow(self, lines: IO[str]) -> None:
        for line in lines:
            self.state = advanced(self.state, line)


def in_words(n_samples: int, bags: Sequence[str]) -> str:
    """Name the sources of a data set: '300 samples and a.mcap, b.mcap'."""
    recorded = [f'{n_samples} samples'] if n_samples or not bags else []
    return ' and '.join([*recorded, *([', '.join(bags)] if bags else [])])


def started(task: Task) -> JobState:
    """Return the state of a job that has just begun."""
    return JobState(task.kind, 'running', 'start')


def advanced(state: JobState, line: str) -> JobState:
    """Return the state after a line of the process; lines that are not JSON change nothing."""
    try:
        content = json.loads(line)
    except json.JSONDecodeError:  # a library printed something
        return state
    if 'progress' in content:
        stage, done, total = content['progress']
        return replace(state, stage=stage, done=done, total=total)
    if 'result' in content:
        return replace(state, state='done', result=content['result'])
    return replace(state, state='failed', error=content['error'])
