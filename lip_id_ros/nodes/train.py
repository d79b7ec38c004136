"""Node `train`: records joint_states, fits and saves on service calls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import asdict
from functools import partial
import sys
import time
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from lip_id_ros.acquisition.job import in_words, Jobs, Task
from lip_id_ros.acquisition.recorder import DISTURBED_S, Recorder
from lip_id_ros.acquisition.settings import (
    check_together,
    fit_values,
    own_values,
    require_writable,
    train_parameters,
    TrainSettings,
)
from lip_id_ros.errors import ConfigError, DataError, LipIdError
from lip_id_ros.nodes import qos, running
from lip_id_ros.nodes.description import Description
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.running import outcome
from lip_id_ros.recording.joint_messages import from_joint_state
from lip_id_ros.settings.settings import WHILE_EMPTY
from lip_id_ros.signals.status import Level, Status

PATHS = {
    'fit': ('model_path',),
    'payload': ('payload_path', 'payload_model_path'),
    'dataset': ('dataset_path',),
}
"""Parameters that name the files of a job; the first is that of its result."""


class TrainNode(NodeBase):
    """Recorder and trainer; ConfigError if the parameters contradict each other."""

    def __init__(self, **options: Any) -> None:
        super().__init__('train', train_parameters(), **options)
        check_together(self.values())
        require_writable('unsaved_path', self._settings().unsaved_path)
        self._jobs = Jobs()
        self._reported = self._alarming_before = 0
        self._recorder = self._new_recorder(self._settings().record_on_start)
        self._subscription = self.create_subscription(
            JointState, 'joint_states', self._on_joint_state, qos.SENSOR_STREAM
        )
        self._description = Description(self)
        self._make_services()

    def stop(self) -> None:
        """
        Record what has arrived, keep what was recorded, then end the job that is running.

        LipIdError if a part of the recording cannot be written.
        """
        self.take_waiting(self._subscription)
        path = self._settings().unsaved_path
        try:
            kept = self._recorder.keep_unsaved(path, self._topic)
            if kept:
                files = ', '.join(map(str, kept))
                self.get_logger().info(f'kept {len(self._recorder)} unsaved samples in {files}')
        finally:
            self._jobs.stop()

    def _make_services(self) -> None:
        self.create_service(SetBool, '~/record', self._on_record)
        for name, work in (
            ('end_disturbed', self._end_disturbed),
            ('fit', lambda: self._begin('fit')),
            ('payload', lambda: self._begin('payload')),
            ('cancel', lambda: f'cancelled the {self._jobs.cancel()}'),
            ('clear', self._clear),
        ):
            self.create_service(Trigger, f'~/{name}', partial(self._on_trigger, work))
        own_group = MutuallyExclusiveCallbackGroup()
        self.create_service(
            Trigger, '~/save_dataset', self._on_save_dataset, callback_group=own_group
        )

    @property
    def _topic(self) -> str:
        topic: str = self._subscription.topic_name
        return topic

    # parameters

    def check_change(self, values: Mapping[str, Any]) -> None:
        """Refuse what contradicts other parameters, and other joints while samples are kept."""
        for name in values:
            if self._is_of_recorder(name) and len(self._recorder) > 0:
                raise ConfigError(f'{name} cannot change while samples are kept; call clear.')
        check_together({**self.values(), **values})
        if 'unsaved_path' in values:
            require_writable('unsaved_path', values['unsaved_path'])

    def apply_change(self, values: Mapping[str, Any]) -> None:
        """Record anew where the joints or the bound of the recording changed."""
        if any(map(self._is_of_recorder, values)):
            self._recorder = self._new_recorder(self._recorder.recording)

    def _is_of_recorder(self, name: str) -> bool:
        return train_parameters()[name].applies == WHILE_EMPTY

    def _settings(self) -> TrainSettings:
        return TrainSettings(**own_values(self.values()))

    def _new_recorder(self, recording: bool) -> Recorder:
        values = self.values()
        made = Recorder(values['recording.joints'], values['max_rows'])
        made.recording = recording
        return made

    # messages and services

    def _on_joint_state(self, message: JointState) -> None:
        self._recorder.add(from_joint_state(message))

    def _on_record(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._recorder.recording = request.data
        state = 'recording' if request.data else 'stopped'
        return self._answer(response, True, f'{state}, {len(self._recorder)} samples kept')

    def _on_trigger(
        self, work: Callable[[], str], request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Answer with what work has done, or why it was refused."""
        try:
            return self._answer(response, True, work())
        except LipIdError as error:
            return self._answer(response, False, str(error))

    def _end_disturbed(self) -> str:
        self._recorder.end_disturbed()
        return f'stopped; fits leave out the last {DISTURBED_S:g} s of the recording'

    def _clear(self) -> str:
        text = f'forgot {len(self._recorder)} samples'
        self._recorder.clear()
        return text

    def _begin(self, kind: str) -> str:
        """Begin a job; return its number, by which ~/status has its result."""
        self._start(kind)
        sources = in_words(len(self._recorder), self._settings().bags)
        number = self._jobs.state.number
        return f'job {number}: {kind} of {sources}; ~/status has its end under results.{number}'

    async def _on_save_dataset(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        try:
            work, saved = self._start('dataset')
            result = await outcome(self, work)
        except (LipIdError, OSError) as error:
            return self._answer(response, False, str(error))
        parts = [f'{result["n_samples"]} samples in {result["path"]}']
        if result['thinned'] or result['left_out']:
            parts.append('the recording has more than these')
        else:  # what is not all of the recording does not save it: it is kept when the node ends
            saved()
        return self._answer(response, True, '; '.join(parts))

    def _start(self, kind: str) -> tuple[Future[Mapping[str, Any]], Callable[[], None]]:
        """Start a job; return its future, and what to call once saved."""
        values = self.values()
        for name in PATHS[kind]:
            if values[name] or name != 'payload_model_path':
                require_writable(name, values[name])
        sections = self._recorder.samples(self._topic)
        if not sections and not values['bags']:
            raise DataError(self._recorder.why_empty(self._topic))
        task = Task(
            kind,
            self._fit_values(kind, values),
            values[PATHS[kind][0]],
            bags=values['bags'],
            holdout=values['holdout'],
            model=values['model_path'],
            payload_model=values['payload_model_path'],
            flange=(values['payload_flange_shift'], values['payload_flange_turn']),
        )
        return self._jobs.start(task, sections), self._recorder.saving(sections)

    def _fit_values(self, kind: str, values: Mapping[str, Any]) -> Mapping[str, Any]:
        found = fit_values(values)
        if kind != 'fit' or not values['use_robot_description']:
            return found
        text = self._description.require('use_robot_description', 'switch that off')
        return {**found, 'fit.description': text}

    def _answer(self, response: Any, success: bool, text: str) -> Any:
        self.publish_status()
        response.success = success
        response.message = text
        return response

    # status

    def status(self) -> Status:
        """Return what is recorded and where the job stands."""
        job = self._jobs.state
        unheard = self._recorder.trouble(self._topic, time.monotonic())
        if unheard:
            self.warn(unheard, unheard)
        endangered = self._recorder.endangered(self._settings().unsaved_path)
        troubles = [each for each in (unheard, endangered) if each]
        self._report()
        work = f', {job.task} {job.state}' if job.state != 'idle' else ''
        summary = '; '.join([self._recorder.summary + work, *troubles])
        results = {str(number): each.brief for number, each in self._jobs.ended.items()}
        values = {**self._recorder.status(), 'job': asdict(job), 'results': results}
        alarming = self._recorder.n_alarming + self._recorder.gaps.count
        rose, self._alarming_before = alarming > self._alarming_before, alarming
        warns = rose or self._recorder.is_full or troubles
        level = Level.ERROR if job.state == 'failed' else Level.WARN if warns else Level.OK
        return Status(level, summary, values)

    def _report(self) -> None:
        """Log jobs that have ended."""
        for number, job in self._jobs.ended.items():
            if number <= self._reported:
                continue
            self._reported, logger = number, self.get_logger()
            if job.state == 'failed':
                logger.error(f'{job.task} failed: {job.error}')
            elif job.state == 'done':
                logger.info(f'{job.task} done: {job.result["path"]}')
            for sentence in [*job.result.get('left_out', ()), *job.result.get('cautions', ())]:
                logger.warning(sentence)


def main() -> int:
    """Run the node `train`."""
    return running.run(TrainNode)


if __name__ == '__main__':
    sys.exit(main())
