"""A commissioned model that follows updates: each is judged, and torques are blended."""

from __future__ import annotations

from typing import Any

import numpy as np

from lip_id_ros.adaptation.follow_settings import FollowRules
from lip_id_ros.adaptation.followed import FollowedArm, WalkSettings
from lip_id_ros.adaptation.possible import can_exist
from lip_id_ros.adaptation.updates import Update
from lip_id_ros.arrays import Array
from lip_id_ros.model import InverseDynamicsModel, Prediction, Query
from lip_id_ros.model.arm_mean import ChangingArmMean
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.signals.joint_states import NANOSECONDS
from lip_id_ros.signals.joints import Refusal, RefusedError
from lip_id_ros.signals.status import in_words, Tally
from lip_id_ros.signals.torque_steps import LONGEST_TORQUE_STEP_S

STATES = 100
"""Of the training data, at most, at which a change of torques is measured."""


class AdaptedModel:
    """
    The commissioned model, or what the last good update made of it.

    An update is refused, counted by reason, that is not finite, not of this model, not of the node
    that is followed, not newer or too old, no arm that can exist, or further from the fit than is
    followed. The commissioned model comes back when updates stop, and when `go_back` is called.
    Torques are blended, with friction as drives have it; times are on any steady clock [s].
    ModelError if the model is no arm.

    """

    _source: str | None
    _heard: float | None  # when the last update was stamped, or the wait for one began

    def __init__(self, fitted: InverseDynamicsModel, rules: FollowRules) -> None:
        model = fitted.with_rise_time(0.0)
        self.rules, self._model = rules, model
        self._arm = FollowedArm(model, WalkSettings())
        # the bounds of `adapt`, whose friction has the rise time of the recording
        self._bounds, self._hash = FollowedArm(fitted, WalkSettings()).bounds, fitted.fingerprint
        self._slopes = self._slopes_of_torques(model)
        self._mean = ChangingArmMean(self._arm.arm, model.residual_gp)
        self._memory = model.running_memory()
        self._potential = self._mean.potential_slopes(model.potential_reference)
        self._before = self._now = self._served = self._arm.start
        self._newest: InverseDynamicsModel | None = model
        self._share, self._at = 1.0, -np.inf
        self._await_updates()
        self.tally = Tally('followed', 'untrusted')
        self.n_gone_back = 0

    @property
    def newest(self) -> InverseDynamicsModel:
        """The model that is followed, without a blend."""
        if self._newest is None:
            self._newest = self._arm.with_numbers(self._now)
        return self._newest

    @property
    def training_range(self) -> tuple[Array, Array]:
        """Lowest and highest q, dq and ddq of the training data, each of shape (3, n)."""
        return self._model.training_range

    @property
    def numbers(self) -> Array | None:
        """Its numbers, shape (p,); None where it is the commissioned one."""
        return None if np.array_equal(self._now, self._arm.start) else self._now

    def take(self, message: Any, now: float, clock_ns: int) -> None:
        """
        Follow a control_msgs/DynamicInterfaceGroupValues from now on.

        `clock_ns`: the clock that updates are stamped by [ns]. RefusedError if the message is not
        an update to follow.
        """
        with self.tally.receiving():
            update = Update.from_message(message)
            age = (clock_ns - update.stamp_ns) / NANOSECONDS
            self._check(update, age)
            self._source, self._stamp_ns = update.source, update.stamp_ns
            self._heard, self._is_silent = now - max(age, 0.0), False
            self.tally.used['followed' if update.trusted else 'untrusted'] += 1
            self._why = '' if update.trusted else 'what was learned is not trusted now'
            self.use(update.numbers)

    def watch(self, now: float) -> None:
        """Go back where updates have stopped, or none has come; then any node is followed."""
        if self._heard is None:
            self._heard = now
        if not self._is_silent and now - self._heard > self.rules.timeout_s:
            self.n_gone_back += self._source is not None
            self._source, self._is_silent = None, True
            self.go_back(f'no update for {self.rules.timeout_s:g} s')

    def adjust(self, rules: FollowRules) -> None:
        """Use other rules; where updates are no longer followed, go back."""
        if self.rules.follows != rules.follows:
            self._await_updates()
            self.go_back('no update yet' if rules.follows else 'not followed')
        self.rules = rules

    def _await_updates(self) -> None:
        self._source = self._heard = None
        self._stamp_ns, self._is_silent, self._why = 0, False, 'no update yet'

    def begin_anew(self) -> None:
        """Be the commissioned model at once, as before the first update."""
        self._await_updates()
        self.use(self._arm.start)
        self._share = 1.0
        self._serve()

    def go_back(self, why: str) -> None:
        """Blend to the commissioned model."""
        self._why = why
        self.use(self._arm.start)

    def use(self, numbers: Array) -> None:
        """Blend to the model of numbers, shape (p,), from what is served now."""
        if not np.array_equal(numbers, self._now):
            self._before, self._now, self._share = self._served, numbers, 0.0
            self._newest = None

    def query(self, state: Array, now: float, is_stream: bool = True) -> Query:
        """
        Evaluate a joint state (3, n) at a time [s].

        `is_stream`: with what friction remembers of the states before.
        """
        self.advance(now)
        tau, gravity, kinetic, potential = self._mean.one(*state)
        if self._memory is not None and is_stream:
            tau = tau + self._memory.torque(state, now)
        return Query(tau, kinetic, potential - self._potential_offset, gravity)

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        """Evaluate N joint states (N, n), each alone, at the time of the last `advance`."""
        parts = self._mean.many(*(np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, ddq)))
        potential = None
        if self._model.has_potential:
            potential = parts.potential - self._potential_offset
        return Prediction(**{**parts._asdict(), 'potential': potential})

    @property
    def _potential_offset(self) -> float:
        if not self._model.has_potential:
            return np.nan
        return float(self._potential @ self._served[: self._potential.size])

    def advance(self, now: float) -> None:
        """Let the blend go on; no more than `LONGEST_TORQUE_STEP_S` counts between two calls."""
        if self._share < 1.0 and np.isfinite(self._at):
            elapsed = min(max(now - self._at, 0.0), LONGEST_TORQUE_STEP_S)
            duration = self.rules.blend_s
            self._share += elapsed / duration if duration > 0.0 else 1.0
            self._serve()
        self._at = now

    def _serve(self) -> None:
        """Evaluate the numbers of the blend from now on."""
        self._served = self._now
        if self._share < 1.0:
            self._served = self._before + self._share * (self._now - self._before)
        self._mean.use(self._served)
        if self._memory is not None:
            self._memory.use(self._served[self._arm.friction])

    def take_new_trouble(self) -> str:
        """Return in words what went wrong with updates since the last call, empty if nothing."""
        refused = self.tally.take_new_refusals()
        if refused:
            return f'updates refused: {in_words(refused)}'
        if self.rules.follows and self._is_silent:
            return (
                f'follows the commissioned model: {self._why}; start adapt, or set '
                'follow_adaptation to false'
            )
        return ''

    def values(self) -> dict[str, Any]:
        """Return the state and the counts, JSON-able."""
        return {
            'model': 'commissioned' if self.numbers is None else 'adapted',
            'why': self._why,
            'source': self._source or '',
            'gone_back': self.n_gone_back,
            'received': self.tally.received,
            **self.tally.used,
            'refused': dict(self.tally.refused),
        }

    def _check(self, update: Update, age: float) -> None:
        numbers, start, arm = update.numbers, self._arm.start, self._arm
        if update.model != self._hash:
            raise RefusedError(Refusal.OTHER_MODEL)
        if self._source not in (None, update.source):
            raise RefusedError(Refusal.OTHER_SOURCE)
        if self._source is not None and update.stamp_ns < self._stamp_ns:
            raise RefusedError(Refusal.NOT_NEWER_UPDATE)
        if abs(age) > self.rules.timeout_s:
            raise RefusedError(Refusal.OLD_UPDATE)
        if numbers.shape != start.shape:
            raise RefusedError(Refusal.NO_UPDATE)
        links = numbers[: arm.friction.start].reshape(-1, LINK_PARAMETERS)
        if not can_exist(links):
            raise RefusedError(Refusal.IMPOSSIBLE_ARM)
        active = numbers[arm.active]
        within = (active >= self._bounds[0]) & (active <= self._bounds[1])
        with np.errstate(over='ignore', invalid='ignore'):
            change = np.abs(self._slopes @ (numbers - start)).max(axis=0)
        if not within.all() or not (change <= self.rules.limits).all():
            raise RefusedError(Refusal.BEYOND_TRUST)

    def _slopes_of_torques(self, model: InverseDynamicsModel) -> Array:
        """Return slopes of torques, in the largest of each joint, by the numbers, (M, n, p)."""
        largest = np.maximum(model.largest_torque, model.noise_std)
        return np.asarray(self._arm.usual_slopes(STATES) / largest[:, None])
