"""
The way from a reference to a torque: check, ask the model, shape; or refuse and count.

A new count of torques is a name in `COUNTED` here or in `shaping`, beside the line that counts it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.adaptation.adapted_model import AdaptedModel
from lip_id_ros.arrays import Array
from lip_id_ros.feedforward import shaping
from lip_id_ros.feedforward.deviations import Deviated, LONGEST_VALID_S
from lip_id_ros.feedforward.interpolation import Plan
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.measured import MeasuredArm
from lip_id_ros.feedforward.plan_check import fits, fitting_scale
from lip_id_ros.feedforward.settings import make_rules, Overload, Policy, SafeValue, ServeSettings
from lip_id_ros.feedforward.shaping import Shaper, TrainingRange
from lip_id_ros.feedforward.status import ServeCounts
from lip_id_ros.model import Prediction, Query
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import MeasuredState
from lip_id_ros.signals.joints import (
    increasing_times,
    JointOrder,
    PlannedPoint,
    Point,
    Refusal,
    RefusedError,
)
from lip_id_ros.signals.status import in_words, Level
from lip_id_ros.signals.torque_steps import Sent

COUNTED = (*shaping.COUNTED, 'stale', 'slowed', 'late_plans')
"""
Keys of ~/status: what `shaping` counts, streams that fell silent, plans that were slowed down or
came out late.
"""


@dataclass(frozen=True, eq=False)
class ServedTorque:
    """
    Answer to one sample of a stream, in the model's order.

    `tau`, shape (n,): the torque that may leave [N m or N]. `query`: torque and energies as the
    model has them. `state`, shape (3, n).
    """

    tau: Array
    query: Query
    state: Array


class ServedArm:
    """A model with the rules for its torques; ConfigError where they do not fit its joints."""

    def __init__(
        self, loaded: LoadedModel, settings: ServeSettings, counts: Counter[str], sent: Sent
    ) -> None:
        self.loaded = loaded
        self.joint_names = loaded.joint_names
        self.measured = MeasuredArm(loaded, settings.residual_cutoff_hz)
        trained = TrainingRange(*loaded.model.training_range)
        self.shaper = Shaper(make_rules(settings, self.joint_names), trained, sent, counts)
        self._counts = counts
        self._order = JointOrder(self.joint_names)
        self._std_period_s = 1.0 / settings.std_rate_hz

    def adjust(self, settings: ServeSettings) -> None:
        """Use other settings; what the robot holds stays, and ramps go on."""
        rules = make_rules(settings, self.joint_names)
        self.shaper.adjust(rules)
        if self.loaded.adapted is not None:
            self.loaded.adapted.adjust(rules.follow)
        self.measured.adjust(settings.residual_cutoff_hz)
        self._std_period_s = 1.0 / settings.std_rate_hz

    def sample(
        self, names: Sequence[str], points: Sequence[Point], now: float, tag: Any
    ) -> ServedTorque:
        """Answer one sample of a stream; joints that the model does not know are left out."""
        state = self._order.states(names, points)[:, 0]
        query = self.loaded.query(state, now)
        std = self._std(state, now, tag)
        return ServedTorque(
            self.shaper.sample(self._with_gravity(query), now, state, std), query, state
        )

    def plan(self, names: Sequence[str], points: Sequence[PlannedPoint]) -> Array:
        """Answer a plan, which must move the model's joints and no others, in its own order."""
        if len(points) > self.shaper.rules.max_plan_points:
            raise RefusedError(Refusal.TOO_LONG)
        columns = self._order.columns(names)
        if len(columns) != len(names):
            raise RefusedError(Refusal.FOREIGN_JOINT)
        states = self._order.states(names, points)
        t = increasing_times(points)
        tau = self._with_gravity(self.loaded.newest.predict(states[0], states[1], states[2], t))
        ordered = np.empty_like(tau)
        ordered[:, columns] = self.shaper.plan(tau, t, states)
        return ordered

    def time_scale(self, names: Sequence[str], points: Sequence[PlannedPoint]) -> float:
        """
        Return the factor on the times of a plan with which its torques are within limits.

        1 where overload_policy is to cut them; RefusedError as for `plan`, and where the policy
        refuses the plan, or no factor helps.

        """
        overload, limits = self.shaper.rules.overload, self.shaper.rules.limits
        if overload is Overload.CUT:
            return 1.0
        if len(points) > self.shaper.rules.max_plan_points:
            raise RefusedError(Refusal.TOO_LONG)
        states, t = self._order.states(names, points), increasing_times(points)
        plan = Plan(self.joint_names, t, states)
        scale: float | None
        if overload is Overload.SLOW:
            scale = fitting_scale(self._torques, plan, limits)
        else:
            scale = 1.0 if fits(self._torques, plan, limits) else None
        if scale is None:
            raise RefusedError(Refusal.OVERLOAD)
        self._counts['slowed'] += scale > 1.0
        return scale

    def _torques(self, q: Array, dq: Array, ddq: Array, t: Array) -> Array:
        return self.shaper.rules.scale * self._with_gravity(
            self.loaded.newest.predict(q, dq, ddq, t)
        )

    def safe_torque(self, position: Array | None, now: float) -> Array:
        """Return the torque of an arm without references, last seen here, shape (n,)."""
        rules, zero = self.shaper.rules, np.zeros(len(self.joint_names))
        if rules.safe_value is SafeValue.ZERO or not rules.gravity or position is None:
            return self.shaper.safe(zero, now)
        still = self.loaded.still(np.stack([position, zero, zero]), now)
        gravity = self.loaded.model.efforts(still.gravity)
        return self.shaper.safe(gravity if np.isfinite(gravity).all() else zero, now)

    def components(self, state: Array) -> Prediction:
        """Predict the parts of the torque at one state of shape (3, n), arrays (1, n)."""
        return self.loaded.newest.predict(*state[:, np.newaxis])

    def novelty(self, state: Array) -> float | None:
        """Return how far a state (3, n) is from the training data; None where that is unknown."""
        if self.loaded.known_states is None:
            return None
        with np.errstate(all='ignore'):
            found = float(self.loaded.known_states.novelty(*state[:, np.newaxis])[0])
        return round(found, 3) if np.isfinite(found) else None

    def _with_gravity(self, predicted: Query | Prediction) -> Array:
        if self.shaper.rules.gravity:
            return predicted.tau
        return predicted.tau - self.loaded.model.efforts(predicted.gravity)

    def _std(self, state: Array, now: float, tag: Any) -> Array | None:
        """Ask for standard deviations; return the newest, shape (n,), where they are checked."""
        deviations = self.loaded.deviations
        if deviations is None:
            return None
        deviations.offer(state, tag, now, self._std_period_s)
        if self.shaper.rules.std_policy is Policy.OFF:
            return None
        return deviations.std(now, self._std_period_s)


class Server:
    """
    One arm or none, whether it answers, and counts of what was answered and refused.

    Every torque that leaves is finite and within its joint's limit. Times `now` are in seconds on
    any steady clock. A message that cannot be answered raises RefusedError and is counted.
    """

    def __init__(self) -> None:
        self.counts = ServeCounts(COUNTED)
        self.enabled = False
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
        before = self._arm.loaded.deviations if self._arm else None
        if before is not None and loaded.deviations is not None:
            loaded.deviations.follow(before)
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
        self._stale = False
        if self._arm is not None:
            self._arm.shaper.rest(now)

    def _forget_stream(self) -> None:
        self._fed_at = -np.inf  # no reference is expected before the first
        self._stale = False
        self._state: Array | None = None
        self._measured: MeasuredState | None = None
        self._measured_at = -np.inf
        self._source = (False, False)

    # messages

    def sample(
        self,
        names: Sequence[str],
        points: Sequence[Point],
        now: float,
        tag: Any = None,
        age: float = 0.0,
    ) -> ServedTorque:
        """
        Answer a message of one point, sent `age` seconds ago.

        `tag` comes back with its standard deviations, if they are computed.
        """
        try:
            arm = self.ready_arm()
            if age > arm.shaper.rules.stale_timeout_s:
                raise RefusedError(Refusal.OLD)
            with np.errstate(all='ignore'):
                served = arm.sample(names, points, now, tag)
        except Exception as error:
            self.counts.references.refuse_for(error)
            raise
        self._fed_at, self._state, self._stale = now, served.state, False
        self.counts.references.used['samples'] += 1
        return served

    def plan(self, names: Sequence[str], points: Sequence[PlannedPoint]) -> Array:
        """Answer a message of many points: (N, n) torques [N m or N] in the message's order."""
        with self.counts.references.refusing(), np.errstate(all='ignore'):
            tau = self.ready_arm().plan(names, points)
        self.counts.references.used['plans'] += 1
        return tau

    def time_scale(self, names: Sequence[str], points: Sequence[PlannedPoint]) -> float:
        """Return the factor on the times of a plan with which `plan` is to answer it."""
        with self.counts.references.refusing(), np.errstate(all='ignore'):
            return self.ready_arm().time_scale(names, points)

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

    def planned_beside(self, counts: Mapping[str, int]) -> None:
        """Count a plan that another process answered, and what it found doubtful or cut."""
        self.counts.references.used['plans'] += 1
        self.counts.torques.update(counts)

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
        timeout_s = arm.shaper.rules.stale_timeout_s
        if self.silence(now) <= timeout_s:
            return None
        self.counts.torques['stale'] += not self._stale
        measured, fresh = self._measured, now - self._measured_at <= timeout_s
        source = (measured is not None, fresh)  # of the position: a step where it changes
        if self._stale and source != self._source:
            arm.shaper.begin()
        self._stale, self._source = True, source
        with np.errstate(all='ignore'):
            seen = None if self._state is None else self._state[0]
            return arm.safe_torque(measured.q if measured else seen, now)

    def silence(self, now: float) -> float:
        """Return the time since the last answered reference [s], 0 while none is expected."""
        return now - self._fed_at if np.isfinite(self._fed_at) else 0.0

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
            'novelty': self._novelty(),
            'adaptation': self._adapted.values() if self._adapted else {},
            **self.counts.values(),
        }

    def _novelty(self) -> float | None:
        """Return that of the last sample, computed when it is asked for."""
        if self._arm is None or self._state is None:
            return None
        return self._arm.novelty(self._state)

    def judge(self, failure: str, now: float) -> tuple[Level, str]:
        """Judge in a sentence what came since the last call; `failure` is that of a reload."""
        new = self.counts.new_alarms()
        alarms = in_words(new)
        arm = self._arm
        if arm is None:
            return (Level.ERROR, failure) if failure else (Level.OK, 'inactive')
        deviations = arm.loaded.deviations
        if deviations is not None and not deviations.alive:
            return Level.ERROR, 'the process of the standard deviations has ended'
        if new[Refusal.NOT_FINITE_TORQUE]:
            return Level.ERROR, f'messages with trouble: {alarms}'
        if self._stale:
            held = arm.shaper.sent.in_words
            return Level.WARN, f'no reference for {self.silence(now):.1f} s: {held} published'
        if deviations is not None and (waited := deviations.waited(now)) > LONGEST_VALID_S:
            return Level.WARN, (
                f'no standard deviations for {waited:.1f} s: their process stands still; '
                'reload_model starts another'
            )
        if new:
            return Level.WARN, f'messages with trouble: {alarms}'
        if self._adapted is not None and (trouble := self._adapted.new_trouble()):
            return Level.WARN, trouble
        if failure:
            return Level.WARN, f'serves the model before: {failure}'
        return Level.OK, 'answering' if self.enabled else 'disabled'
