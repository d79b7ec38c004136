"""
Efforts of plans: points are added where a controller would interpolate efforts badly.

A joint_trajectory_controller interpolates efforts linearly, and positions by splines: between two
points at rest the efforts would be those of rest. So points are added on the spline, where the
controller moves through them as it would without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lip_id_ros.arrays import Array, IndexArray
from lip_id_ros.feedforward.interpolation import Motion, Plan, Torques
from lip_id_ros.signals.joints import Refusal, RefusedError

STEP_S = 0.01
"""Points are not added more closely: controllers run at 100 to 1000 Hz."""

TINY = 1e-9
"""In place of a bound of zero [N m or N]."""


@dataclass(frozen=True, eq=False)
class Filled:
    """
    A plan with efforts.

    `plan`: with the points that were added; they have velocities and accelerations where both
    neighbours have. `tau`: efforts (N, n) of its points [N m or N]. `states`: positions,
    velocities and accelerations (3, N, n) of the motion at its points. `added`: how many of the
    points were added. `missed`: largest error of efforts that are interpolated, shape (n,), and
    `bounds` (n,) for which points would be added [N m or N].
    """

    plan: Plan
    tau: Array
    states: Array
    added: int
    missed: Array
    bounds: Array

    @property
    def misses(self) -> bool:
        """Whether efforts between the points are further off than points would be added for."""
        return bool((self.missed > self.bounds).any())

    def without_first(self) -> Filled:
        """Return the plan without its first point."""
        plan = Plan(self.plan.joint_names, self.plan.t[1:], self.plan.states[:, 1:])
        return replace(self, plan=plan, tau=self.tau[1:], states=self.states[:, 1:])

    def in_order(self, joint_names: Sequence[str]) -> Filled:
        """Return the plan with its joints in another order."""
        columns = [self.plan.joint_names.index(name) for name in joint_names]
        return Filled(
            self.plan.in_order(joint_names),
            self.tau[:, columns],
            self.states[:, :, columns],
            self.added,
            self.missed[columns],
            self.bounds[columns],
        )


def filled(
    plan: Plan, torques: Torques, least_error: Array, share: float, *, adds: bool = True
) -> Filled:
    """
    Compute efforts at the points of a plan, and at as many between as linear interpolation needs.

    Its error stays within `least_error` (n,) [N m or N], or a share of the largest torque, but for
    `STEP_S` beside points at which accelerations step. `adds`: whether points are added.
    """
    motion, begins = plan.motion_of_segments(STEP_S)
    t, (q, dq, ddq) = motion
    tau = torques(q, dq, ddq, t)
    ends = np.append(begins[1:], len(t)) - 1 if len(begins) else begins
    if not np.isfinite(tau).all():
        raise RefusedError(Refusal.NOT_FINITE_TORQUE)
    bounds = np.maximum(least_error, share * np.abs(tau).max(axis=0)) + TINY
    rest = np.nan_to_num(plan.states[:, -1:])  # what is held at the end
    last = torques(rest[0], rest[1], rest[2], t[-1:])[0]
    # of the two sides of a point
    given = np.concatenate([tau[:1], 0.5 * (tau[ends[:-1]] + tau[begins[1:]]), last[None]])
    if len(plan.t) == 1:
        given = last[None]
    rows, of_plan = _chosen(motion, tau, given, begins, ends, bounds if adds else None)
    added = of_plan < 0
    states, points = motion.states[:, rows], np.full((3, len(rows), q.shape[1]), np.nan)
    n_known = _known(plan)[np.searchsorted(begins, rows[added], 'right') - 1]
    for kind in range(3):
        here = np.flatnonzero(added)[n_known > kind]
        points[kind, here] = states[kind, here]
    points[:, ~added] = plan.states[:, of_plan[~added]]
    times = np.where(added, t[rows], plan.t[np.maximum(of_plan, 0)])
    efforts = np.where(added[:, None], tau[rows], given[np.maximum(of_plan, 0)])
    missed = np.abs(tau - _interpolated(t, times, efforts)).max(axis=0)
    made = Plan(plan.joint_names, times, points)
    return Filled(made, efforts, states, int(added.sum()), missed, bounds)


def _chosen(
    motion: Motion,
    tau: Array,
    given: Array,
    begins: IndexArray,
    ends: IndexArray,
    bounds: Array | None,
) -> tuple[IndexArray, IndexArray]:
    """Return rows of a motion, and the points of the plan that they are, -1 where added."""
    if not len(begins):
        return np.array([0]), np.array([0])
    rows, points = [int(begins[0])], [0]
    for number, (begin, end) in enumerate(zip(begins.tolist(), ends.tolist(), strict=True)):
        if bounds is not None and motion.t[end] - motion.t[begin] > 2.0 * STEP_S:
            between = _between(
                motion.t[begin : end + 1],
                tau[begin : end + 1] / bounds,
                given[number] / bounds,
                given[number + 1] / bounds,
            )
            rows += [begin + row for row in between]
            points += [-1] * len(between)
        rows.append(end)
        points.append(number + 1)
    return np.array(rows), np.array(points)


def _between(t: Array, tau: Array, first: Array, last: Array) -> list[int]:
    """
    Return the rows of a segment (N, n) at which points are needed, both ends left out.

    Torques are in units of their bounds. `first` and `last` are the efforts of the ends: where
    these are means of both sides, or those of rest, the neighbour is needed too.
    """
    end = len(t) - 1
    needed = {0, end}
    if np.abs(tau[0] - first).max() > 1.0:
        needed.add(1)
    if np.abs(tau[end] - last).max() > 1.0:
        needed.add(end - 1)
    known = tau.copy()
    known[0], known[end] = first, last
    parts = list(zip(sorted(needed)[:-1], sorted(needed)[1:], strict=True))
    while parts:
        low, high = parts.pop()
        if high - low < 2:
            continue
        share = ((t[low:high] - t[low]) / (t[high] - t[low]))[:, None]
        error = np.abs(tau[low:high] - (1.0 - share) * known[low] - share * known[high])
        error[0] = 0.0
        worst = int(np.argmax(error.max(axis=1)))
        if error[worst].max() > 1.0:
            middle = low + worst
            needed.add(middle)
            parts += [(low, middle), (middle, high)]
    return sorted(needed - {0, end})


def _known(plan: Plan) -> IndexArray:
    """Return what both ends of each segment have: 1 positions, 2 velocities, 3 accelerations."""
    has = ~np.isnan(plan.states[1:]).any(axis=-1)  # (2, N)
    both = has[:, :-1] & has[:, 1:]
    return np.asarray(1 + both[0] + (both[0] & both[1]), dtype=np.intp)


def _interpolated(t: Array, times: Array, efforts: Array) -> Array:
    return np.stack([np.interp(t, times, each) for each in efforts.T], axis=1)
