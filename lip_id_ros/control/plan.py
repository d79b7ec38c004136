"""
Plans.

Cubic positions and linear efforts between points, read as one table of bytes. A message of 50,000
points takes a second as objects, and the commands would stop meanwhile.
"""

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
from lip_id_ros.signals.trajectory_header import ENCAPSULATION, read_header, TrajectoryHeader

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


WORD, DOUBLE = 4, 8


def read_serialised(raw: bytes, order: JointOrder, most_points: int) -> PlanArrays:
    """
    Return the points of a plan in an order of joints.

    `raw`: the message, in CDR of either byte order. `most_points`: of a plan that is read.
    RefusedError if it ends before, has no or too many points, or joints or lengths do not fit.
    """
    header = read_header(raw)
    columns = order.columns(header.names)
    if header.n_points == 0:
        raise RefusedError(Refusal.NO_POINTS)
    if header.n_points > most_points:
        raise RefusedError(Refusal.TOO_LONG)
    table = _table(raw, header)
    kinds = ('positions', 'velocities', 'accelerations')
    states = np.stack([table[kind].astype(np.float64) for kind in kinds])
    if not np.isfinite(states).all():  # of joints that are not controlled too
        raise RefusedError(Refusal.NOT_FINITE)
    effort = np.zeros((len(table), len(columns)))
    if 'effort' in (table.dtype.names or ()):
        effort = table['effort'].astype(np.float64).take(columns, axis=1)
    t = table['sec'] + 1e-9 * table['nanosec']
    return PlanArrays(t, states.take(columns, axis=2), effort)


def _table(raw: bytes, header: TrajectoryHeader) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Return one row a point; RefusedError unless all arrays are as long as the joint names."""
    n = len(header.names)
    body = raw[ENCAPSULATION:] + bytes(DOUBLE)  # a row ends with the padded count of the next
    first = -(-(header.at + WORD) // DOUBLE) * DOUBLE  # the first position
    array = DOUBLE * n + DOUBLE  # with the count behind it, padded
    word = np.dtype(f'{header.order}u4')

    def counts(at: int, dtype: np.dtype[np.void] | np.dtype[np.uint32]) -> object:
        if at + dtype.itemsize > len(body):
            raise RefusedError(Refusal.WRONG_LENGTH)
        return np.frombuffer(body, dtype, 1, at)[0]

    has_effort = counts(first + 3 * array - DOUBLE, word) != 0
    row = _row(header.order, n, array, has_effort)
    next_count = DOUBLE if has_effort else WORD
    end = first + header.n_points * row.itemsize - next_count
    if end > len(body) - DOUBLE or counts(header.at, word) != n:
        raise RefusedError(Refusal.WRONG_LENGTH)
    table = np.frombuffer(body, row, header.n_points, first)
    lengths = [table['n_velocities'], table['n_accelerations'], table['n_positions'][:-1]]
    if any((each != n).any() for each in lengths) or (table['n_effort'] != has_effort * n).any():
        raise RefusedError(Refusal.WRONG_LENGTH)
    return table


def _row(order: str, n: int, array: int, has_effort: bool) -> np.dtype[np.void]:
    """Return the layout of a point from its first position on, and the count of the next."""
    numbers, word = (f'{order}f8', (n,)), f'{order}u4'
    time = 4 * array - DOUBLE if has_effort else 3 * array - WORD
    fields = {
        'positions': (numbers, 0),
        'n_velocities': (word, array - DOUBLE),
        'velocities': (numbers, array),
        'n_accelerations': (word, 2 * array - DOUBLE),
        'accelerations': (numbers, 2 * array),
        'n_effort': (word, 3 * array - DOUBLE),
        'sec': (f'{order}i4', time),
        'nanosec': (word, time + WORD),
        'n_positions': (word, time + 2 * WORD),
    }
    if has_effort:
        fields['effort'] = (numbers, 3 * array)
    return np.dtype(
        {
            'names': list(fields),
            'formats': [kind for kind, _ in fields.values()],
            'offsets': [at for _, at in fields.values()],
            'itemsize': (4 if has_effort else 3) * array + DOUBLE,
        }
    )
