"""Fits and data sets, each in a process of its own, one at a time, beside everything else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, field, replace
import json
import subprocess
import sys
import tempfile
from typing import Any, IO

from lip_id_ros.acquisition.recording_file import pass_on
from lip_id_ros.errors import LipIdError
from lip_id_ros.processes import end
from lip_id_ros.recording import JointSamples


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
        'idle', 'running', 'done', 'failed' or 'cancelled'.
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
        self._cancelled = False
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
            With the sentence of its failure, or if it was stopped.

        """
        if self._process.stdout is not None:
            self._follow(self._process.stdout)
        status = self._process.wait()
        if self.state.state == 'running' and self._cancelled:
            self.state = replace(self.state, state='cancelled')
            raise LipIdError(f'the {self.state.task} was cancelled.')
        if self.state.state == 'running':
            error = f'the process of the {self.state.task} ended with status {status}.'
            self.state = replace(self.state, state='failed', error=error)
        if self.state.state == 'failed':
            raise LipIdError(self.state.error)
        return self.state.result

    def stop(self) -> None:
        """End the process; what it had not saved is not saved."""
        self._cancelled = True
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


def _pass_on(folder: str, sections: Sequence[JointSamples]) -> None:
    try:
        pass_on(folder, sections)
    except OSError as error:
        raise LipIdError(
            f'the samples must be written to {folder} for the job, but cannot be '
            f'({error.strerror or error}); they are still in memory. Free that disk, or start the '
            'node with TMPDIR set to another.'
        ) from error


class Jobs:
    """Run jobs, one after the other."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix='jobs')
        self._job: Job | None = None
        self._state = JobState()
        self._cancelled = False

    @property
    def state(self) -> JobState:
        """Where the last job stands."""
        return self._job.state if self._job else self._state

    def start(self, task: Task, sections: Sequence[JointSamples]) -> Future[Mapping[str, Any]]:
        """
        Start a job; returns at once.

        Parameters
        ----------
        task : Task
        sections : sequence of JointSamples
            What was recorded; may be none where the task names bags.

        Returns
        -------
        Future
            Of the job's result.

        Raises
        ------
        LipIdError
            If another job is running.

        """
        if self.state.state == 'running':
            raise LipIdError(f'a {self.state.task} is running; wait until ~/status shows its end.')
        self._job = None
        self._cancelled = False
        self._state = started(task)
        return self._pool.submit(self._run, task, sections)

    def cancel(self) -> str:
        """
        End the job that is running; return which it was.

        Raises
        ------
        LipIdError
            If none is running.

        """
        state = self.state
        if state.state != 'running':
            raise LipIdError('no fit or data set is running.')
        self._cancelled = True
        if self._job is not None:
            self._job.stop()
        return state.task

    def stop(self) -> None:
        """End the job that is running, and take no other."""
        self._cancelled = True
        if self._job is not None:
            self._job.stop()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _run(self, task: Task, sections: Sequence[JointSamples]) -> Mapping[str, Any]:
        try:
            with tempfile.TemporaryDirectory(prefix='lip_id_ros_') as folder:
                _pass_on(folder, sections)
                self._job = Job(task, folder)
                if self._cancelled:
                    self._job.stop()
                return self._job.wait()
        except Exception as error:  # whatever it was, nothing is running any more
            if self.state.state == 'running':
                self._job = None
                self._state = replace(self._state, state='failed', error=str(error))
            raise
