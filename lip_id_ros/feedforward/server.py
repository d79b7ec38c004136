"""The torque server: answers each message with a safe torque, or refuses and counts it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.arm import ServedArm, ServedTorque
from lip_id_ros.feedforward.deviations import Deviated
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.feedforward.shaping import Sent
from lip_id_ros.feedforward.status import ServeCounts, Watch
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import MeasuredState
from lip_id_ros.signals.joints import PlannedPoint, Point, Refusal, RefusedError
from lip_id_ros.signals.status import Level


class Server:
    """
    One arm, the rules for its torques, and counts of what was answered and refused.

    Every torque that leaves is finite and within its joint's limit. Times `now` are in seconds on
    any steady clock.

    Attributes
    ----------
    counts : ServeCounts
    enabled : bool
        Whether references are answered.

    """

    def __init__(self) -> None:
        self.counts = ServeCounts()
        self.enabled = False
        self._arm: ServedArm | None = None
        self._watch = Watch()

    @property
    def active(self) -> bool:
        """Whether there is an arm."""
        return self._arm is not None

    @property
    def arm(self) -> ServedArm:
        """
        The arm.

        Raises
        ------
        RefusedError
            If there is none.

        """
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

        Parameters
        ----------
        loaded : LoadedModel
            Of the joints served before, in their order, if there were any.
        settings : ServeSettings

        Raises
        ------
        ConfigError
            If the settings do not fit its joints.

        """
        sent = self._arm.shaper.sent if self._arm else Sent(np.zeros(len(loaded.joint_names)))
        self._arm = ServedArm(loaded, settings, self.counts.torques, sent)
        self._arm.shaper.begin()

    def adjust(self, settings: ServeSettings) -> None:
        """
        Use other settings.

        Raises
        ------
        ConfigError
            If they do not fit the model's joints.

        """
        if self._arm is not None:
            self._arm.adjust(settings)

    def release(self) -> None:
        """Forget the model, after zero torque was published."""
        self._arm = None
        self.enabled = False
        self._watch = Watch()

    def enable(self) -> None:
        """Answer references from now on, beginning at what the robot holds."""
        self.enabled = True
        if self._arm is not None:
            self._arm.shaper.begin()

    def disable(self) -> None:
        """Answer no more, after zero torque was published."""
        self.enabled = False
        self.rest()

    def rest(self) -> None:
        """Note that zero torque was published: the next reference is ramped in from there."""
        self._watch.stop()
        if self._arm is not None:
            self._arm.shaper.rest()

    # messages

    def sample(
        self, names: Sequence[str], points: Sequence[Point], now: float, tag: Any = None
    ) -> ServedTorque:
        """
        Answer a message of one point.

        Parameters
        ----------
        names : sequence of str
            Its joints.
        points : sequence of Point
            Its one point.
        now : float
            [s].
        tag : Any
            Comes back with its standard deviations, if they are computed.

        Returns
        -------
        ServedTorque
            In the model's order.

        Raises
        ------
        RefusedError
            If it cannot be answered; it is counted then.

        """
        with self.counts.references.refusing(), np.errstate(all='ignore'):
            served = self.ready_arm().sample(names, points, now, tag)
            self._watch.feed(now, served.state[0])
        self.counts.references.used['samples'] += 1
        return served

    def plan(self, names: Sequence[str], points: Sequence[PlannedPoint]) -> Array:
        """
        Answer a message of any number of points.

        Parameters
        ----------
        names : sequence of str
            Its joints.
        points : sequence of PlannedPoint
            Its points.

        Returns
        -------
        ndarray, shape (number of points, n)
            Torques [N m or N] in the message's order.

        Raises
        ------
        RefusedError
            If it cannot be answered; it is counted then.

        """
        with self.counts.references.refusing(), np.errstate(all='ignore'):
            tau = self.ready_arm().plan(names, points)
        self.counts.references.used['plans'] += 1
        return tau

    def ready_arm(self) -> ServedArm:
        """
        Return the arm.

        Raises
        ------
        RefusedError
            If there is none, or the node is disabled.

        """
        arm = self.arm
        if not self.enabled:
            raise RefusedError(Refusal.DISABLED)
        return arm

    def planned_beside(self, counts: Mapping[str, int]) -> None:
        """Count a plan that another process answered, and what it found doubtful or cut."""
        self.counts.references.used['plans'] += 1
        self.counts.torques.update(counts)

    def measure(self, message: JointMessage, now: float) -> MeasuredState | None:
        """Read a joint state; None, counted by reason, if it cannot be used."""
        tally = self.counts.joint_states
        try:
            with tally.receiving():
                measured = self.arm.measured(message)
        except RefusedError:
            return None
        tally.used['measured'] += 1
        self._watch.measure(now, measured.q)
        return measured

    def safe_torque(self, now: float) -> Array | None:
        """Return what must be published because references have stopped, None where they go on."""
        arm = self._arm
        if arm is None or not self.enabled:
            return None
        timeout_s = arm.shaper.rules.stale_timeout_s
        if self._watch.silence(now) <= timeout_s:
            return None
        if not self._watch.stale:
            self._watch.stale = True
            self.counts.torques['stale'] += 1
        with np.errstate(all='ignore'):
            return arm.safe_torque(self._watch.position(now, timeout_s), now)

    def take_deviation(self) -> Deviated | None:
        """Return standard deviations that were not taken yet."""
        deviations = self._arm.loaded.deviations if self._arm else None
        return deviations.take() if deviations else None

    # status

    def values(self) -> dict[str, Any]:
        """Return the state and all counts, JSON-able."""
        return {
            'enabled': self.enabled,
            'joint_names': list(self.joint_names),
            **self.counts.values(),
        }

    def judge(self, failure: str, now: float) -> tuple[Level, str]:
        """
        Judge what came since the last call.

        Parameters
        ----------
        failure : str
            Why the last configuration or reload failed, empty where it did not.
        now : float
            [s].

        Returns
        -------
        level : Level
        summary : str
            One sentence.

        """
        new = self.counts.new_alarms()
        alarms = ', '.join(f'{key} {n}' for key, n in sorted(new.items()))
        arm = self._arm
        if arm is None:
            return (Level.ERROR, failure) if failure else (Level.OK, 'inactive')
        if arm.loaded.deviations is not None and not arm.loaded.deviations.alive:
            return Level.ERROR, 'the process of the standard deviations has ended'
        if new[Refusal.NOT_FINITE_TORQUE]:
            return Level.ERROR, f'messages with trouble: {alarms}'
        if self._watch.stale:
            return Level.WARN, self._silence(arm.shaper.sent, now)
        if new:
            return Level.WARN, f'messages with trouble: {alarms}'
        if failure:
            return Level.WARN, f'serves the model before: {failure}'
        return Level.OK, 'answering' if self.enabled else 'disabled'

    def _silence(self, sent: Sent, now: float) -> str:
        largest = float(np.abs(sent.tau).max(initial=0.0))
        torque = f'torques up to {largest:.3g} N m or N' if largest else 'zero torque'
        return f'no reference for {self._watch.silence(now):.1f} s: {torque} published'
