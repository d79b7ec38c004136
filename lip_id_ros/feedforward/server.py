"""The way from a reference to a torque: check, ask the arm, or refuse and count."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lip_id_ros.adaptation.adapted_model import AdaptedModel
from lip_id_ros.arrays import Array
from lip_id_ros.feedforward import served_arm, shaping
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.refinement import RefinedPlan
from lip_id_ros.feedforward.served_arm import ServedArm, ServedTorque
from lip_id_ros.feedforward.settings import SafeValue, ServeSettings
from lip_id_ros.feedforward.status import ServeCounts
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import MeasuredState
from lip_id_ros.signals.joints import PlannedPoint, Point, Refusal, RefusedError
from lip_id_ros.signals.status import in_words, Level
from lip_id_ros.signals.torque_steps import Sent

COUNTED = (*shaping.COUNTED, *served_arm.COUNTED, 'stale')
"""Keys of ~/status: what the arm and its shaping count, and streams that fell silent."""

LARGEST_SPEED = 10.0
"""Controllers scale the time of a plan by less."""

LONGEST_UNSEEN_S = 0.5
"""A measured position counts for so long where references may stop for ever."""


class Server:
    """
    One arm or none, whether it answers, and counts of what was answered and refused.

    Every torque that leaves is finite and within its joint's limit. Times `now` are in seconds on
    any steady clock. A message that cannot be answered raises RefusedError and is counted.
    `is_contradicted`: whether references are not to be answered, since others contradict them.
    """

    def __init__(self) -> None:
        self.counts = ServeCounts(COUNTED)
        self.enabled = self.is_contradicted = False
        self._arm: ServedArm | None = None
        self._forget_stream()

    @property
    def active(self) -> bool:
        """Whether there is an arm."""
        return self._arm is not None

    @property
    def arm(self) -> ServedArm:
        """The arm; RefusedError where there is none."""
        if self._arm is None:
            raise RefusedError(Refusal.INACTIVE)
        return self._arm

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints of the model, none while there is none."""
        return self._arm.joint_names if self._arm else ()

    # the model and its rules

    def use(self, loaded: LoadedModel, settings: ServeSettings) -> None:
        """
        Answer with this model from now on, beginning at what the robot holds.

        Its joints are those served before, in their order, if there were any; ConfigError where
        the settings do not fit them.
        """
        if loaded.adapted is not None:
            loaded.adapted.begin_anew()  # what it followed when it was last served may be long ago
        sent = self._arm.shaper.sent if self._arm else Sent(np.zeros(len(loaded.joint_names)))
        self._arm = ServedArm(loaded, settings, self.counts.torques, sent)
        self._arm.shaper.begin()

    def adjust(self, settings: ServeSettings) -> None:
        """Use other settings; ConfigError where they do not fit the model's joints."""
        if self._arm is not None:
            self._arm.adjust(settings)

    def release(self) -> None:
        """Forget the model, after zero torque was published."""
        self._arm = None
        self.enabled = False
        self._forget_stream()

    def enable(self) -> None:
        """Answer references from now on, beginning at what the robot holds."""
        self.enabled = True
        if self._arm is not None:
            self._arm.shaper.begin()

    def disable(self, now: float) -> None:
        """Answer no more, after zero torque was published."""
        self.enabled = False
        self.rest(now)

    def rest(self, now: float) -> None:
        """Note that zero torque was published: the next reference is ramped in from there."""
        self._fed_at = -np.inf
        self._stale = self._ended = False
        if self._arm is not None:
            self._arm.shaper.rest(now)

    def _forget_stream(self) -> None:
        self._fed_at = -np.inf  # no reference is expected before the first
        self._stale = self._ended = False
        self._state: Array | None = None
        self._measured: MeasuredState | None = None
        self._measured_at = -np.inf
        self._was_measured = False

    # messages

    def sample(
        self,
        names: Sequence[str],
        points: Sequence[Point],
        now: float,
        age: float = 0.0,
        speed: float = 1.0,
    ) -> ServedTorque:
        """
        Answer a message of one point, sent `age` seconds ago.

        `speed`: of its time by that of its controller, which scales velocities by it and
        accelerations by its square.
        """
        try:
            arm = self._answering_arm(age, speed)
            with np.errstate(all='ignore'):
                served = arm.sample(names, points, now, speed)
        except Exception as error:
            self.counts.references.refuse_for(error)
            raise
        self._fed_at, self._state, self._stale, self._ended = now, served.state, False, False
        self.counts.references.used['samples'] += 1
        return served

    def plan(
        self,
        names: Sequence[str],
        points: Sequence[PlannedPoint],
        now: float,
        age: float = 0.0,
        speed: float = 1.0,
        late: float = 0.0,
    ) -> RefinedPlan:
        """
        Answer a message of many points, sent `age` seconds ago, in its order of joints.

        `late`: time since the stamp at which it begins [s], below zero before it.
        """
        with self.counts.references.refusing(), np.errstate(all='ignore'):
            arm = self._answering_arm(age, speed)
            found = arm.plan(names, points, self._here(now), speed, late)
        self.counts.references.used['plans'] += 1
        return found

    def end_stream(self) -> None:
        """Expect no further reference: a safe torque is due at once."""
        with self.counts.references.refusing():
            self.ready_arm()
        self._ended = bool(np.isfinite(self._fed_at))
        self.counts.references.used['plans'] += 1

    def _answering_arm(self, age: float, speed: float) -> ServedArm:
        """Return the arm; RefusedError where a reference of this age and speed has no answer."""
        arm = self.ready_arm()
        if self.is_contradicted:
            raise RefusedError(Refusal.SEVERAL_PUBLISHERS)
        if age > self._longest_silence_s:
            raise RefusedError(Refusal.OLD)
        if not 0.0 <= speed <= LARGEST_SPEED:
            raise RefusedError(Refusal.WRONG_SPEED)
        return arm

    @property
    def _longest_silence_s(self) -> float:
        return self.arm.shaper.rules.stale_timeout_s

    @property
    def _longest_unseen_s(self) -> float:
        silence = self._longest_silence_s
        return silence if np.isfinite(silence) else LONGEST_UNSEEN_S

    def _here(self, now: float) -> Array | None:
        """Return position and velocity (2, n) of the arm, where they are known now."""
        found, at = None, -np.inf
        if self._measured is not None:
            found, at = np.stack([self._measured.q, self._measured.dq]), self._measured_at
        if self._state is not None and self._fed_at > at:
            found, at = self._state[:2], self._fed_at
        return found if now - at <= self._longest_unseen_s else None

    def ready_arm(self) -> ServedArm:
        """Return the arm; RefusedError where there is none, or the node is disabled."""
        arm = self.arm
        if not self.enabled:
            raise RefusedError(Refusal.DISABLED)
        return arm

    def take_update(self, message: Any, now: float, clock_ns: int) -> None:
        """Follow an update of the model; RefusedError, counted, where it is not to be followed."""
        adapted = self._adapted
        if adapted is not None and adapted.rules.follows:
            adapted.take(message, now, clock_ns)

    def watch_updates(self, now: float) -> None:
        """Go back to the commissioned model where updates have stopped."""
        if self._adapted is not None:
            self._adapted.watch(now)

    @property
    def _adapted(self) -> AdaptedModel | None:
        return self._arm.loaded.adapted if self._arm else None

    def measure(self, message: JointMessage, now: float) -> MeasuredState | None:
        """Read a joint state; None, counted by reason, if it cannot be used."""
        tally = self.counts.joint_states
        try:
            with tally.receiving():
                self._measured = self.arm.measured.read(message, now)
        except RefusedError:
            return None
        tally.used['measured'] += 1
        self._measured_at = now
        return self._measured

    def safe_torque(self, now: float) -> Array | None:
        """Return what must be published because references have stopped, None where they go on."""
        arm = self._arm
        if arm is None or not self.enabled:
            return None
        if not self._ended and self.silence(now) <= self._longest_silence_s:
            return None
        self.counts.torques['stale'] += not self._stale
        fresh = self._is_measured(now)  # gravity of a place left long ago may be the opposite
        if self._stale and fresh != self._was_measured:
            arm.shaper.begin()
        self._stale, self._was_measured = True, fresh
        with np.errstate(all='ignore'):
            return arm.safe_torque(self._measured.q if fresh and self._measured else None, now)

    def _is_measured(self, now: float) -> bool:
        return now - self._measured_at <= self._longest_unseen_s

    def silence(self, now: float) -> float:
        """Return the time since the last answered reference [s], 0 while none is expected."""
        return now - self._fed_at if np.isfinite(self._fed_at) else 0.0

    # status

    def values(self) -> dict[str, Any]:
        """Return the state and all counts, JSON-able."""
        return {
            'enabled': self.enabled,
            'joint_names': list(self.joint_names),
            'novelty': self._novelty(),
            'adaptation': self._adapted.values() if self._adapted else {},
            **self.counts.values(),
        }

    def _lacks_position(self, now: float) -> bool:
        """Whether gravity could not be held now although it is asked for."""
        rules = self.arm.shaper.rules
        wanted = self.enabled and rules.gravity and rules.safe_value is SafeValue.GRAVITY
        expected = np.isfinite(self._fed_at)
        return bool(wanted and expected and not self._is_measured(now))

    def _novelty(self) -> float | None:
        """Return that of the last sample, computed when it is asked for."""
        if self._arm is None or self._state is None:
            return None
        return self._arm.novelty(self._state)

    def judge(self, failure: str, now: float) -> tuple[Level, str]:
        """Judge in a sentence what came since the last call; `failure` is that of a reload."""
        new = self.counts.take_new_alarms()
        alarms = in_words(new)
        arm = self._arm
        if arm is None:
            return (Level.ERROR, failure) if failure else (Level.OK, 'inactive')
        if new[Refusal.NOT_FINITE_TORQUE]:
            return Level.ERROR, f'messages with trouble: {alarms}'
        if self._stale:
            held = arm.shaper.sent.in_words
            return Level.WARN, f'no reference for {self.silence(now):.1f} s: {held} published'
        if self._lacks_position(now):
            return Level.WARN, (
                'no joint states: where references stop, zero torque is published in place of '
                'gravity; start the driver, or set stale_policy to zero'
            )
        if new:
            return Level.WARN, f'messages with trouble: {alarms}'
        if self._adapted is not None and (trouble := self._adapted.take_new_trouble()):
            return Level.WARN, trouble
        if failure:
            return Level.WARN, f'serves the model before: {failure}'
        return Level.OK, 'answering' if self.enabled else 'disabled'
