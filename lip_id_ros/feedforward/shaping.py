"""Shaping of the torques that `serve` outputs: doubts, scale, limits, ramp, rate."""

from __future__ import annotations

from collections import Counter

import numpy as np

from lip_id_ros.arrays import Array, BoolArray
from lip_id_ros.feedforward.settings import Policy, Rules
from lip_id_ros.signals.joints import Refusal, RefusedError
from lip_id_ros.signals.torque_steps import between, Ramp, Sent, toward

COUNTED = ('limited', 'rate_limited', 'out_of_range')
"""Keys of ~/status: torques that were cut, and doubtful references."""

SMALLEST = 1e-12
"""In place of a range or a standard deviation of zero: whatever differs is beyond it."""


class TrainingRange:
    """Smallest box around the training samples: states `low` and `high`, shape (3, n)."""

    def __init__(self, low: Array, high: Array) -> None:
        self._low, self._high = low, high
        self._centre = 0.5 * (low + high)
        self._edge = np.maximum(0.5 * (high - low), SMALLEST)

    def widened(self, margins: Array) -> TrainingRange:
        """Return the range with `margins` (n,), as a share of half of it, added to each side."""
        more = 0.5 * margins * (self._high - self._low)
        return TrainingRange(self._low - more, self._high + more)

    def excess(self, states: Array) -> Array:
        """
        Compute how far outside samples (3, n) or (3, N, n) are; 1 is at the edge, 0 in the centre.

        It is that of the worst joint.
        """
        shape = (3, *[1] * (states.ndim - 2), -1)
        distance = np.abs(states - self._centre.reshape(shape)) / self._edge.reshape(shape)
        return np.asarray(distance.max(axis=(0, -1)))


def factors(policy: Policy, excess: Array, counts: Counter[str], key: str) -> Array:
    """
    Return factors on the torques of all joints where `excess` is above 1 or not a number.

    With `scale` they fall from 1 at the edge to 0 at twice its distance, with `zero` at once. The
    doubtful samples are counted under `key`.
    """
    excess = np.where(np.isnan(excess), np.inf, excess)
    counts[key] += int(np.count_nonzero(excess > 1.0))
    if policy is Policy.SCALE:
        return np.clip(2.0 - excess, 0.0, 1.0)
    if policy is Policy.ZERO:
        return np.where(excess > 1.0, 0.0, 1.0)
    return np.ones_like(excess)


class Shaper:
    """Bring torques into the form in which they may leave, from those that the robot holds."""

    def __init__(
        self, rules: Rules, trained: TrainingRange, sent: Sent, counts: Counter[str]
    ) -> None:
        self.rules = rules
        self.sent = sent
        self._trained, self._known = trained, trained.widened(rules.margins)
        self._counts = counts
        self._ramp = Ramp()
        self._is_safe = False

    def begin(self) -> None:
        """Ramp the next torque in from what the robot holds."""
        self._ramp.begin()

    def rest(self, now: float) -> None:
        """Note that zero torque was published [s]: the next one is ramped in from there."""
        self.sent = Sent(np.zeros_like(self.sent.tau), now)
        self.begin()

    def adjust(self, rules: Rules) -> None:
        """Use other rules of the same joints; a torque that they change is ramped to."""
        if not self.rules.same_torque(rules):
            self.begin()
        self.rules, self._known = rules, self._trained.widened(rules.margins)

    def sample(self, tau: Array, now: float, state: Array) -> Array:
        """
        Shape one torque (n,) of a stream; the first after safe torques begins a ramp.

        `state`, shape (3, n): its q, dq, ddq. The result is finite, within the limits, no further
        from the one before than the rates allow. RefusedError if a torque is not finite.
        """
        return self._shape(self._range_factors(state) * tau, now, is_safe=False)

    def safe(self, tau: Array, now: float) -> Array:
        """Shape the safe torque of shape (n,) [N m or N]; the first begins a ramp."""
        return self._shape(tau, now, is_safe=True)

    def plan(self, tau: Array, t: Array, states: Array) -> Array:
        """
        Shape the torques (N, n) of a plan at times (N,), without a ramp: that is for streams.

        `states`, shape (3, N, n). RefusedError if a torque is not finite.
        """
        safe, limited = self._scaled(self._range_factors(states)[:, np.newaxis] * tau)
        self._counts['limited'] += int(np.count_nonzero(limited.any(axis=-1)))
        if np.isfinite(self.rules.rates).any():
            self._counts['rate_limited'] += _slow_down(safe, t, self.rules.rates)
        return safe

    def _shape(self, tau: Array, now: float, is_safe: bool) -> Array:
        wanted, limited = self._scaled(tau)
        if is_safe != self._is_safe:  # only here, where nothing is refused any more
            self._is_safe = is_safe
            self.begin()
        duration_s = self.rules.safe_ramp_s if is_safe else self.rules.ramp_s
        ramped = self._ramp.blend(self.sent.tau, wanted, now, duration_s)
        rated = self.sent.step_toward(ramped, now, self.rules.rates)
        self._counts['limited'] += int(limited.any())
        self._counts['rate_limited'] += int((rated != ramped).any())
        # again, since the limits may have become narrower than what was sent last
        self.sent = Sent(between(rated, -self.rules.limits, self.rules.limits), now)
        return self.sent.tau

    def _range_factors(self, states: Array) -> Array:
        policy = self.rules.range_policy
        if policy is Policy.IGNORE:
            return np.ones(states.shape[1:-1])
        return factors(policy, self._known.excess(states), self._counts, 'out_of_range')

    def _scaled(self, tau: Array) -> tuple[Array, BoolArray]:
        scaled = self.rules.scale * tau
        if not np.isfinite(scaled).all():
            raise RefusedError(Refusal.NOT_FINITE_TORQUE)
        safe = between(scaled, -self.rules.limits, self.rules.limits)
        return safe, safe != scaled


def _slow_down(tau: Array, t: Array, rates: Array) -> int:
    """Hold the slopes between the points of a plan within the rates; return how many were cut."""
    cut = 0
    elapsed = np.maximum(np.diff(t), 1e-6)
    if (np.abs(np.diff(tau, axis=0)) <= elapsed[:, np.newaxis] * rates).all():
        return 0  # as most plans: the loop takes a millisecond for 200 points
    for row, seconds in enumerate(elapsed, start=1):
        slower = toward(tau[row - 1], tau[row], seconds * rates)
        cut += int((slower != tau[row]).any())
        tau[row] = slower
    return cut
