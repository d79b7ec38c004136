"""From a reference to the model's torque, and to the torque that is output, for one arm."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.settings import make_rules, Policy, SafeValue, ServeSettings
from lip_id_ros.feedforward.shaping import factors, Sent, Shaper, std_excess, TrainingRange
from lip_id_ros.model import Prediction, Query
from lip_id_ros.recording.joint_messages import JointMessage
from lip_id_ros.signals.filters import LowPass
from lip_id_ros.signals.joint_states import JointStateReader, MeasuredState
from lip_id_ros.signals.joints import (
    increasing_times,
    JointOrder,
    PlannedPoint,
    Point,
    Refusal,
    RefusedError,
    stack,
)


@dataclass(frozen=True, eq=False)
class ServedTorque:
    """
    Answer to one reference sample.

    Attributes
    ----------
    tau : ndarray, shape (n,)
        The torque that may leave [N m or N], in the model's order.
    query : Query
        Torque and energies as the model has them.
    state : ndarray, shape (3, n)
        Positions, velocities, accelerations in the model's order.

    """

    tau: Array
    query: Query
    state: Array


class ServedArm:
    """
    Torques of one arm, checked and shaped (ADR 8), and what its joint states show.

    Parameters
    ----------
    loaded : LoadedModel
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
    loaded : LoadedModel
    shaper : Shaper

    """

    def __init__(
        self, loaded: LoadedModel, settings: ServeSettings, counts: Counter[str], sent: Sent
    ) -> None:
        self.loaded = loaded
        self._model = loaded.model
        self._counts = counts
        self._settings = settings
        self._order = JointOrder(self.joint_names)
        self._measured = JointStateReader(self.joint_names, loaded.calibration)
        self._low_pass = LowPass(settings.residual_cutoff_hz)
        self.shaper = Shaper(make_rules(settings, self.joint_names), sent, counts)
        self._trained = TrainingRange(*loaded.model.training_range)
        self._known = self._trained.widened(self.shaper.rules.margins)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Joints of the model, base to tip."""
        return self.loaded.joint_names

    def adjust(self, settings: ServeSettings) -> None:
        """
        Use other settings; what the robot holds stays, and ramps go on.

        Raises
        ------
        ConfigError
            If they do not fit the joints.

        """
        self.shaper.adjust(make_rules(settings, self.joint_names))
        self._known = self._trained.widened(self.shaper.rules.margins)
        if settings.residual_cutoff_hz != self._settings.residual_cutoff_hz:
            self._low_pass = LowPass(settings.residual_cutoff_hz)
        self._settings = settings

    # references

    def sample(
        self, names: Sequence[str], points: Sequence[Point], now: float, tag: Any
    ) -> ServedTorque:
        """
        Answer one sample of a stream; joints that the model does not know are left out.

        Raises
        ------
        RefusedError
            If it cannot be answered.

        """
        columns = self._order.columns(names)
        state = stack(points, len(names))[:, 0].take(columns, axis=1)
        query = self._model.query(*state)
        tau = self._with_gravity(query)
        factor = self._range_factors(state) * self._std_factor(state, now, tag)
        return ServedTorque(self.shaper.sample(factor * tau, now), query, state)

    def plan(self, names: Sequence[str], points: Sequence[PlannedPoint]) -> Array:
        """
        Answer a plan, which must move the model's joints and no others.

        Returns
        -------
        ndarray, shape (number of points, n)
            Torques that may leave [N m or N], in the plan's order.

        Raises
        ------
        RefusedError
            If it cannot be answered.

        """
        if len(points) > self.shaper.rules.max_plan_points:
            raise RefusedError(Refusal.TOO_LONG)
        columns = self._order.columns(names)
        if len(columns) != len(names):
            raise RefusedError(Refusal.FOREIGN_JOINT)
        states = stack(points, len(names))[:, :, columns]
        t = increasing_times(points)
        predicted = self._model.predict(*states)
        tau = self._with_gravity(predicted)
        ordered = np.empty_like(tau)
        ordered[:, columns] = self.shaper.plan(self._range_factors(states)[:, np.newaxis] * tau, t)
        return ordered

    def safe_torque(self, position: Array | None, now: float) -> Array:
        """Return the torque of an arm without references, last seen here, shape (n,)."""
        return self.shaper.safe(self._safe_target(position), now)

    def components(self, state: Array) -> Prediction:
        """Predict the parts of the torque at one state of shape (3, n), arrays (1, n)."""
        return self._model.predict(*state[:, np.newaxis])

    # joint states

    def measured(self, message: JointMessage) -> MeasuredState:
        """
        Read a joint state.

        Raises
        ------
        RefusedError
            If a joint of the model is missing or named twice, or a value missing or not finite.

        """
        return self._measured.read(message)

    def energies(self, measured: MeasuredState) -> Query:
        """Return the energies at a measured state; the torques are those without acceleration."""
        return self._model.query(measured.q, measured.dq, np.zeros_like(measured.q))

    def residual(self, measured: MeasuredState) -> Array | None:
        """
        Return measured torque minus the model's, both filtered alike.

        Positions, velocities and torques go through one low-pass; the acceleration is the
        derivative of the filtered velocity. So all have the same delay.

        Parameters
        ----------
        measured : MeasuredState
            The next one; stamps must rise.

        Returns
        -------
        ndarray, shape (n,), or None
            [N m or N]; None without measured torques, and until the filter has settled after a
            gap or a stamp that does not rise.

        """
        if measured.tau is None:
            return None
        signals = np.stack([measured.q, measured.dq, measured.tau])
        filtered = self._low_pass.add(measured.t, signals)
        if filtered is None:
            return None
        (q, dq, tau), (_, ddq, _) = filtered
        with np.errstate(all='ignore'):
            residual = tau - self._model.query(q, dq, ddq).tau
        return residual if np.isfinite(residual).all() else None

    def _with_gravity(self, predicted: Query | Prediction) -> Array:
        """Return torques, without gravity where the robot adds its own."""
        if self.shaper.rules.gravity:
            return predicted.tau
        return predicted.tau - self._model.efforts(predicted.gravity)

    def _safe_target(self, position: Array | None) -> Array:
        rules, zero = self.shaper.rules, np.zeros(len(self.joint_names))
        if rules.safe_value is SafeValue.ZERO or not rules.gravity or position is None:
            return zero
        gravity = self._model.efforts(self._model.query(position, zero, zero).gravity)
        return gravity if np.isfinite(gravity).all() else zero

    def _range_factors(self, states: Array) -> Array:
        rules = self.shaper.rules
        if rules.range_policy is Policy.OFF:
            return np.ones(states.shape[1:-1])
        excess = self._known.excess(states)
        return factors(rules.range_policy, excess, self._counts, 'out_of_range')

    def _std_factor(self, state: Array, now: float, tag: Any) -> Array:
        rules, deviations = self.shaper.rules, self.loaded.deviations
        if deviations is None:
            return np.ones(())
        period_s = 1.0 / self._settings.std_rate_hz
        deviations.offer(state, tag, now, period_s)
        if rules.std_policy is Policy.OFF:
            return np.ones(())
        excess = std_excess(deviations.std(now, period_s), rules.std_limits)
        return factors(rules.std_policy, excess, self._counts, 'uncertain')
