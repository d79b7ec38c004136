"""One arm and its output: from the model's torque to one that may leave (ADR 8)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.checks import factors, std_excess, TrainingRange
from lip_id_ros.feedforward.feedforward import Answer
from lip_id_ros.feedforward.loading import Arm
from lip_id_ros.feedforward.measured import Measured
from lip_id_ros.feedforward.rules import make_rules, Policy, SafeValue
from lip_id_ros.feedforward.settings import ServeSettings
from lip_id_ros.feedforward.shaping import Sent, Shaper
from lip_id_ros.signals.trajectories import PlannedPoint, Point, times


class ServedArm:
    """
    Torques of one arm, checked and shaped.

    Parameters
    ----------
    arm : Arm
    settings : ServeSettings
    counts : Counter
        Gets what was limited and what was doubtful.
    sent : Sent
        What the robot holds.

    Raises
    ------
    ConfigError
        If the settings do not fit the joints.

    Attributes
    ----------
    arm : Arm
    measured : Measured
    shaper : Shaper

    """

    def __init__(
        self,
        arm: Arm,
        settings: ServeSettings,
        counts: Counter[str],
        sent: Sent,
    ) -> None:
        self.arm = arm
        self._counts = counts
        self.shaper = Shaper(make_rules(settings, self.joint_names), sent, counts)
        self._settings = settings
        self._known = self._new_known()
        self.measured = self._new_measured()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Of the model."""
        return self.arm.feedforward.joint_names

    @property
    def stale_timeout_s(self) -> float:
        """Longest silence of a stream [s]."""
        return self.shaper.rules.stale_timeout_s

    def adjust(self, settings: ServeSettings) -> None:
        """
        Take other settings over; what the robot holds stays.

        Raises
        ------
        ConfigError
            If they do not fit the joints.

        """
        self.shaper.rules = make_rules(settings, self.joint_names)
        self._known = self._new_known()
        cutoff_hz, self._settings = self._settings.residual_cutoff_hz, settings
        if settings.residual_cutoff_hz != cutoff_hz:
            self.measured = self._new_measured()

    def sample(
        self, names: Sequence[str], points: Sequence[Point], now: float, tag: Any
    ) -> tuple[Answer, Array]:
        """
        Answer one sample of a stream.

        Returns
        -------
        Answer, ndarray of shape (n,)
            Of the model, and the torque that may leave [N m or N].

        Raises
        ------
        RefusedError
            If it cannot be answered.

        """
        answer = self.arm.feedforward.sample(names, points)
        tau = answer.tau if self.shaper.rules.gravity else answer.tau - answer.gravity
        factor = self._range_factors(answer.state) * self._std_factor(answer.state, now, tag)
        return answer, self.shaper.sample(factor * tau, now)

    def plan(self, names: Sequence[str], points: Sequence[PlannedPoint]) -> Array:
        """
        Answer a plan.

        Returns
        -------
        ndarray, shape (number of points, n)
            Torques that may leave [N m or N], in the plan's order.

        Raises
        ------
        RefusedError
            If it cannot be answered.

        """
        parts, states = self.arm.feedforward.plan(names, points)
        tau = parts.tau if self.shaper.rules.gravity else parts.tau - parts.gravity
        factor = self._range_factors(states)[:, np.newaxis]
        tau = self.shaper.plan(factor * tau, times(points))
        return self.arm.feedforward.in_message_order(names, tau)

    def safe_torque(self, position: Array | None, now: float) -> Array:
        """Return what a robot gets that hears no references, shape (n,) [N m or N]."""
        rules = self.shaper.rules
        tau = np.zeros(len(self.joint_names))
        if rules.safe_value is SafeValue.GRAVITY and rules.gravity and position is not None:
            gravity = self.arm.feedforward.gravity(position)
            tau = gravity if np.isfinite(gravity).all() else tau
        return self.shaper.sample(tau, now)

    def _range_factors(self, states: Array) -> Array:
        rules = self.shaper.rules
        if rules.range_policy is Policy.OFF:
            return np.ones(states.shape[1:-1])
        excess = self._known.excess(states)
        return factors(rules.range_policy, excess, self._counts, 'out_of_range')

    def _std_factor(self, state: Array, now: float, tag: Any) -> Array:
        rules, deviations = self.shaper.rules, self.arm.deviations
        if deviations is None:
            return np.ones(())
        period_s = 1.0 / self._settings.std_rate_hz
        deviations.offer(state, tag, now, period_s)
        if rules.std_policy is Policy.OFF:
            return np.ones(())
        excess = std_excess(deviations.std(now, period_s), rules.std_limits)
        return factors(rules.std_policy, excess, self._counts, 'uncertain')

    def _new_known(self) -> TrainingRange:
        return self.arm.training_range.widened(self.shaper.rules.margins)

    def _new_measured(self) -> Measured:
        cutoff_hz = self._settings.residual_cutoff_hz
        return Measured(self.arm.feedforward, self.arm.calibration, cutoff_hz)
