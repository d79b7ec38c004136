"""
Efforts of plans: points are added where a controller would interpolate efforts badly.

A joint_trajectory_controller interpolates efforts linearly, and positions by splines: between two
points at rest the efforts would be those of rest. So points are added on the spline, where the
controller moves through them as it would without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IndexArray
from lip_id_ros.feedforward.interpolation import Motion, Plan, Torques
from lip_id_ros.signals.joints import Refusal, RefusedError

STEP_S = 0.01
"""Points are not added more closely: controllers run at 100 to 1000 Hz."""

FIRST_SAMPLES, FIRST_STEPS, STRAIGHT = 2500, 3, 0.5
"""
A long plan is looked at so often at first, and in so many steps of a segment. Where torques of
neighbours are off a line by more than a share of their bounds, steps are halved down to `STEP_S`.
"""

MOST_SAMPLES = 40_000
"""They take 0.1 to 0.2 s; a plan that needs more is refused."""

TINY = 1e-9
"""In place of a bound of zero [N m or N]."""


@dataclass(frozen=True, eq=False)
class RefinedPlan:
    """
    A plan with efforts.

    `plan`: with the points that were added; they have velocities and accelerations where both
    neighbours have. `tau`: efforts (N, n) of its points [N m or N]. `states`: positions,
    velocities and accelerations (3, N, n) of the motion at its points. `added`: how many of the
    points were added. `missed`: largest error of efforts that are interpolated, shape (n,)
    [N m or N], and `is_sparse`: whether that is more than points would be added for.
    """

    plan: Plan
    tau: Array
    states: Array
    added: int
    missed: Array
    is_sparse: bool

    def without_first(self) -> RefinedPlan:
        """Return the plan without its first point."""
        plan = Plan(self.plan.joint_names, self.plan.t[1:], self.plan.states[:, 1:])
        return replace(self, plan=plan, tau=self.tau[1:], states=self.states[:, 1:])

    def in_order(self, joint_names: Sequence[str]) -> RefinedPlan:
        """Return the plan with its joints in another order."""
        columns = [self.plan.joint_names.index(name) for name in joint_names]
        return replace(
            self,
            plan=self.plan.in_order(joint_names),
            tau=self.tau[:, columns],
            states=self.states[:, :, columns],
            missed=self.missed[columns],
        )


def refined(
    plan: Plan, torques: Torques, least_error: Array, share: float, most: int, *, adds: bool = True
) -> RefinedPlan:
    """
    Compute efforts at the points of a plan, and at as many between as linear interpolation needs.

    Its error stays within `least_error` (n,) [N m or N], or a share of the largest torque, but for
    `STEP_S` beside points at which accelerations step. `adds`: whether points are added.
    RefusedError if a torque is not finite, or it would take more than `most` points.
    """
    # what is held at the end
    rest = Motion(plan.t[-1:], np.nan_to_num(plan.states[:, -1:]))
    last = _torques(torques, rest)
    if len(plan.t) == 1:
        return RefinedPlan(plan, last, rest.states, 0, np.zeros(last.shape[1]), False)
    look = _looked(plan, torques, last, least_error, share, adds)
    rows = np.union1d(look.begins, look.ends)
    if adds:
        rows = _with_needed(look, rows)
    # a point is the end of one segment and the begin of the next
    rows = rows[(look.number[rows] < 0) | np.isin(rows, [0, *look.ends])]
    if len(rows) > most:
        raise RefusedError(Refusal.TOO_LONG)
    of_plan = look.number[rows]
    added, states = of_plan < 0, look.motion.states[:, rows]
    points, t = np.full_like(states, np.nan), look.motion.t[rows]
    n_known = _known(plan)[look.segment[rows[added]]]
    for kind in range(3):
        here = np.flatnonzero(added)[n_known > kind]
        points[kind, here] = states[kind, here]
    points[:, ~added], t[~added] = plan.states, plan.t
    missed = look.errors(rows).max(axis=0)
    made = Plan(plan.joint_names, t, points)
    tau = look.bounds * look.given[rows]
    is_sparse = bool((missed > 1.0).any())
    return RefinedPlan(made, tau, states, int(added.sum()), look.bounds * missed, is_sparse)


@dataclass(frozen=True, eq=False)
class _Look:
    """
    Samples of a motion in the order of time, M, with torques (M, n) in units of `bounds` (n,).

    `segment` of each (M,), and the `number` of the point that it is (M,), or -1. `given`: torques
    with efforts at the points: means of both sides, and those of rest at the end.
    """

    segment: IndexArray
    motion: Motion
    tau: Array
    given: Array
    bounds: Array

    @cached_property
    def begins(self) -> IndexArray:
        return np.flatnonzero(np.diff(self.segment, prepend=-1))

    @cached_property
    def ends(self) -> IndexArray:
        return np.flatnonzero(np.diff(self.segment, append=self.segment[-1] + 1))

    @cached_property
    def number(self) -> IndexArray:
        number = np.full(len(self.segment), -1, dtype=np.intp)
        number[self.begins], number[self.ends] = np.arange(len(self.ends)), self.segment[self.ends]
        number[self.ends] += 1
        return number

    def errors(self, rows: IndexArray) -> Array:
        """Return errors (M, n) of torques that are interpolated between those of some rows."""
        t, of_rows = self.motion.t, self.motion.t[rows]
        lines = [np.interp(t, of_rows, each) for each in self.given[rows].T]
        return np.asarray(np.abs(self.tau - np.stack(lines, axis=1)))


def _looked(
    plan: Plan, torques: Torques, last: Array, least_error: Array, share: float, closely: bool
) -> _Look:
    """Sample a plan, where that is asked for as closely as its torques are bent in time."""
    segment, within = _first_times(plan)
    while True:
        motion = plan.motion_at(segment, within)
        tau = _torques(torques, motion)
        bounds = np.maximum(least_error, share * np.abs(tau).max(axis=0)) + TINY
        given, last_of = tau.copy(), np.flatnonzero(np.diff(segment))
        given[last_of] = given[last_of + 1] = 0.5 * (tau[last_of] + tau[last_of + 1])
        given[-1] = last[0]
        look = _Look(segment, motion, tau / bounds, given / bounds, bounds)
        step = np.diff(motion.t, append=motion.t[-1])
        parts = 1 + (_is_bent(look) & (step > 1.5 * STEP_S))
        if not closely or parts.max() == 1:
            return look
        if parts.sum() > MOST_SAMPLES:
            raise RefusedError(Refusal.TOO_LONG)
        rows = np.repeat(np.arange(len(parts)), parts)
        nth = np.arange(len(rows)) - (np.cumsum(parts) - parts)[rows]
        within = within[rows] + nth / parts[rows] * step[rows]
        segment = segment[rows]


def _first_times(plan: Plan) -> tuple[IndexArray, Array]:
    """Return segments and times within these [s], `STEP_S` beside points among them."""
    seconds = np.diff(plan.t)
    least = np.where(seconds > 2.0 * STEP_S, FIRST_STEPS, 1)
    segment, within = plan.even_times(STEP_S, FIRST_SAMPLES, least)
    wide = np.flatnonzero(seconds > 1.5 * STEP_S * (np.bincount(segment) - 1))
    segment = np.concatenate([segment, wide, wide])
    within = np.concatenate([within, np.full(len(wide), STEP_S), seconds[wide] - STEP_S])
    order = np.lexsort([within, segment])
    return segment[order], within[order]


def _is_bent(look: _Look) -> BoolArray:
    """Return whether torques are not straight at one of the ends of the step after a sample."""
    t, tau, bent = look.motion.t, look.tau, look.number < 0
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, np.newaxis]
    off = np.abs(tau[1:-1] - (1.0 - share) * tau[:-2] - share * tau[2:]).max(axis=1)
    bent[1:-1] &= off > STRAIGHT
    bent[:-1] |= bent[1:]
    bent[look.ends] = False
    return bent


def _with_needed(look: _Look, rows: IndexArray) -> IndexArray:
    """Return rows, with those between at which the error of interpolation is too large."""
    seconds = look.motion.t[look.ends] - look.motion.t[look.begins]
    may = (seconds > 2.0 * STEP_S)[look.segment]
    off = np.abs(look.given - look.tau).max(axis=1) > 1.0
    beside = np.concatenate([look.begins[off[look.begins]] + 1, look.ends[off[look.ends]] - 1])
    rows = np.union1d(rows, beside[may[beside]])
    while True:
        error = np.where(may, look.errors(rows).max(axis=1), 0.0)
        error[rows] = 0.0
        worst = np.repeat(np.maximum.reduceat(error, rows), np.diff(rows, append=len(error)))
        needed = np.flatnonzero((error > 1.0) & (error == worst))
        if not len(needed):
            return rows
        rows = np.union1d(rows, needed)


def _torques(torques: Torques, motion: Motion) -> Array:
    t, (q, dq, ddq) = motion
    tau = torques(q, dq, ddq, t)
    if not np.isfinite(tau).all():
        raise RefusedError(Refusal.NOT_FINITE_TORQUE)
    return tau


def _known(plan: Plan) -> IndexArray:
    """Return what both ends of each segment have: 1 positions, 2 velocities, 3 accelerations."""
    has = ~np.isnan(plan.states[1:]).any(axis=-1)  # (2, N)
    both = has[:, :-1] & has[:, 1:]
    return np.asarray(1 + both[0] + (both[0] & both[1]), dtype=np.intp)
