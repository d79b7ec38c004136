"""Jobs of `train` (fit, data set, payload) and `excite` (motion), each in a process of its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any, cast, TextIO

import numpy as np

from lip_id_ros.errors import LipIdError
from lip_id_ros.files import HEADER, read_npz, scratch_folder
from lip_id_ros.progress import end, STOP_SECONDS
from lip_id_ros.recording import JointSamples

_ARRAYS = ('t', 'position', 'velocity', 'effort')

SAVING = 'result saved'
"""Stage of a job in which it can no longer be cancelled."""

MOST_RESULTS = 10
"""Of jobs that have ended, which are found by their numbers."""


@dataclass(frozen=True)
class Task:
    """
    The request of a job: 'fit', 'dataset', 'payload' or 'motion'.

    `settings`: of a fit by ``section.name``, or the fields of a `MotionRequest`. `bags`:
    recordings and data sets that are used as well. `holdout`: share of the samples that is kept
    out of a fit. `model`: file of the arm whose payload is sought. `payload_model`: where the
    model with the payload is saved; empty for nowhere. `flange`: its frame, as in
    `export.payload`.
    """

    kind: str
    settings: Mapping[str, object]
    path: str
    bags: Sequence[str] = ()
    holdout: float = 0.0
    model: str = ''
    payload_model: str = ''
    flange: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class JobState:
    """
    Where a job stands.

    `task`: 'none' before the first. `state`: 'idle', 'running', 'done', 'failed' or 'cancelled'.
    `total` is 0 while it is not known. `error`: one sentence when it failed. `number`: of jobs so
    far.
    """

    task: str = 'none'
    state: str = 'idle'
    stage: str = ''
    done: int = 0
    total: int = 0
    result: Mapping[str, Any] = field(default_factory=dict)
    error: str = ''
    number: int = field(default=0, compare=False)

    @property
    def brief(self) -> dict[str, str]:
        """How it has ended."""
        path = self.result.get('path', '')
        return {'task': self.task, 'state': self.state, 'path': path, 'error': self.error}


def in_words(n_samples: int, bags: Sequence[str]) -> str:
    """Name the sources of a data set: '300 samples and a.mcap, b.mcap'."""
    recorded = [f'{n_samples} samples'] if n_samples or not bags else []
    return ' and '.join([*recorded, *([', '.join(bags)] if bags else [])])


def advanced(state: JobState, line: str) -> JobState:
    """Return the state after a line of the process; lines that are not its own change nothing."""
    try:
        content = json.loads(line)
    except (ValueError, RecursionError):
        content = None
    match content:
        case {'progress': [str(stage), int(done), int(total)]}:
            return replace(state, stage=stage, done=done, total=total)
        case {'result': dict(result)}:
            return replace(state, state='done', result=result)
        case {'error': str(error)}:
            return replace(state, state='failed', error=error)
    return state  # a library printed something


def pass_on(folder: str | os.PathLike[str], sections: Sequence[JointSamples]) -> None:
    """Write samples for `receive` into an empty folder, with the interpreter free."""
    try:
        for number, samples in enumerate(sections):
            _write(Path(folder) / f'{number}.npz', samples)
    except OSError as error:
        raise LipIdError(
            f'the samples must be written to {folder} for the job, but cannot be '
            f'({error.strerror or error}); they are still in memory. Free that disk, or start the '
            'node with TMPDIR set to another.'
        ) from error


def _write(path: Path, samples: JointSamples) -> None:
    header: dict[str, Any] = {
        'joint_names': samples.joint_names,
        'start_ns': samples.start_ns,
        'counts': dict(samples.counts),
        'source': samples.source,
        'topic': samples.topic,
    }
    arrays: dict[str, Any] = {name: getattr(samples, name) for name in _ARRAYS}
    with open(path, 'wb') as file:
        np.savez(file, **{HEADER: np.array(json.dumps(header)), **arrays})


def receive(folder: str | os.PathLike[str]) -> list[JointSamples]:
    """Read what `pass_on` wrote."""
    files = sorted(Path(folder).iterdir(), key=lambda path: int(path.stem))
    return [_read(path) for path in files]


def _read(path: Path) -> JointSamples:
    arrays, header = read_npz(path)
    fields: dict[str, Any] = {**arrays, **header, 'joint_names': tuple(header['joint_names'])}
    return JointSamples(**fields)


class Jobs:
    """
    Run jobs, one after the other, each in a process of its own; `ended`: the last, by number.

    A process, not a thread: the interpreter stays free for messages, and a crash stays there. It
    gets a session of its own, so that Ctrl-C in a terminal reaches it only through the node.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix='jobs')
        self._process: subprocess.Popen[str] | None = None
        self._cancelled = False
        self._work: Future[Mapping[str, Any]] | None = None
        self.state = JobState()
        self.ended: dict[int, JobState] = {}

    def start(self, task: Task, sections: Sequence[JointSamples]) -> Future[Mapping[str, Any]]:
        """
        Start a job and return its future result; LipIdError if another is running.

        `sections`: the recorded samples; may be none where the task names bags.
        """
        if self.state.state == 'running':
            raise LipIdError(f'a {self.state.task} is running; wait until ~/status shows its end.')
        self._cancelled = False
        self.state = JobState(task.kind, 'running', 'start', number=self.state.number + 1)
        self._work = self._pool.submit(self._run, task, sections)
        return self._work

    def cancel(self) -> str:
        """
        End the job that is running, of which nothing is saved, and return what it was.

        LipIdError if none is running, or it saves its result or has ended by itself.
        """
        if self._work is None or self.state.state != 'running':
            raise LipIdError('no fit or data set is running.')
        self._end()
        wait([self._work], STOP_SECONDS)
        ended = self.state
        if ended.state in ('done', 'failed') or self._is_saving():
            raise LipIdError(f'it is too late to cancel the {ended.task}; ~/status has its end.')
        return ended.task

    def stop(self) -> None:
        """End the job that is running, unless it saves its result, and take no other."""
        self._end()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _end(self) -> None:
        self._cancelled = True
        if self._process is not None:
            end(self._process, self._is_saving)

    def _is_saving(self) -> bool:
        return self.state.stage == SAVING

    def _run(self, task: Task, sections: Sequence[JointSamples]) -> Mapping[str, Any]:
        try:
            with scratch_folder() as folder:
                pass_on(folder, sections)
                outcome = self._follow(task, folder)
        except Exception as error:  # whatever it was, nothing is running any more
            self._end_as(replace(self.state, state='failed', error=str(error)))
            raise
        self._end_as(outcome)
        if outcome.state == 'cancelled':
            raise LipIdError(f'the {outcome.task} was cancelled.')
        if outcome.state == 'failed':
            raise LipIdError(outcome.error)
        return outcome.result

    def _end_as(self, state: JobState) -> None:
        latest = [*self.ended.items(), (state.number, state)][-MOST_RESULTS:]
        self.ended, self.state = dict(latest), state

    def _follow(self, task: Task, folder: str) -> JobState:
        """Run `job_process`; return the last state once the process has ended."""
        state = self.state
        with subprocess.Popen(
            [sys.executable, '-P', '-m', 'lip_id_ros.acquisition.job_process'],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        ) as self._process:
            if self._cancelled:
                end(self._process)
            # not an argument, which has 128 kB at most: a robot description may be longer
            with suppress(BrokenPipeError), cast('TextIO', self._process.stdin) as requests:
                json.dump({**asdict(task), 'recording': folder}, requests)
            for line in self._process.stdout or ():
                state = advanced(state, line)
                if state.state == 'running':
                    self.state = state
        if state.state != 'running':
            return state
        if self._cancelled:
            return replace(state, state='cancelled')
        error = f'the process of the {task.kind} ended with status {self._process.returncode}.'
        return replace(state, state='failed', error=error)
