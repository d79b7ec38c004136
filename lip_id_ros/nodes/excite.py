"""Node `excite`: designs motions, has them executed, and has `train` learn of each."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from enum import StrEnum
import sys
import time
from typing import Any

from control_msgs.msg import DynamicJointState
import numpy as np
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from lip_id_ros.acquisition.job import Jobs, Task
from lip_id_ros.arrays import Array
from lip_id_ros.errors import ConfigError, LipIdError
from lip_id_ros.excitation.rounds import Measured, MotionRequest, MotionWatch, NextMotion, numbered
from lip_id_ros.excitation.settings import RoundSettings
from lip_id_ros.excitation.trajectory_file import writer_for
from lip_id_ros.nodes import messages, qos, running
from lip_id_ros.nodes.controller import LONGEST_ANSWER_S
from lip_id_ros.nodes.description import Description
from lip_id_ros.nodes.motion_goal import HaltError, MotionGoal
from lip_id_ros.nodes.node import NodeBase
from lip_id_ros.nodes.running import outcome
from lip_id_ros.nodes.trainer import Trainer
from lip_id_ros.settings import parameters_of
from lip_id_ros.signals.joints import by_joint
from lip_id_ros.signals.status import Level, Status
from lip_id_ros.signals.torque_steps import limits_in_force, require_limits

TICK_S = 0.02

LEAST_SETTLED_S = 0.5
"""Recorded after each motion, so that `train` has its end."""


class Stage(StrEnum):
    """What the node does."""

    IDLE = 'idle'
    DESIGN = 'designing'
    LEAVE = 'waiting for confirm'
    MOVE = 'moving'
    FIT = 'fitting'
    DONE = 'done'
    STOPPED = 'stopped'


ENDED = Stage.IDLE, Stage.DONE, Stage.STOPPED


class ExciteNode(NodeBase):
    """Motions, one after the other; ConfigError if a parameter is missing or wrong."""

    def __init__(self, **options: Any) -> None:
        super().__init__('excite', parameters_of(RoundSettings), **options)
        self._settings = settings = RoundSettings(**self.values())
        _require(settings)
        self._stage, self._sentence = Stage.IDLE, 'call ~/start'
        self._round, self._size, self._model_path = 0, 0.0, settings.model_path
        self._deviations: list[tuple[float, ...]] = []
        self._measured = Measured(settings.stale_timeout_s)
        self._heard_at = self._contact_heard_at = -np.inf
        self._watch: MotionWatch | None = None
        self._moves = self._monitored = False
        self._pending: Future | None = None
        self._leave: Future | None = None  # while somebody is asked to confirm
        self._halted: str | None = None
        self._names: tuple[str, ...] = ()
        self._limit = np.inf, ''
        self._rest: Future | None = None  # while the last joint states come
        self._settled_at = np.inf
        self._jobs = Jobs()
        self._description = Description(self) if settings.use_robot_description else None
        self._mover = MotionGoal(
            self, settings.controller_action, self._measured_now, self.publish_status
        )
        self._trainer = Trainer(self, settings.trainer)
        self.create_subscription(
            JointState, 'joint_states', self._on_joint_state, qos.SENSOR_STREAM
        )
        self.create_subscription(
            DynamicJointState, 'monitor/contact', self._on_contact, qos.OUTPUT
        )
        self.create_service(Trigger, '~/start', self._on_start)
        self.create_service(Trigger, '~/confirm', self._on_confirm)
        self.create_service(Trigger, '~/stop', self._on_stop)
        self.create_steady_timer(TICK_S, self._on_tick)

    def stop(self) -> None:
        """End the motion and the design that are running."""
        self._halt('the node ends')
        self._mover.stop()
        if self._moves:
            self._trainer.end(disturbed=True)
        self._jobs.stop()

    def status(self) -> Status:
        """Return the stage, the motions so far, and how the deviations fall."""
        level = Level.ERROR if self._stage is Stage.STOPPED else Level.OK
        values = {
            'stage': self._stage.value,
            'round': self._round,
            'size': self._size,
            'model_path': self._model_path,
            'deviation_percent': [list(each) for each in self._deviations],
            'held': dict(self._mover.held),
            'design': {'stage': self._jobs.state.stage, 'done': self._jobs.state.done},
        }
        return Status(level, f'{self._stage}: {self._sentence}{self._mover.doubt}', values)

    # the motions

    async def _run(self) -> None:
        """Design, move and fit, until all motions are done or one is stopped."""
        try:
            for number in range(1, self._settings.rounds + 1):
                self._round = number
                motion = await self._designed(number)
                if self._is_enough(motion):
                    self._round = number - 1
                    break
                await self._confirmed(motion)
                await self._moved(motion)
                self._enter(Stage.FIT, f'motion {number} of {self._settings.rounds}')
                self._model_path = await self._trainer.fitted(self._until)
                self._size = motion.size
        except (LipIdError, OSError) as error:
            self._enter(Stage.STOPPED, str(error))
            self.get_logger().error(f'stopped: {error}')
            return
        except Exception as error:
            self._enter(Stage.STOPPED, 'an error of this node; see its log')
            self.caught(error)
            return
        self._enter(Stage.DONE, f'{self._round} motions; the model is {self._model_path}')

    def _enter(self, stage: Stage, sentence: str) -> None:
        self._stage, self._sentence = stage, sentence
        self.publish_status()

    async def _designed(self, number: int) -> NextMotion:
        self._enter(Stage.DESIGN, f'motion {number} of {self._settings.rounds}')
        urdf = ''
        if self._description is not None:
            urdf = self._description.require('use_robot_description', 'switch that off')
        report = self._settings.report_path
        request = MotionRequest(
            self._settings.config_path,
            urdf,
            self._model_path,
            self._size,
            self._settings.first_size,
            dict(self._measured.positions),
            report and numbered(report, number),
        )
        path = numbered(self._settings.motion_path, number)
        work = self._jobs.start(Task('motion', asdict(request), path), [])
        result = await self._until(outcome(self, work))
        motion = NextMotion.from_json(result['motion'])
        if motion.deviation_percent:
            self._deviations.append(motion.deviation_percent)
        return motion

    def _is_enough(self, motion: NextMotion) -> bool:
        deviations = motion.deviation_percent
        return bool(deviations) and max(deviations) < self._settings.enough_percent

    async def _confirmed(self, motion: NextMotion) -> None:
        """Ask for leave, where nothing speaks against the motion already."""
        names = motion.trajectory.joint_names
        warning = await self._mover.require_joints(names, self._until)
        if (reason := self._measured.reason_not_to_watch(names, time.monotonic())) is not None:
            raise HaltError(reason)
        sentences = ' '.join([*motion.sentences, *filter(None, [warning])])
        if not self._settings.confirm:
            self.get_logger().info(f'motion {self._round}: {sentences}')
            return
        self._enter(
            Stage.LEAVE,
            f'motion {self._round} of {self._settings.rounds} takes '
            f'{motion.trajectory.t[-1]:.3g} s, at {motion.size:.3g} of all limits. {sentences} '
            'Call ~/confirm or ~/stop',
        )
        self._leave = Future(executor=self.executor)
        try:
            await self._until(self._leave)
        finally:
            self._leave = None

    async def _moved(self, motion: NextMotion) -> None:
        """Execute a motion while `train` records."""
        names = motion.trajectory.joint_names
        watch, disturbed = self._watched(motion), False
        self._require_posture(watch.posture, names)
        if (missing := self._mover.missing()) is not None:
            raise HaltError(missing)
        await self._mover.require_joints(names, self._until)  # another one may have come
        try:
            await self._trainer.record(self._until)
            await self._executed(motion, watch)
            await self._settled()
        except HaltError:
            disturbed = self._moves
            raise
        finally:
            self._moves, self._watch = False, None
            self._trainer.end(disturbed)

    async def _executed(self, motion: NextMotion, watch: MotionWatch) -> None:
        self._require_posture(watch.posture, motion.trajectory.joint_names)  # now too
        self._enter(Stage.MOVE, f'motion {self._round} of {self._settings.rounds}')
        self._names = motion.trajectory.joint_names
        self._heard_at = now = time.monotonic()
        self._monitored = now - self._contact_heard_at <= self._settings.stale_timeout_s
        self._watch, self._moves = watch, True  # the arm may move before the answer comes
        await self._mover.execute(motion.trajectory, self._until)
        self._watch = None
        if (reason := watch.reason_to_distrust()) is not None:
            raise HaltError(reason)

    async def _settled(self) -> None:
        """Wait for the last joint states of the motion."""
        self._settled_at = time.monotonic() + LEAST_SETTLED_S
        self._rest = Future(executor=self.executor)
        try:
            await self._until(self._rest)
        finally:
            self._rest = None

    # what halts them

    async def _until(self, awaited: Any, limit_s: float = np.inf, what: str = '') -> Any:
        """Await something, unless the motions are halted meanwhile: HaltError."""
        self._pending = pending = Future(executor=self.executor)
        self._limit = time.monotonic() + limit_s, what
        task = self.executor.create_task(_passing(awaited, pending))
        try:
            result = await pending
            if self._halted is not None:  # after it was done, and before this went on
                raise HaltError(self._halted)
            return result
        finally:
            self._pending = None
            task.cancel()

    def _halt(self, reason: str) -> None:
        """Halt the motion that runs, and end what is awaited."""
        self._mover.halt()
        self._watch, self._halted = None, self._halted or reason
        if self._pending is not None and not self._pending.done():
            self._pending.set_exception(HaltError(reason))

    def _on_tick(self) -> None:
        now = time.monotonic()
        lost = self._mover.watch(moving=self._watch is not None)
        if self._pending is not None and now > self._limit[0]:
            self._halt(f'{self._limit[1]} has not answered in {LONGEST_ANSWER_S:g} s')
        if self._rest is not None and now > self._settled_at and not self._rest.done():
            self._rest.set_result(None)
        if (silence := self._trainer.silence()) is not None:
            self._halt(silence)
        if self._watch is None:
            return
        most = self._settings.stale_timeout_s
        if now - self._heard_at > most:
            silence = f'{now - self._heard_at:.3g} s'
            self._halt(f'no joint state for {silence} that has all joints of the motion')
        elif self._monitored and now - self._contact_heard_at > most:
            self._halt(f'the monitor is silent for {now - self._contact_heard_at:.3g} s')
        elif lost is not None:
            self._halt(lost)

    def _on_joint_state(self, message: JointState) -> None:
        if len(message.position) != len(message.name):
            return  # of a publisher of something else
        now = time.monotonic()
        self._measured.take(message.name, message.position, now)
        if self._watch is None or not set(self._names) <= set(message.name):
            return
        self._heard_at = now
        column = [message.name.index(name) for name in self._names]
        q = [message.position[k] for k in column]
        has_effort = len(message.effort) == len(message.name)
        effort = [message.effort[k] for k in column] if has_effort else []
        reason = self._watch.reason_to_stop(self._mover.since_start(), q, effort)
        if reason is not None:
            self._halt(reason)

    def _on_contact(self, message: DynamicJointState) -> None:
        self._contact_heard_at = time.monotonic()
        if messages.any_joint(message, 'contact') and self._watch is not None:
            self._halt('the monitor has found a contact')

    def _measured_now(self, names: Sequence[str]) -> Array | None:
        return self._measured.now_at(names, time.monotonic())

    # services

    def _on_start(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._stage not in ENDED:
            return _answer(response, False, f'the node is {self._stage}; call ~/stop first')
        if not self._measured.positions:
            return _answer(response, False, 'no joint state has come; start the driver')
        self._mover.forget()
        self._halted = None
        self._enter(Stage.DESIGN, 'the first motion')
        self.executor.create_task(self._run())
        return _answer(response, True, 'designing the first motion; ~/status shows how it goes')

    def _on_confirm(
        self, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        if self._leave is None or self._leave.done():
            return _answer(response, False, f'nothing waits for this, the node is {self._stage}')
        self._leave.set_result(None)
        self._enter(Stage.MOVE, f'motion {self._round} of {self._settings.rounds} is confirmed')
        return _answer(response, True, 'the arm moves')

    def _on_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if self._stage in ENDED:
            return _answer(response, False, f'nothing runs, the node is {self._stage}')
        self._halt('~/stop was called')
        with suppress(LipIdError):
            self._jobs.cancel()
        return _answer(response, True, 'stopping; ~/status shows how it ends')

    def _watched(self, motion: NextMotion) -> MotionWatch:
        names, settings = motion.trajectory.joint_names, self._settings
        limits = limits_in_force(settings.effort_limits, settings.effort_limits_from)
        return MotionWatch(
            motion.trajectory,
            by_joint('tracking_tolerance', settings.tracking_tolerance, names, names, np.inf),
            by_joint('effort_limits', limits, names, names, np.inf),
        )

    def _require_posture(self, posture: Array, names: tuple[str, ...]) -> None:
        tolerance = by_joint(
            'start_tolerance', self._settings.start_tolerance, names, names, np.inf
        )
        reason = self._measured.reason_to_wait(names, posture, tolerance, time.monotonic())
        if reason is not None:
            raise HaltError(reason)


def _require(settings: RoundSettings) -> None:
    if not settings.controller_action:
        raise ConfigError(
            'controller_action must be the action FollowJointTrajectory of the controller that '
            'moves the arm; give it.'
        )
    writer_for(settings.motion_path)
    require_limits('effort_limits', settings.effort_limits, settings.effort_limits_from)


async def _passing(awaited: Any, pending: Future) -> None:
    """Hand what is awaited on to another future, unless that has ended."""
    try:
        result = await awaited
    except Exception as error:
        if not pending.done():
            pending.set_exception(error)
        return
    if not pending.done():
        pending.set_result(result)


def _answer(response: Any, success: bool, text: str) -> Any:
    response.success, response.message = success, text
    return response


def main() -> int:
    """Run the node `excite`."""
    return running.run(ExciteNode)


if __name__ == '__main__':
    sys.exit(main())
