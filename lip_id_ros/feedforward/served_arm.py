"""
The arm that `serve` answers for: a model with the rules for its torques, of samples and of plans.

A new count of torques is a name in `COUNTED` here or in `shaping`, beside the line that counts it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.feedforward.interpolation import completed, Plan, plan_of_points, Torques
from lip_id_ros.feedforward.loading import LoadedModel
from lip_id_ros.feedforward.measured import MeasuredArm
from lip_id_ros.feedforward.plan_check import fits, fitting_scale
from lip_id_ros.feedforward.refinement import refined, RefinedPlan
from lip_id_ros.feedforward.settings import make_rules, Overload, SafeValue, ServeSettings
from lip_id_ros.feedforward.shaping import Shaper, TrainingRange
from lip_id_ros.model import Prediction, Query
from lip_id_ros.signals.joints import JointOrder, PlannedPoint, Point, Refusal, RefusedError
from lip_id_ros.signals.torque_steps import Sent

COUNTED = ('slowed', 'late_plans', 'added_points', 'sparse_plans')
"""
Keys of ~/status: plans that were slowed down or came out late, points that were added to plans,
plans that lack such points.
"""

LEAST_SPEED = 1e-3
"""A plan that is slower stands still."""

LEAST_BEGIN_S, EARLY_S, REST_SPEED = 0.2, 0.05, 0.02
"""
A plan whose first point is reached later than the first [s] gets points on the way there from an
arm at rest [rad/s or m/s]. The first of them is reached at the second [s]: sooner, or where the
arm moves, that way would be a jerk by what is not known of its position.
"""

LATE_S = 0.1
"""A plan that comes out later than this after its begin deserves a warning."""

LEAST_SHARE = 0.01
"""Of the largest torque of a joint in a plan: interpolated efforts are not asked to be better."""


@dataclass(frozen=True, eq=False)
class ServedTorque:
    """
    Answer to one sample of a stream, in the model's order.

    `tau`, shape (n,): the torque that may leave [N m or N]. `query`: torque and energies as the
    model has them. `state`, shape (3, n). `std`, shape (n,): standard deviations of the torque
    [N m or N], where they are due.
    """

    tau: Array
    query: Query
    state: Array
    std: Array | None = None


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
        self._settings = settings
        self._std_at = -np.inf

    def adjust(self, settings: ServeSettings) -> None:
        """Use other settings; what the robot holds stays, and ramps go on."""
        rules = make_rules(settings, self.joint_names)
        self.shaper.adjust(rules)
        if self.loaded.adapted is not None:
            self.loaded.adapted.adjust(rules.follow)
        self.measured.adjust(settings.residual_cutoff_hz)
        self._settings = settings

    def sample(
        self, names: Sequence[str], points: Sequence[Point], now: float, speed: float
    ) -> ServedTorque:
        """Answer one sample of a stream; joints that the model does not know are left out."""
        state = self._order.states(names, points)[:, 0] * speed ** np.arange(3.0)[:, None]
        query = self.loaded.query(state, now)
        std = self._new_deviation(state, now)
        if self.shaper.rules.friction:
            wanted = self._with_gravity(query)
        else:
            wanted = self._torques(*state[:, np.newaxis])[0]
        tau = self.shaper.sample(wanted, now, state)
        return ServedTorque(tau, query, state, std)

    def plan(
        self,
        names: Sequence[str],
        points: Sequence[PlannedPoint],
        here: Array | None,
        speed: float,
        late: float,
    ) -> RefinedPlan:
        """
        Answer a plan, which must move joints of the model and no others, in its own order.

        `here`, shape (2, n): position and velocity of the arm where they are known. `late`: time
        since the plan begins [s].
        """
        if len(points) > self.shaper.rules.max_plan_points:
            raise RefusedError(Refusal.TOO_LONG)
        if not set(names) <= set(self.joint_names):
            raise RefusedError(Refusal.FOREIGN_JOINT)
        plan = completed(plan_of_points(names, points), self.joint_names, here)
        if late > plan.t[-1]:
            raise RefusedError(Refusal.ENDED_PLAN)
        start = _start(plan, here) if abs(late) < EARLY_S else None
        if start is not None:
            plan = plan.begun_at(start, EARLY_S)

        def torques(q: Array, dq: Array, ddq: Array, t: Array) -> Array:
            return self._torques(q, speed * dq, speed**2 * ddq, t / max(speed, LEAST_SPEED))

        plan = plan.slowed(self._time_scale(plan, torques))
        adds, noise = self._settings.refine_plans, self.loaded.model.noise_std
        most = self.shaper.rules.max_plan_points
        found = refined(plan, torques, noise, LEAST_SHARE, most, adds=adds)
        if start is not None:
            found = found.without_first()
        shaped = self.shaper.plan(found.tau, found.plan.t, found.states)
        self._counts['late_plans'] += late > LATE_S
        self._counts['added_points'] += found.added
        self._counts['sparse_plans'] += not adds and found.is_sparse
        order = [*names, *(each for each in self.joint_names if each not in names)]
        return replace(found, tau=shaped).in_order(order)

    def _time_scale(self, plan: Plan, torques: Torques) -> float:
        """
        Return the factor on the times of a plan with which its torques are within limits.

        1 where overload_policy is to cut them; RefusedError where it refuses the plan, or no
        factor helps.
        """
        overload, limits = self.shaper.rules.overload, self.shaper.rules.limits
        if overload is Overload.CUT:
            return 1.0

        def commanded(*motion: Array) -> Array:
            return self.shaper.rules.scale * torques(*motion)

        scale: float | None
        if overload is Overload.SLOW:
            scale = fitting_scale(commanded, plan, limits)
        else:
            scale = 1.0 if fits(commanded, plan, limits) else None
        if scale is None:
            raise RefusedError(Refusal.BEYOND_LIMITS)
        self._counts['slowed'] += scale > 1.0
        return scale

    def _torques(self, q: Array, dq: Array, ddq: Array, t: Array | None = None) -> Array:
        found = self.loaded.newest.predict(q, dq, ddq, t)
        if self.shaper.rules.friction:
            return self._with_gravity(found)
        rigid = found.inertial + found.coriolis
        if self.shaper.rules.gravity:
            rigid = rigid + found.gravity
        return self.loaded.model.efforts(rigid)

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

    def _new_deviation(self, state: Array, now: float) -> Array | None:
        """Return standard deviations (n,), at most `std_rate_hz` times a second."""
        due = now - self._std_at >= 1.0 / self._settings.std_rate_hz
        if not due or not self._settings.publish_std:
            return None
        self._std_at = now
        std: Array = self.loaded.model.standard_deviation(*state[:, np.newaxis]).tau[0]
        return std


def _start(plan: Plan, here: Array | None) -> Array | None:
    """
    Return the position (n,) from which points on the way to the first one are added, if any.

    None beyond half a turn: of a joint without stops the controller takes the shorter way.
    """
    if here is None or plan.t[0] <= LEAST_BEGIN_S or np.abs(here[1]).max() >= REST_SPEED:
        return None
    if np.abs(plan.states[0, 0] - here[0]).max() > np.pi:
        return None
    return np.asarray(here[0])
