"""What the node `serve` does with a message: answer safely, or refuse and count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.deviations import Deviated
from lip_id_ros.feedforward.feedforward import Answer, Parts
from lip_id_ros.feedforward.loading import Arm
from lip_id_ros.feedforward.served_arm import ServedArm
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.feedforward.shaping import Sent
from lip_id_ros.feedforward.watch import Watch
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import MeasuredState
from lip_id_ros.signals.joints import ON_PURPOSE, Refusal, RefusedError
from lip_id_ros.signals.trajectories import PlannedPoint, Point

Result = TypeVar('Result')

ALARMS = ('out_of_range', 'uncertain')
"""Counts of doubtful references."""


class Server:
    """
    One arm, what holds for its torques, and the counts of what was answered and refused.

    Every torque that leaves is finite and within its joint's limit. Times `now` are in seconds on
    any steady clock.

    """

    def __init__(self) -> None:
        self._served: ServedArm | None = None
        self._enabled = False
        self._watch = Watch()
        self._counts = Counter(limited=0, rate_limited=0, out_of_range=0, uncertain=0, stale=0)
        self._answered = Counter(samples=0, plans=0, measured=0)
        self._refused: Counter[str] = Counter()
        self._unmeasured: Counter[str] = Counter()

    @property
    def active(self) -> bool:
        """Whether there is an arm."""
        return self._served is not None

    @property
    def enabled(self) -> bool:
        """Whether references are answered."""
        return self._enabled

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints of the model, none while there is none."""
        return self._served.joint_names if self._served else ()

    @property
    def stale(self) -> bool:
        """Whether references have stopped."""
        return self._watch.stale

    @property
    def deviations_alive(self) -> bool:
        """Whether standard deviations are computed where they are asked for."""
        deviations = self._served.arm.deviations if self._served else None
        return deviations is None or deviations.alive

    # what is served

    def use(self, arm: Arm, settings: ServeSettings, now: float) -> None:
        """
        Answer with this model from now on, beginning at what the robot holds.

        Parameters
        ----------
        arm : Arm
            Of the joints served before, in their order, if there were any.
        settings : ServeSettings
        now : float
            [s].

        Raises
        ------
        ConfigError
            If the settings do not fit its joints.

        """
        rest = Sent(np.zeros(len(arm.feedforward.joint_names)))
        sent = self._served.shaper.sent if self._served else rest
        self._served = ServedArm(arm, settings, self._counts, sent)
        self._served.shaper.begin(now)

    def adjust(self, settings: ServeSettings) -> None:
        """
        Take other settings over.

        Raises
        ------
        ConfigError
            If they do not fit the model's joints.

        """
        if self._served is not None:
            self._served.adjust(settings)

    def release(self) -> None:
        """Forget the model; the robot was told zero."""
        self._served = None
        self._enabled = False
        self._watch = Watch()

    def enable(self, now: float) -> None:
        """Answer references from now on, beginning at what the robot holds."""
        self._enabled = True
        if self._served is not None:
            self._served.shaper.begin(now)

    def disable(self) -> None:
        """Answer no more; the robot was told zero."""
        self._enabled = False
        self._watch.stop()
        if self._served is not None:
            self._served.shaper.sent = Sent(np.zeros(len(self.joint_names)))

    # messages

    def sample(
        self, names: Sequence[str], points: Sequence[Point], now: float, tag: Any = None
    ) -> Answer:
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
        Answer
            With torques in the model's order.

        Raises
        ------
        RefusedError
            If it cannot be answered; it is counted then.

        """
        return self._counted('samples', lambda: self._sample(names, points, now, tag))

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
        return self._counted('plans', lambda: self._ready().plan(names, points))

    def measure(self, message: JointMessage, now: float) -> MeasuredState | None:
        """Take a measured joint state; None, counted by reason, if it cannot be used."""
        if self._served is None:
            return None
        try:
            motion = self._served.measured.motion(message)
        except RefusedError as refused:
            self._unmeasured[refused.reason.value] += 1
            return None
        self._answered['measured'] += 1
        self._watch.measure(now, motion.q)
        return motion

    def safe_torque(self, now: float) -> Array | None:
        """Return what must be published because references have stopped, None where they go on."""
        served = self._served
        if served is None or not self._enabled:
            return None
        timeout_s = served.stale_timeout_s
        if self._watch.silence(now) <= timeout_s:
            return None
        if not self._watch.stale:
            self._watch.stale = True
            self._counts['stale'] += 1
        with np.errstate(all='ignore'):
            return served.safe_torque(self._watch.position(now, timeout_s), now)

    # beside the answers

    def parts(self, answer: Answer) -> Parts:
        """Return the parts of the model's torque at an answered sample, arrays (1, n)."""
        return self._active().arm.feedforward.parts(answer.state)

    def measured_energies(self, motion: MeasuredState) -> Answer:
        """Return the energies at a measured state."""
        return self._active().measured.energies(motion)

    def residual(self, motion: MeasuredState) -> Array | None:
        """Return what the model does not explain of a measured torque, shape (n,) [N m or N]."""
        with np.errstate(all='ignore'):
            return self._active().measured.residual(motion)

    def take_deviation(self) -> Deviated | None:
        """Return standard deviations that were not taken yet."""
        deviations = self._served.arm.deviations if self._served else None
        return deviations.take() if deviations else None

    # what was done

    def alarms(self) -> Counter[str]:
        """Return how often something happened that somebody should know of."""
        unwanted = {key: n for key, n in self._refused.items() if key not in ON_PURPOSE}
        return Counter(unwanted) + Counter({key: self._counts[key] for key in ALARMS})

    def silence(self, now: float) -> float:
        """Return the time since the last answered reference [s]."""
        return self._watch.silence(now)

    def status(self) -> dict[str, Any]:
        """Return what was done so far, JSON-able."""
        return {
            'enabled': self._enabled,
            'joint_names': list(self.joint_names),
            'answered': dict(self._answered),
            **self._counts,
            'refused': dict(self._refused),
            'unmeasured': dict(self._unmeasured),
        }

    def _counted(self, kind: str, answer: Callable[[], Result]) -> Result:
        try:
            # values too large to be squared are refused below, not warned of
            with np.errstate(all='ignore'):
                result = answer()
        except RefusedError as refused:
            self._refused[refused.reason.value] += 1
            raise
        self._answered[kind] += 1
        return result

    def _sample(
        self, names: Sequence[str], points: Sequence[Point], now: float, tag: Any
    ) -> Answer:
        served = self._ready()
        if self._watch.stale:
            served.shaper.begin(now)
        answer, tau = served.sample(names, points, now, tag)
        self._watch.feed(now, answer.state[0])
        return replace(answer, tau=tau)

    def _ready(self) -> ServedArm:
        served = self._active()
        if not self._enabled:
            raise RefusedError(Refusal.DISABLED)
        return served

    def _active(self) -> ServedArm:
        if self._served is None:
            raise RefusedError(Refusal.INACTIVE)
        return self._served
