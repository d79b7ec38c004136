"""Plans: read from points, checked, and interpolated."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from lip_id_ros.arrays import Array
from lip_id_ros.signals.joints import (
    increasing_times,
    JointOrder,
    PlannedPoint,
    Refusal,
    RefusedError,
)

LARGEST = 1e6
"""No position, velocity or effort of an arm is larger, in SI units."""

CONSISTENT_TO = 0.05
"""Positions may differ from integrated velocities by this [rad or m] and the way between them: as
far as from a straight line does a cubic go that starts and ends at rest."""

AT_REST = 0.01
"""A plan may end at this velocity [rad/s or m/s]; its effort is held for ever."""


class EffortPoint(PlannedPoint, Protocol):
    """A point of a plan with feedforward."""

    @property
    def effort(self) -> Sequence[float]:
        """Feedforward [N m or N]; empty for none."""


class PlanArrays(NamedTuple):
    """Times (N,) [s], positions, velocities and accelerations (3, N, n), efforts (N, n)."""

    t: Array
    states: Array
    effort: Array


def read_points(
    order: JointOrder, names: Sequence[str], points: Sequence[EffortPoint]
) -> PlanArrays:
    """Return points of named joints in an order; RefusedError where they do not fit."""
    states = order.states(names, points)
    efforts = {len(point.effort) for point in points}
    if efforts not in ({0}, {len(names)}):
        raise RefusedError(Refusal.WRONG_LENGTH)
    effort = np.zeros(states.shape[1:])
    if efforts != {0}:
        listed = np.array([point.effort for point in points], dtype=np.float64)
        effort = listed[:, order.columns(names)]
    return PlanArrays(increasing_times(points), states, effort)


class Plan:
    """
    Cubic positions and linear efforts between points; the last point is held.

    RefusedError if there are no two points, times do not increase, a value is not finite or too
    large, the positions contradict the velocities, or the plan ends in motion.
    """

    def __init__(self, plan: PlanArrays) -> None:
        _check(plan)
        self._t, self._effort = plan.t, plan.effort
        self._q = CubicHermiteSpline(plan.t, plan.states[0], plan.states[1])
        self._dq = self._q.derivative()
        self.start: Array = plan.states[0, 0]
        self._begin_ns: int | None = None

    def at(self, stamp_ns: int) -> tuple[Array, Array, Array]:
        """Return positions, velocities and efforts (n,) at a stamp; the first is the beginning."""
        if self._begin_ns is None:
            self._begin_ns = stamp_ns
        time = 1e-9 * (stamp_ns - self._begin_ns)
        within = min(max(time, self._t[0]), self._t[-1])
        row = min(int(np.searchsorted(self._t, within, side='right')), len(self._t) - 1)
        share = (within - self._t[row - 1]) / (self._t[row] - self._t[row - 1])
        effort = (1 - share) * self._effort[row - 1] + share * self._effort[row]
        dq = self._dq(within) if time == within else np.zeros(self._effort.shape[1])
        return np.asarray(self._q(within)), np.asarray(dq), effort


def _check(plan: PlanArrays) -> None:
    t, (q, dq, _), effort = plan
    if len(t) < 2 or t[0] < 0.0 or not (np.diff(t) > 0.0).all():
        raise RefusedError(Refusal.NOT_INCREASING)
    if not (np.isfinite(plan.states).all() and np.isfinite(effort).all()):
        raise RefusedError(Refusal.NOT_FINITE)
    seconds, way = np.diff(t)[:, np.newaxis], np.diff(q, axis=0)
    with np.errstate(over='ignore'):
        between = way / seconds  # velocities
    if max(np.abs(values).max() for values in (q, dq, between, effort)) > LARGEST:
        raise RefusedError(Refusal.TOO_LARGE)
    contradiction = np.abs(way - 0.5 * (dq[:-1] + dq[1:]) * seconds)
    if (contradiction > CONSISTENT_TO + np.abs(way)).any():
        raise RefusedError(Refusal.CONTRADICTION)
    if np.abs(dq[-1]).max() > AT_REST:
        raise RefusedError(Refusal.ENDS_IN_MOTION)
