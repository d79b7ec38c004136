"""What the node `serve` does with a message: answer safely, or refuse and count."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.arm import ServedArm, ServedTorque
from lip_id_ros.feedforward.deviations import Deviated
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.feedforward.shaping import Sent
from lip_id_ros.model import Prediction, Query
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import MeasuredState
from lip_id_ros.signals.joints import ON_PURPOSE, PlannedPoint, Point, Refusal, RefusedError

Result = TypeVar('Result')

ALARMS = ('out_of_range', 'uncertain')
"""Counts of doubtful references."""


class Watch:
    """
    Watch a stream of references from the first answered one on.

    Attributes
    ----------
    stale : bool
        Whether the silence was noticed.

    """

    def __init__(self) -> None:
        self.stale = False
        self._fed_at: float | None = None
        self._position: Array | None = None
        self._measured: Array | None = None
        self._measured_at = -np.inf

    def feed(self, now: float, position: Array) -> None:
        """
        Note an answered reference.

        Parameters
        ----------
        now : float
            [s], on any steady clock.
        position : ndarray, shape (n,)
            Its positions.

        """
        self._fed_at, self._position, self.stale = now, position, False

    def measure(self, now: float, position: Array) -> None:
        """Note where the arm is."""
        self._measured_at, self._measured = now, position

    def stop(self) -> None:
        """Expect no reference: the robot holds no torque."""
        self._fed_at, self.stale = None, False

    def silence(self, now: float) -> float:
        """Return the time since the last answered reference [s], 0 while none is expected."""
        return 0.0 if self._fed_at is None else now - self._fed_at

    def position(self, now: float, longest_s: float) -> Array | None:
        """Return where the arm is: measured no longer ago than so, else the last reference."""
        fresh = now - self._measured_at <= longest_s
        return self._measured if fresh else self._position


class Server:
    """
    One arm, the rules for its torques, and counts of what was answered and refused.

    Every torque that leaves is finite and within its joint's limit. Times `now` are in seconds on
    any steady clock.

    """

    def __init__(self) -> None:
        self._arm: ServedArm | None = None
        self._enabled = False
        self._watch = Watch()
        self._counts = Counter(limited=0, rate_limited=0, out_of_range=0, uncertain=0, stale=0)
        self._answered = Counter(samples=0, plans=0, measured=0)
        self._refused: Counter[str] = Counter()
        self._unmeasured: Counter[str] = Counter()

    @property
    def active(self) -> bool:
        """Whether there is an arm."""
        return self._arm is not None

    @property
    def enabled(self) -> bool:
        """Whether references are answered."""
        return self._enabled

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints of the model, none while there is none."""
        return self._arm.joint_names if self._arm else ()

    @property
    def sent(self) -> Array:
        """The torque that the robot holds, shape (n,) [N m or N]."""
        return self._arm.shaper.sent.tau if self._arm else np.zeros(0)

    @property
    def stale(self) -> bool:
        """Whether references have stopped."""
        return self._watch.stale

    @property
    def deviations_alive(self) -> bool:
        """Whether standard deviations are computed where they are asked for."""
        deviations = self._arm.loaded.deviations if self._arm else None
        return deviations is None or deviations.alive

    # the model and its rules

    def use(self, loaded: LoadedModel, settings: ServeSettings, now: float) -> None:
        """
        Answer with this model from now on, beginning at what the robot holds.

        Parameters
        ----------
        loaded : LoadedModel
            Of the joints served before, in their order, if there were any.
        settings : ServeSettings
        now : float
            [s].

        Raises
        ------
        ConfigError
            If the settings do not fit its joints.

        """
        rest = Sent(np.zeros(len(loaded.joint_names)))
        sent = self._arm.shaper.sent if self._arm else rest
        self._arm = ServedArm(loaded, settings, self._counts, sent)
        self._arm.shaper.begin(now)

    def adjust(self, settings: ServeSettings, now: float) -> None:
        """
        Use other settings.

        Raises
        ------
        ConfigError
            If they do not fit the model's joints.

        """
        if self._arm is not None:
            self._arm.adjust(settings, now)

    def release(self) -> None:
        """Forget the model, after zero torque was published."""
        self._arm = None
        self._enabled = False
        self._watch = Watch()

    def enable(self, now: float) -> None:
        """Answer references from now on, beginning at what the robot holds."""
        self._enabled = True
        if self._arm is not None:
            self._arm.shaper.begin(now)

    def disable(self) -> None:
        """Answer no more, after zero torque was published."""
        self._enabled = False
        self.rest()

    def rest(self) -> None:
        """Note that zero torque was published: the next reference begins there."""
        self._watch.stop()
        if self._arm is not None:
            self._arm.shaper.sent = Sent(np.zeros(len(self.joint_names)))

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

    def require_ready(self) -> None:
        """
        Refuse what comes while there is no model or the node is disabled.

        Raises
        ------
        RefusedError
            With the reason.

        """
        self._ready()

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Count what is refused within."""
        try:
            # values too large to be squared are refused, not warned of
            with np.errstate(all='ignore'):
                yield
        except RefusedError as refused:
            self.refuse(refused.reason)
            raise

    def refuse(self, reason: Refusal) -> None:
        """Count a reference that was refused elsewhere."""
        self._refused[reason.value] += 1

    def planned_beside(self, counts: Mapping[str, int]) -> None:
        """Count a plan that another process answered, and what it found doubtful or cut."""
        self._answered['plans'] += 1
        self._counts.update(counts)

    def measure(self, message: JointMessage, now: float) -> MeasuredState | None:
        """Read a joint state; None, counted by reason, if it cannot be used."""
        try:
            measured = self._active().measured(message)
        except RefusedError as refused:
            self._unmeasured[refused.reason.value] += 1
            return None
        self._answered['measured'] += 1
        self._watch.measure(now, measured.q)
        return measured

    def safe_torque(self, now: float) -> Array | None:
        """Return what must be published because references have stopped, None where they go on."""
        arm = self._arm
        if arm is None or not self._enabled:
            return None
        timeout_s = arm.shaper.rules.stale_timeout_s
        if self._watch.silence(now) <= timeout_s:
            return None
        if not self._watch.stale:
            self._watch.stale = True
            self._counts['stale'] += 1
            arm.shaper.begin(now)
        with np.errstate(all='ignore'):
            return arm.safe_torque(self._watch.position(now, timeout_s), now)

    # beside the answers

    def components(self, served: ServedTorque) -> Prediction:
        """Predict the parts of the model's torque at an answered sample, arrays (1, n)."""
        return self._active().components(served.state)

    def measured_energies(self, measured: MeasuredState) -> Query:
        """Return the energies at a measured state."""
        return self._active().energies(measured)

    def residual(self, measured: MeasuredState) -> Array | None:
        """Return the measured torque that the model does not explain, shape (n,) [N m or N]."""
        with np.errstate(all='ignore'):
            return self._active().residual(measured)

    def take_deviation(self) -> Deviated | None:
        """Return standard deviations that were not taken yet."""
        deviations = self._arm.loaded.deviations if self._arm else None
        return deviations.take() if deviations else None

    # counts

    def alarms(self) -> Counter[str]:
        """Return the counts that deserve a warning."""
        unwanted = {key: n for key, n in self._refused.items() if key not in ON_PURPOSE}
        unmeasured = {
            f'joint states: {key}': n
            for key, n in self._unmeasured.items()
            if key not in ON_PURPOSE
        }
        doubtful = {key: self._counts[key] for key in ALARMS}
        return Counter(unwanted) + Counter(unmeasured) + Counter(doubtful)

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
        with self.refusing():
            result = answer()
        self._answered[kind] += 1
        return result

    def _sample(
        self, names: Sequence[str], points: Sequence[Point], now: float, tag: Any
    ) -> ServedTorque:
        arm = self._ready()
        if self._watch.stale:
            arm.shaper.begin(now)
        served = arm.sample(names, points, now, tag)
        self._watch.feed(now, served.state[0])
        return served

    def _ready(self) -> ServedArm:
        arm = self._active()
        if not self._enabled:
            raise RefusedError(Refusal.DISABLED)
        return arm

    def _active(self) -> ServedArm:
        if self._arm is None:
            raise RefusedError(Refusal.INACTIVE)
        return self._arm
