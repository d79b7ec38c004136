"""Follow plans by computed torque, and let go of the arm where that is not safe any more."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.control.plan import EffortPoint, LARGEST, Plan, read_points, read_serialised
from lip_id_ros.control.settings import ControlRules, ControlSettings
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.joint_states import (
    JointStateReader,
    MeasuredState,
    NANOSECONDS,
    StampWatch,
)
from lip_id_ros.signals.joints import JointOrder, Refusal, RefusedError
from lip_id_ros.signals.status import Level, Status, Tally
from lip_id_ros.signals.torque_steps import between, Ramp, Sent


class LetGo(StrEnum):
    """Why a plan is not followed any more: the key that it is counted under."""

    SILENCE = 'joint states stopped'
    JUMP = 'clock jumped'
    START = 'plan begins elsewhere'
    PATH = 'arm left the plan'
    PUBLISHERS = 'several publishers'
    FAULT = 'callback failed'
    END = 'node ended'


class PlanController:
    """
    Follow plans; without one there is no torque.

    Stamps of joint states are the clock of a plan. One that goes back, or further ahead than its
    message was long in coming, is refused; where the clock did jump, the plan is let go. Once a
    plan is let go, torques go to zero within the rates, then there are none. Times `now` are in
    seconds on any steady clock.

    `releasing`: whether torques are on the way to zero. `failure`: why the last plan was let go,
    until the next begins; empty where it was not. ConfigError if there is no joint or one comes
    twice, a list has another length than there are, or limits are not given.
    """

    def __init__(self, settings: ControlSettings) -> None:
        self._settings, self._rules = settings, ControlRules.of(settings)
        self._planned = JointOrder(settings.joints)
        self._reader = JointStateReader(settings.joints)
        self._stamps = StampWatch(settings.stale_timeout_s)
        self._jumps = 0
        self._plan: Plan | None = None
        self._next: Plan | None = None
        self._fed_at = -np.inf
        self._doubt: Refusal | None = None
        self._sent = Sent(np.zeros(len(settings.joints)))
        self._ramp = Ramp()
        self.releasing = False
        self._tally = Tally('plans', 'torques', 'idle')
        self._let_go: Counter[str] = Counter()
        self.failure = ''

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints, in the order of torques."""
        return self._planned.joint_names

    # plans

    def take(self, names: Sequence[str], points: Sequence[EffortPoint], now: float) -> None:
        """
        Follow a plan from the next measurement on, with efforts at all points or at none.

        RefusedError if it cannot be followed; the plan before goes on.
        """
        with self._taking(now):
            if len(points) > self._settings.max_plan_points:
                raise RefusedError(Refusal.TOO_LONG)
            self._next = Plan(read_points(self._planned, names, points))

    def take_serialised(self, raw: bytes, now: float) -> None:
        """Follow a plan that is a serialised JointTrajectory; RefusedError as for `take`."""
        with self._taking(now):
            most = self._settings.max_plan_points
            self._next = Plan(read_serialised(raw, self._planned, most))

    @contextmanager
    def _taking(self, now: float) -> Iterator[None]:
        with self._tally.receiving():
            yield
            if self._plan is None:
                self._fed_at = now
            self._tally.used['plans'] += 1

    # torques

    def torques(self, message: JointMessage, now: float) -> Array | None:
        """
        Answer a measurement.

        `message`: with positions and velocities of all joints; its stamp is the clock of the plan.
        `now` [s]. The result has shape (n,): effort of the plan plus feedback, within limits and
        rates [N m or N], in the order of `joint_names`; on the way to zero after a plan was let
        go; None without a plan. RefusedError if its stamp is doubted, a joint is missing, or a
        number is missing or not finite.
        """
        with self._tally.receiving():
            try:
                command = self._answer(message, now)
            except RefusedError as refused:
                self._doubt = refused.reason
                raise
            self._tally.used['idle' if command is None else 'torques'] += 1
            return command

    def watch(self, now: float) -> Array | None:
        """Return the torque (n,) on the way to zero; None while a plan is followed, or after."""
        following = self._plan is not None or self._next is not None
        if following and now - self._fed_at > self._settings.stale_timeout_s:
            silence = f'for {self._settings.stale_timeout_s:g} s'
            if self._doubt is None:
                self.let_go(LetGo.SILENCE, f'no joint state has come {silence}')
            else:
                self.let_go(LetGo.SILENCE, f'no joint state was usable {silence} ({self._doubt})')
        return self._release(now) if self.releasing else None

    def let_go(self, reason: LetGo, sentence: str) -> None:
        """Follow no plan any more: `watch` has the torques on the way to zero."""
        if self._plan is not None:
            self.releasing = True
            self._ramp.begin()
        if self._plan is not None or self._next is not None:
            self._fail(reason, sentence)
        self._plan = self._next = None

    def status(self) -> Status:
        """Return the counts, which add up to `received`; warn of refusals since the last call."""
        tally = self._tally
        values = {
            'received': tally.received,
            **tally.used,
            'refused': dict(tally.refused),
            'let_go': dict(self._let_go),
        }
        refused = ', '.join(f'{key} {n}' for key, n in sorted(tally.new_refusals().items()))
        level, summary = Level.OK, 'all messages are answered'
        if self.failure:
            level, summary = Level.ERROR, self.failure
        elif refused:
            level, summary = Level.WARN, f'messages refused: {refused}'
        if np.isinf(self._rules.limits).any():
            summary += '; torques are not limited'
        return Status(level, summary, values)

    def _answer(self, message: JointMessage, now: float) -> Array | None:
        self._reader.columns(message)
        if not self._is_new(message.stamp_ns, now) and self._next is None:
            self._doubt = Refusal.REPEATED_STAMP
            # published again, since its torque was lost: it gets the same
            return None if self._plan is None else self._sent.tau
        tau = self.watch(now)
        if tau is not None or (self._plan is None and self._next is None):
            return tau
        measured = self._read(message)
        if self._next is not None:
            self._begin(self._next, measured, now)
        if self._plan is not None:
            tau = self._follow(self._plan, measured, message.stamp_ns, now)
        self._fed_at, self._doubt = now, None
        return tau

    def _is_new(self, stamp_ns: int, now: float) -> bool:
        """Return whether a stamp is not that of the message before; RefusedError if doubted."""
        doubt = self._stamps.doubt(stamp_ns, round(NANOSECONDS * now))
        if doubt not in (None, Refusal.REPEATED_STAMP):
            raise RefusedError(doubt)
        if self._stamps.jumps > self._jumps:
            self._jumps = self._stamps.jumps
            if self._plan is not None:
                self.let_go(LetGo.JUMP, 'the stamps of the joint states jumped')
        return doubt is None

    def _read(self, message: JointMessage) -> MeasuredState:
        measured = self._reader.read(message)
        if max(np.abs(measured.q).max(), np.abs(measured.dq).max()) > LARGEST:
            raise RefusedError(Refusal.TOO_LARGE)  # its feedback would be the largest torque
        return measured

    def _begin(self, plan: Plan, measured: MeasuredState, now: float) -> None:
        """Replace the plan that is followed, unless the next one begins elsewhere."""
        self._next = None
        way = np.abs(plan.start - measured.q)
        if (far := self._beyond(way, self._rules.start_tolerance)) is not None:
            self._fail(LetGo.START, f'the plan begins {far}')
            return
        if self._plan is None:  # the rate counts from here
            self._sent = Sent(self._sent.tau, now)
        self._plan, self.failure, self.releasing = plan, '', False
        self._ramp.begin()

    def _follow(self, plan: Plan, measured: MeasuredState, stamp_ns: int, now: float) -> Array:
        q, dq, effort = plan.at(stamp_ns)
        if (far := self._beyond(np.abs(q - measured.q), self._rules.path_tolerance)) is not None:
            self.let_go(LetGo.PATH, f'the plan is {far}')
            return self._release(now)
        with np.errstate(over='ignore', invalid='ignore'):
            wanted = effort + self._rules.gains.feedback(q - measured.q, dq - measured.dq)
        if not np.isfinite(wanted).all():
            raise RefusedError(Refusal.NOT_FINITE_TORQUE)
        return self._step(wanted, now, self._settings.ramp_s)

    def _release(self, now: float) -> Array:
        tau = self._step(np.zeros_like(self._sent.tau), now, self._settings.safe_ramp_s)
        self.releasing = bool(tau.any())
        return tau

    def _step(self, wanted: Array, now: float, duration_s: float) -> Array:
        """Return the next torque on the way to the wanted one, within limits and rates."""
        limits = self._rules.limits
        cut = between(wanted, -limits, limits)
        ramped = self._ramp.blend(self._sent.tau, cut, now, duration_s)
        rated = self._sent.toward(ramped, now, self._rules.rates)
        self._sent = Sent(between(rated, -limits, limits), now)
        return self._sent.tau

    def _beyond(self, way: Array, tolerance: Array) -> str | None:
        """Describe the joint that is furthest from where it should be, if one is too far."""
        worst = int(np.argmax(way - tolerance))
        if way[worst] <= tolerance[worst]:
            return None
        return (
            f'{way[worst]:.3g} rad or m from joint {self.joint_names[worst]}, more than the '
            f'tolerance of {tolerance[worst]:g}'
        )

    def _fail(self, reason: LetGo, sentence: str) -> None:
        self._let_go[reason.value] += 1
        done = 'refused' if reason is LetGo.START else 'let go'
        self.failure = f'{done}: {sentence}'
