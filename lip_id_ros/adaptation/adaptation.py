"""An arm that is followed while it moves: predict each torque first, then learn from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from lip_id_ros.adaptation.followed import FollowedArm, WalkSettings
from lip_id_ros.adaptation.kalman import (
    DISTURBED,
    follow,
    LEARNED,
    RESTING,
    SETTLING,
    STUCK,
)
from lip_id_ros.adaptation.payloads import (
    LONGEST_S,
    NUMBERS,
    Payload,
    payload_of,
    PayloadEvent,
    PayloadWatch,
)
from lip_id_ros.adaptation.trust import motion, RecentErrors
from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.dataset.formats import sample_interval_s
from lip_id_ros.errors import DataError, ShapeError
from lip_id_ros.friction.dahl import begins_of_times, dahl_states, LONGEST_GAP_S, Steps
from lip_id_ros.joint_types import DISPLACEMENTS, is_prismatic, JointHistory
from lip_id_ros.model import InverseDynamicsModel
from lip_id_ros.rigid_body.pseudo_inertia import BODY

GATE, HOLD_S = 6.0, 1.0
"""
Deviations beyond which a torque is not that of the arm alone, as in contact, and the time after it
in which nothing is learned [s].
"""

NEAR_REST = 0.05
"""Velocities near rest, in root mean squares of those of the training data."""

STUCK_S, SAME = 0.5, 1e-6
"""
Time after which a torque that does not change is not that of a joint that moves [s], and the least
change, in deviations of the noise.
"""

CHUNK = 100
"""Samples for which torques are taken as linear around the same numbers."""

NOTHING = 1.0
"""
Mean square of the torques of a payload that is none, in that of the noise, beside the share of
what was put down that the arm leaves open.
"""

MOST_EXCESS = 4.0
"""Recent squared errors, in their variances, above which a disturbance is not called a payload."""

AFTER = 0.1
"""Of the deviations of a change, where the filter begins anew."""

NO_INFLATION = 1.0

NEARLY = 1e-6
"""Share of a covariance that may be rounding."""


@dataclass(frozen=True, eq=False)
class Followed:
    """
    What the filter expected of N samples before it learned from them.

    `tau`, `std`, shape (N, n): predicted torques, and deviations of measured torques about them
    [N m or N], at least as large as recent errors. `frozen`, shape (N, n): torques of the fit,
    which learns nothing. `outcome`, `trusted`, shape (N,): what became of a sample (`LEARNED` and
    others), and where what had been learned until then was trusted.

    """

    tau: Array
    std: Array
    frozen: Array
    outcome: IntArray
    trusted: BoolArray

    @property
    def learned(self) -> BoolArray:
        """Where a sample was learned from, shape (N,)."""
        return np.asarray(self.outcome == LEARNED)

    @property
    def served(self) -> Array:
        """Torques that are served: predicted ones where they are trusted, else of the fit."""
        return np.where(self.trusted[:, None], self.tau, self.frozen)

    @classmethod
    def joined(cls, parts: Sequence[Followed]) -> Followed:
        """Return what came one after the other as one."""
        names = [each.name for each in fields(cls)]
        return cls(*(np.concatenate([getattr(x, name) for x in parts]) for name in names))


class Adaptation:
    """
    Follow the links and the friction of an arm in torques that are measured while it moves.

    A Kalman filter with the posterior of the fit as prior (maths.md, section 15): every estimate
    has a deviation, and `model` predicts, exports and serves as the first one did. It is the fit
    until what was learned has been better for some time, and again where most torques are none of
    the arm's. Where it gets worse than the fit, what was learned is forgotten.

    Parameters
    ----------
    model : InverseDynamicsModel
        Of the arm as it was commissioned.
    walk : WalkSettings, optional
        How friction changes.

    Raises
    ------
    ModelError
        If the model is no arm.

    """

    def __init__(self, model: InverseDynamicsModel, walk: WalkSettings | None = None) -> None:
        self.commissioned, self.arm = model, FollowedArm(model, walk or WalkSettings())
        self._revolute = np.asarray(~is_prismatic(model.joint_types))
        self._inflation_of_fit = _inflation_of(model)
        self._interval_of_fit = sample_interval_s(model.provenance)
        self._t, self._quiet, self.n_forgotten = np.nan, np.inf, 0
        self._q, self._tau = np.zeros((2, model.n_joints))
        self._changed_at = np.full(model.n_joints, np.nan)
        self._dahl = np.zeros((model.n_joints, len(DISPLACEMENTS)))
        self._last = self.arm.last_body
        self._watch = PayloadWatch(model.n_joints, self.arm.unsure_of_payloads)
        self.payload: Payload | None = None
        self.payload_events: list[PayloadEvent] = []
        self._begin(self.arm.change_variance)

    def _begin(self, variance: Array) -> None:
        """Begin with the fit, and variances of what may have changed since, shape (p,)."""
        self.numbers = self.arm.start.copy()
        self.covariance = self.arm.covariance + np.diag(variance)
        self._recent = RecentErrors(len(self.arm.arm.links))
        self._drop()

    def _drop(self) -> None:
        """Carry no payload that was found."""
        # the body as found so far, while it settles, and that of the payload
        self._settling, self._body, self._found = False, np.zeros(BODY), np.zeros(BODY)
        # variances of torques with the payload, in those of the arm alone
        self._inflations = np.ones(len(self.arm.arm.links))
        self._watch.clear()

    def reset(self) -> None:
        """Forget what was learned and all payloads: the arm is as it was commissioned."""
        carried = self.carried
        self.arm.carry(np.zeros(BODY))
        self._begin(self.arm.change_variance)
        self.payload = None
        if carried is not None:
            self._tell_payload()

    def state(self) -> dict[str, Array]:
        """Return what was learned, for `resume`."""
        found = np.zeros(0) if self.payload is None else self.payload.to_array()
        numbers = self.numbers.copy()
        numbers[self._last] -= self._body  # one that is not known yet is found anew
        return {
            'numbers': numbers,
            'covariance': self.covariance,
            'announced': self._announced,
            'found': self._found,
            'inflations': self._inflations,
            'payload': found,
        }

    def resume(self, state: Mapping[str, Array], seconds: float) -> None:
        """
        Go on from a state, so many seconds later; it is trusted once it has been better again.

        ValueError if the state is not of this arm.

        """
        kinds = {name: each.shape for name, each in self.state().items() if name != 'payload'}
        if any(
            name not in state or state[name].shape != shape or not np.isfinite(state[name]).all()
            for name, shape in kinds.items()
        ):
            raise ValueError('arrays of other shapes, or numbers that are not finite')
        found = state.get('payload', np.zeros(0))
        if found.shape not in ((0,), (NUMBERS,)) or not np.isfinite(seconds):
            raise ValueError('a payload or a time that is none')
        if not _is_covariance(state['covariance']) or (state['inflations'] < 1.0).any():
            raise ValueError('variances that are none')
        self.arm.carry(state['announced'])
        self._begin(self.arm.change_variance)
        self.numbers, self.covariance = state['numbers'].copy(), state['covariance'].copy()
        self._found, self._inflations = state['found'].copy(), state['inflations'].copy()
        self.payload = Payload.from_array(found) if found.size else None
        self.pause(max(seconds, 0.0))
        if self.carried is not None:
            self._tell_payload()

    def pause(self, seconds: float) -> None:
        """Let a time without samples pass [s]; the next sample may be of another clock."""
        self._go_back(seconds)
        self.arm.walk.spread(self.covariance, seconds)
        self._t = np.nan

    def _go_back(self, seconds: float) -> None:
        """Let friction return towards that of the fit for a time [s]."""
        centre, active = self.arm.start.copy(), self.arm.active
        centre[self._last] += self._found + self._body  # payloads say nothing of friction
        mean = self.numbers[active]
        self.arm.walk.go_back(mean, self.covariance, centre[active], seconds)
        self.numbers[active] = mean

    def announce(self, body: Array) -> None:
        """
        Carry a known body, shape (10,), in the frame of the last link that `lip_id export` writes.

        It takes the place of what was found or announced before; zeros for none. The fit has it
        too, so that it is trusted at once.

        """
        learned = self.numbers[self._last] - self.arm.start[self._last] - self._found - self._body
        self.arm.carry(np.linalg.solve(self.arm.export_frame, body))
        self.numbers[self._last] = self.arm.start[self._last] + learned
        self.numbers = self.arm.possible(self.numbers, self.covariance)
        self._drop()
        self.payload = None
        self._tell_payload()

    @property
    def carried_body(self) -> Array:
        """All that is carried, in the frame of `announce`, shape (10,)."""
        return np.asarray(self.arm.export_frame @ (self._announced + self._found))

    @property
    def carried(self) -> Payload | None:
        """The whole payload as it was found, or else the one that was announced."""
        if self.payload is not None or not self.announced_mass:
            return self.payload
        return payload_of(self.carried_body, np.zeros((BODY, BODY)))

    def _tell_payload(self) -> None:
        self.payload_events.append(PayloadEvent(self._t, self.carried))

    @property
    def announced_mass(self) -> float:
        """The mass of the payload that was announced [kg]."""
        return float(self._announced[0])

    @property
    def _announced(self) -> Array:
        return np.asarray(self.arm.start[self._last] - self.arm.arm.links[-1, :-1])

    @property
    def errors(self) -> tuple[float, float]:
        """Recent squared errors of what was learned and of the fit, in the noise's variance."""
        return self._recent.squares

    @property
    def trusted_numbers(self) -> Array:
        """The numbers of the arm as it is now, as far as that is trusted, shape (11 n + K,)."""
        return self.numbers if self.is_trusted else self.arm.start

    @property
    def is_trusted(self) -> bool:
        """Whether what was learned has been better than the fit, with few disturbances."""
        return self._recent.is_trusted

    @property
    def model(self) -> InverseDynamicsModel:
        """The arm as it is now, as far as that is trusted."""
        if not self.is_trusted:
            return self.arm.fitted
        return self.arm.model(self.numbers, self.covariance)

    def update(
        self,
        t: ArrayLike,
        q: ArrayLike,
        dq: ArrayLike,
        ddq: ArrayLike,
        tau: ArrayLike,
        left_out: ArrayLike = False,
    ) -> Followed:
        """
        Predict the torques of N samples one after the other, and learn from each after that.

        Parameters
        ----------
        t : array-like, shape (N,)
            Times [s], not before those of the last call.
        q, dq, ddq, tau : array-likes, shape (N, n)
            Positions [rad or m], velocities, accelerations, measured torques [N m or N].
        left_out : array-like, shape (N, n), optional
            Torques of which nothing is learned.

        Raises
        ------
        ShapeError
            If an array does not have its shape.
        DataError
            If a number is not finite, or times go back; nothing is learned then.

        """
        times, *arrays = self._checked(t, (q, dq, ddq, tau))
        columns = times, *arrays, np.broadcast_to(left_out, arrays[0].shape)
        breaks = np.flatnonzero(np.diff(times) > LONGEST_GAP_S) + 1
        edges = np.union1d(breaks, np.arange(0, max(len(times), 1), CHUNK)).tolist()
        return Followed.joined(
            [
                self._followed(*(x[first:last] for x in columns))
                for first, last in pairwise([*edges, len(times)])
            ]
        )

    def _followed(
        self, t: Array, q: Array, dq: Array, ddq: Array, measured: Array, left_out: BoolArray
    ) -> Followed:
        if not t.size:
            return Followed(q, q, q, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_))
        history, steps = self._history(t, q, dq), self._steps(t)
        self._go_back(steps.sum())
        torque, slopes = self.arm.linearised(self.numbers, q, dq, ddq, history)
        frozen = self.arm.fitted_torque(q, dq, ddq, history)
        noise = self._inflations * np.square(self.arm.noise.std_at(dq))
        rests = (np.abs(dq) < NEAR_REST * self.arm.speed) | left_out
        stuck = self._stuck(t, measured) & ~rests
        rests |= stuck
        inflation = self._inflation(steps)
        shown = np.where(rests | self._settling, np.inf, noise)
        predicted, variance, outcome = self._filtered(
            steps, torque, slopes, measured, shown, inflation
        )
        self._t, self._q = float(t[-1]), q[-1].copy()
        kind = self._kind(outcome, stuck, rests)
        trusted = np.full(len(t), self.is_trusted)
        total = (variance + noise) * np.maximum(self._recent.excess, 1.0)
        followed = Followed(predicted, np.sqrt(total), frozen, kind, trusted)
        std, learned = np.where(rests, np.inf, np.sqrt(noise)), kind == LEARNED
        residual = measured - predicted
        self._recent.judge(steps, residual, measured - frozen, std, outcome == DISTURBED)
        if self._recent.is_worse:
            self._forget()
            return followed
        samples = steps, residual, variance + noise, rests
        self._recent.widen(*(x[learned] for x in samples))
        slopes = slopes[..., self._last]
        self._look_for_payload(steps, slopes, residual, std**2, inflation, outcome)
        return followed

    def _filtered(
        self,
        steps: Array,
        torque: Array,
        slopes: Array,
        measured: Array,
        noise: Array,
        inflation: Array,
    ) -> tuple[Array, Array, Array]:
        """Learn from N samples; return torques expected before, their variances and outcomes."""
        arm, n_samples = self.arm, len(torque)
        mean = self.numbers[arm.active]
        expected = np.empty_like(torque), np.empty_like(torque), np.empty(n_samples)
        self._quiet = follow(
            mean,
            self.covariance,
            *arm.bounds,
            steps,
            arm.walk.covariance,
            arm.walk.growth(steps),
            torque,
            np.ascontiguousarray(slopes[..., arm.active]),
            measured,
            noise,
            inflation,
            self._gate,
            HOLD_S,
            self._quiet,
            *expected,
        )
        self.numbers[arm.active] = mean
        self.numbers = arm.possible(self.numbers, self.covariance)
        return expected

    def _forget(self) -> None:
        """Begin anew with the fit."""
        self.n_forgotten += 1
        # what may have changed is small, or a payload would be learned as friction
        self._begin(AFTER**2 * self.arm.change_variance)
        if self.payload is not None:
            self.payload = None
            self._tell_payload()

    @property
    def _gate(self) -> Array:
        """Deviations beyond which a torque is not that of the arm, by recent errors, (n,)."""
        if self._settling:
            return np.full_like(self._recent.excess, np.inf)
        return np.asarray(GATE * np.sqrt(np.maximum(self._recent.excess, 1.0)))

    def _inflation(self, steps: Array) -> Array:
        """
        Return the inflation of the noise of samples, (N,), by the time before each [s].

        Noise that lasts says as little in a second at any rate.

        """
        interval = self._interval_of_fit
        if interval is None:
            return np.full(steps.shape, self._inflation_of_fit)
        share = np.divide(interval, steps, out=np.full(steps.shape, np.inf), where=steps > 0.0)
        if np.isnan(self._t):
            share[0] = 0.0  # nothing is known of the noise before the first sample
        return np.asarray(np.maximum(self._inflation_of_fit * share, 1.0))

    def _kind(self, outcome: Array, stuck: BoolArray, rests: BoolArray) -> IntArray:
        """Return what became of N samples, with the reasons that the filter does not know."""
        kind = np.where((outcome == LEARNED) & stuck.any(axis=1), STUCK, outcome)
        kind = np.where((kind == LEARNED) & rests.all(axis=1), RESTING, kind)
        return np.where(self._settling, SETTLING, kind).astype(np.int64)

    def _stuck(self, t: Array, measured: Array) -> BoolArray:
        """Mark the torques (N, n) that have not changed for some time."""
        before = np.concatenate([self._tau[None], measured[:-1]])
        changes = np.abs(measured - before) > SAME * self.arm.noise.std
        # a time before the first, or of another clock, is none
        first = np.where(self._changed_at <= t[0], self._changed_at, t[0])
        at = np.maximum.accumulate(np.where(changes, t[:, None], first), axis=0)
        self._tau, self._changed_at = measured[-1].copy(), at[-1]
        return np.asarray(t[:, None] - at > STUCK_S)

    def _look_for_payload(
        self,
        steps: Array,
        slopes: Array,
        residual: Array,
        variance: Array,
        inflation: Array,
        outcome: Array,
    ) -> None:
        """Find a body that explains a disturbance, and learn it while it settles."""
        watch, body = self._watch, self._body
        first = 0
        if not self._settling and (outcome == LEARNED).any():
            watch.clear()
            first = int(np.flatnonzero(outcome == LEARNED)[-1]) + 1
        _, seconds = motion(steps[first:], variance[first:])
        residual = residual + slopes @ body
        watch.add(seconds, *(x[first:] for x in (slopes, residual, variance, inflation)))
        if watch.is_long_enough and watch.is_payload:
            self._settling |= bool(self._recent.excess_moving.max() < MOST_EXCESS)
        if self._settling:
            self._settle(body)
        elif watch.is_long_enough and watch.seconds > LONGEST_S:
            watch.clear()

    def _settle(self, before: Array) -> None:
        """Give the last link the body that explains most so far, for good when it is known."""
        watch, kept = self._watch, self.numbers[self._last] - before
        self._body = self.arm.possible_body(kept, watch.body, watch.information)
        is_payload = watch.is_payload
        self._settling = is_payload and not watch.is_settled
        if not is_payload:
            self._body = np.zeros(BODY)
        elif not self._settling:
            self._note_payload()
        self.numbers[self._last] = kept + self._body
        self.numbers = self.arm.possible(self.numbers, self.covariance)
        if not self._settling:
            self._body = np.zeros(BODY)
            watch.clear()

    def _note_payload(self) -> None:
        """Note the whole payload, with what was announced; without one the arm is as it was."""
        before, size = self._announced + self._found, self._watch.mean_square
        whole = before + self._body
        is_nothing = size(whole) < NOTHING + self._watch.unsure * size(self._body)
        if self.carried is not None and is_nothing:
            self.arm.carry(np.zeros(BODY))
            self._body, self._found, self.payload = -before, np.zeros(BODY), None
            self._inflations = np.ones_like(self._inflations)
        else:
            self._found = self._found + self._body
            frame = self.arm.export_frame
            self.payload = payload_of(frame @ whole, frame @ self._watch.covariance @ frame.T)
            left = self._watch.left_of_joints
            self._inflations = np.maximum(self._inflations * left, 1.0)
        self._tell_payload()

    def _steps(self, t: Array) -> Array:
        """Return the time since the sample before, shape (N,) [s]."""
        before = t[0] if np.isnan(self._t) else self._t
        return np.diff(t, prepend=before)

    def _history(self, t: Array, q: Array, dq: Array) -> JointHistory:
        """Return the states of Dahl's friction at the next samples, and keep the last."""
        begins = begins_of_times(t, np.zeros(len(t)))
        begins[0] = not 0.0 <= t[0] - self._t <= LONGEST_GAP_S
        before = q[:1] if begins[0] else self._q[None]
        path, rates = np.concatenate([before, q]), np.concatenate([dq[:1], dq])
        marks = np.concatenate([np.ones(1, dtype=np.bool_), begins])
        steps = Steps.of(path, rates, marks, self._revolute)
        states = dahl_states(Steps(steps.size[1:], steps.begins[1:]), self._dahl)
        self._dahl = states[-1].copy()
        return JointHistory(dahl=states)

    def _checked(self, t: ArrayLike, arrays: tuple[ArrayLike, ...]) -> list[Array]:
        times, *others = (np.array(x, dtype=np.float64, order='C') for x in (t, *arrays))
        shape = times.size, self.commissioned.n_joints
        for x in others:
            if times.ndim != 1 or x.shape != shape:
                raise ShapeError(
                    f't must have shape (N,) and q, dq, ddq, tau (N, {shape[1]}), but they have '
                    f'{times.shape} and {x.shape}; pass one row for each time.'
                )
        if not all(np.isfinite(x).all() for x in (times, *others)):
            raise DataError(
                'finite times, states and torques were expected, but some are not; leave these '
                'samples out.'
            )
        if (np.diff(times) < 0.0).any() or (times.size and times[0] < self._t):
            raise DataError('times that do not go back were expected, but they do; sort them.')
        return [times, *others]


def _is_covariance(matrix: Array) -> bool:
    """Return whether a matrix (p, p) is one, but for rounding."""
    if np.abs(matrix - matrix.T).max(initial=0.0) > NEARLY * np.abs(matrix).max(initial=0.0):
        return False
    values = np.linalg.eigvalsh(matrix)
    return bool(values.min(initial=0.0) >= -NEARLY * values.max(initial=0.0))


def _inflation_of(model: InverseDynamicsModel) -> float:
    """Return how much longer residuals last than white noise, where the fit has estimated it."""
    found = model.summary.get('covariance_inflation')
    if found is None or not np.isfinite(found):
        return NO_INFLATION
    return float(found)
