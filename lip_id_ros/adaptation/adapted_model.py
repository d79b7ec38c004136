"""A commissioned model that follows updates: each is judged, and torques are blended."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lip_id_ros.adaptation.follow_settings import FollowRules
from lip_id_ros.adaptation.followed import FollowedArm, WalkSettings
from lip_id_ros.adaptation.possible import can_exist
from lip_id_ros.adaptation.updates import Update
from lip_id_ros.arrays import Array
from lip_id_ros.model import InverseDynamicsModel, Prediction, Query
from lip_id_ros.model.running_memory import RunningMemory
from lip_id_ros.rigid_body import LINK_PARAMETERS
from lip_id_ros.signals.joints import Refusal, RefusedError
from lip_id_ros.signals.status import in_words, Tally
from lip_id_ros.signals.torque_steps import LONGEST_STEP_S

STATES = 100
"""Of the training data, at most, at which a change of torques is measured."""


@dataclass(frozen=True, eq=False)
class _Served:
    """A model with its numbers, shape (p,), and its own friction with a memory."""

    numbers: Array
    model: InverseDynamicsModel
    memory: RunningMemory | None

    def query(self, state: Array, now: float | None) -> Query:
        """Evaluate a state (3, n), as one of a stream where there is a time [s]."""
        found = self.model.query(*state)
        if self.memory is None or now is None:
            return found
        return found._replace(tau=found.tau + self.memory.torque(state, now))


class AdaptedModel:
    """
    The commissioned model, or what the last good update made of it.

    An update is refused, counted by reason, that is not finite, not of this model, not newer, no
    arm that can exist, or further from the fit than is followed. The commissioned model comes back
    when updates stop, where one says that it is worse, and when `go_back` is called. Torques are
    blended; times are on any steady clock [s]. ModelError if the model is no arm.

    """

    def __init__(self, model: InverseDynamicsModel, rules: FollowRules) -> None:
        self.rules = rules
        self._arm = FollowedArm(model, WalkSettings())
        self._walk, self._hash = self._arm.walk, model.fingerprint
        self._slopes = self._slopes_of_torques(model)
        start = self._arm.start
        self._commissioned = _Served(start, model, model.running_memory())
        self._before = self._now = self._commissioned
        self._share, self._at, self._heard = 1.0, -np.inf, -np.inf
        self._counter: int | None = None
        self._why = 'no update yet'
        self.tally = Tally('followed', 'untrusted', 'worse')
        self.n_gone_back = 0

    @property
    def newest(self) -> InverseDynamicsModel:
        """The model that is followed, without a blend."""
        return self._now.model

    @property
    def training_range(self) -> tuple[Array, Array]:
        """Lowest and highest q, dq and ddq of the training data, each of shape (3, n)."""
        return self._commissioned.model.training_range

    @property
    def numbers(self) -> Array | None:
        """Its numbers, shape (p,); None where it is the commissioned one."""
        return None if self._now is self._commissioned else self._now.numbers

    def take(self, text: str, now: float) -> None:
        """Follow an update from now on; RefusedError if it is not one to follow."""
        with self.tally.receiving():
            update = self._checked(Update.from_text(text))
            self._counter, self._heard = update.counter, now
            if update.is_worse:
                self.tally.used['worse'] += 1
                self.go_back('an update is worse than the commissioned model')
                return
            self.tally.used['followed' if update.trusted else 'untrusted'] += 1
            self._why = '' if update.trusted else 'what was learned is not trusted now'
            self.use(update.numbers)

    def watch(self, now: float) -> None:
        """Go back where updates have stopped; then any counter begins anew."""
        if self._counter is not None and now - self._heard > self.rules.timeout_s:
            self._counter = None
            self.n_gone_back += 1
            self.go_back(f'no update for {self.rules.timeout_s:g} s')

    def adjust(self, rules: FollowRules) -> None:
        """Use other rules; where updates are no longer followed, go back."""
        if self.rules.follows and not rules.follows:
            self._counter = None
            self.go_back('not followed')
        self.rules = rules

    def go_back(self, why: str) -> None:
        """Blend to the commissioned model."""
        self._why = why
        self.use(self._commissioned.numbers)

    def use(self, numbers: Array) -> None:
        """Blend to the model of numbers, shape (p,), from what is served now."""
        if np.array_equal(numbers, self._now.numbers):
            return
        before, share = self._now, self._share
        if share < 1.0:
            before = self._served((1.0 - share) * self._before.numbers + share * before.numbers)
        self._before, self._now, self._share = before, self._served(numbers), 0.0

    def query(self, state: Array, now: float, is_stream: bool = True) -> Query:
        """
        Evaluate a joint state (3, n) at a time [s].

        `is_stream`: with what friction remembers of the states before.
        """
        self.advance(now)
        at = now if is_stream else None
        found = self._now.query(state, at)
        if self._share >= 1.0:
            return found
        before = self._before.query(state, at)
        parts = (_blended(a, b, self._share) for a, b in zip(before, found, strict=True))
        return Query(*parts)

    def predict(self, q: Array, dq: Array, ddq: Array) -> Prediction:
        """Evaluate N joint states (N, n) at the time of the last call of `advance`."""
        found = self._now.model.predict(q, dq, ddq)
        if self._share >= 1.0:
            return found
        before = self._before.model.predict(q, dq, ddq)
        names = ('tau', 'inertial', 'coriolis', 'gravity', 'friction', 'kinetic', 'potential')
        parts: dict[str, Any] = {}
        for name in names:
            a, b = getattr(before, name), getattr(found, name)
            parts[name] = None if b is None else _blended(a, b, self._share)
        return replace(found, **parts)

    def advance(self, now: float) -> None:
        """Let the blend go on; no more than `LONGEST_STEP_S` counts between two calls."""
        if self._share < 1.0 and np.isfinite(self._at):
            elapsed = min(max(now - self._at, 0.0), LONGEST_STEP_S)
            duration = self.rules.blend_s
            self._share += elapsed / duration if duration > 0.0 else 1.0
        self._at = now

    def new_trouble(self) -> str:
        """Return in words what went wrong with updates since the last call, empty if nothing."""
        refused = self.tally.new_refusals()
        if refused:
            return f'updates refused: {in_words(refused)}'
        if self.rules.follows and self._counter is None and self.n_gone_back:
            return f'serves the commissioned model: {self._why}'
        return ''

    def values(self) -> dict[str, Any]:
        """Return the state and the counts, JSON-able."""
        return {
            'model': 'commissioned' if self._now is self._commissioned else 'adapted',
            'why': self._why,
            'counter': self._counter,
            'gone_back': self.n_gone_back,
            'received': self.tally.received,
            **self.tally.used,
            'refused': dict(self.tally.refused),
        }

    def _served(self, numbers: Array) -> _Served:
        fit = self._commissioned
        if np.array_equal(numbers, fit.numbers):
            return fit
        if np.array_equal(numbers, self._now.numbers):
            return self._now
        model = self._arm.with_numbers(numbers)
        model.query(*np.zeros((3, model.n_joints)))  # packed before it is needed
        return _Served(numbers, model, model.running_memory(self._now.memory))

    def _checked(self, update: Update) -> Update:
        if update.model != self._hash:
            raise RefusedError(Refusal.OTHER_MODEL)
        if self._counter is not None and update.counter <= self._counter:
            raise RefusedError(Refusal.OLD_COUNTER)
        numbers, start, arm = update.numbers, self._arm.start, self._arm
        if numbers.shape != start.shape:
            raise RefusedError(Refusal.NO_UPDATE)
        links = numbers[: arm.friction.start].reshape(-1, LINK_PARAMETERS)
        if not can_exist(links):
            raise RefusedError(Refusal.IMPOSSIBLE_ARM)
        active = numbers[arm.active]
        within = (active >= self._walk.lower) & (active <= self._walk.upper)
        with np.errstate(over='ignore', invalid='ignore'):
            change = np.abs(self._slopes @ (numbers - start)).max(axis=0)
        if not within.all() or not (change <= self.rules.limits).all():
            raise RefusedError(Refusal.BEYOND_TRUST)
        return update

    def _slopes_of_torques(self, model: InverseDynamicsModel) -> Array:
        """Return slopes of torques, in the largest of each joint, by the numbers, (M, n, p)."""
        largest = np.maximum(model.largest_torque, model.noise_std)
        return np.asarray(self._arm.usual_slopes(STATES) / largest[:, None])


def _blended(before: Any, now: Any, share: float) -> Any:
    return (1.0 - share) * before + share * now
