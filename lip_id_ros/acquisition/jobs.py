"""One job at a time, beside everything else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
import tempfile
from typing import Any

from lip_id_ros.acquisition.job import Job, JobState, started, Task
from lip_id_ros.acquisition.recording_file import hand_over
from lip_id_ros.errors import LipIdError
from lip_id_ros.recording import JointSamples


class Jobs:
    """Runs jobs, one after the other, and knows where the last one stands."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix='jobs')
        self._job: Job | None = None
        self._state = JobState()
        self._stopped = False

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
        self._state = started(task)
        return self._pool.submit(self._run, task, sections)

    def stop(self) -> None:
        """End the job in hand."""
        self._stopped = True
        if self._job is not None:
            self._job.stop()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def _run(self, task: Task, sections: Sequence[JointSamples]) -> Mapping[str, Any]:
        try:
            with tempfile.TemporaryDirectory(prefix='lip_id_ros_') as folder:
                hand_over(folder, sections)
                self._job = Job(task, folder)
                if self._stopped:
                    self._job.stop()
                return self._job.wait()
        except Exception as error:  # whatever it was, nothing is running any more
            self._job = None
            self._state = replace(self._state, state='failed', error=str(error))
            raise
