"""States of Dahl's friction along paths of the joints."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.joint_types import DISPLACEMENTS
from lip_id_ros.numba_jit import jit

LONGEST_GAP_S = 0.5
"""Time without samples after which nothing is known of the friction's state [s]."""

BEFORE_S = 0.25
"""Time for which a joint is taken to have had the velocity with which a path begins [s]."""

TURN = 2.0 * np.pi

ALIGNED, AGREE = 0.3, 0.5
"""
Largest errors, as shares, with which rows follow from their velocities, and velocities from their
accelerations.
"""

LEAST_CONTINUING = 0.5
"""Share of the moving rows that continue the one before, below which they are single states."""

AT_REST = 1e-3
"""Velocities are none below this share of their root mean square."""

FARTHEST, SLOWEST = 3.0, 0.1
"""
Usual steps that a path goes at most to the next row, and the least speed of one, as a share of its
root mean square.
"""


def dahl_states(steps: Steps, start: Array | None = None) -> Array:
    """
    Return the states of Dahl's friction along a path, shape (N, n, D), between -1 and 1.

    dz/dx = (1 - z sign(dx)) / delta in the displacement x (Dahl, The Aerospace Corporation
    TOR-0158, 1968) has a closed form between samples, so that neither rates nor the noise of
    velocities matter. Without a start (n, D) the first sample begins a path.
    """
    shape = steps.size.shape[1], len(DISPLACEMENTS)
    before = np.zeros(shape) if start is None else start
    return np.asarray(_dahl(steps.size, steps.begins, before, np.array(DISPLACEMENTS)))


def unknown_share(steps: Steps) -> Array:
    """Return how much of each of `dahl_states` is still that of an unknown start, (N, n, D)."""
    lengths = np.abs(steps.size)
    travelled = np.cumsum(lengths, axis=0)
    first = np.maximum.accumulate(
        np.where(steps.begins, np.arange(len(lengths))[:, None], 0), axis=0
    )
    since = travelled - np.take_along_axis(travelled - lengths, first, axis=0)
    return np.asarray(np.exp(-since[..., None] / np.array(DISPLACEMENTS)))


@jit
def _dahl(size: Array, begins: BoolArray, before: Array, displacements: Array) -> Array:
    out = np.empty((*size.shape, len(displacements)))
    for t in range(len(size)):
        for j in range(size.shape[1]):
            sign = np.sign(size[t, j])
            for d in range(len(displacements)):
                state = 0.0
                if not begins[t, j]:
                    state = out[t - 1, j, d] if t > 0 else before[j, d]
                out[t, j, d] = sign + (state - sign) * np.exp(-abs(size[t, j]) / displacements[d])
    return out


@jit
def advance_dahl(step: float, dq: float, begins: bool, is_revolute: bool, states: Array) -> None:
    """Advance the states (D,) of one joint by a step, as `Steps` and `dahl_states` do."""
    if is_revolute:
        step -= TURN * np.round(step / TURN)
    if begins or not np.isfinite(step):
        step = BEFORE_S * dq if np.isfinite(dq) else 0.0
        states[:] = 0.0
    sign = np.sign(step)
    for d in range(len(DISPLACEMENTS)):
        states[d] = sign + (states[d] - sign) * np.exp(-abs(step) / DISPLACEMENTS[d])


class Steps(NamedTuple):
    """
    The displacements of joints along a path.

    Where a path begins nothing is known but the velocity: a joint is as if it had moved with it
    for `BEFORE_S`, so that one in motion has the friction of its sign, and one that rests has any.
    """

    size: Array  # (N, n), from the sample before [rad or m]
    begins: BoolArray  # (N, n), before which nothing is known

    @classmethod
    def of(cls, q: Array, dq: Array, begins: BoolArray, revolute: BoolArray) -> Steps:
        """
        Return the steps between samples, of which `begins` do not continue the one before.

        Angles of revolute joints may be reported up to whole turns.
        """
        size = unwrapped(np.diff(q, axis=0, prepend=q[:1]), revolute)
        unknown = begins[:, None] | ~np.isfinite(size)
        before = np.where(np.isfinite(dq), BEFORE_S * dq, 0.0)
        return cls(np.where(unknown, before, size), unknown)


def unwrapped(steps: Array, revolute: BoolArray) -> Array:
    """Return steps of joints (..., n) without the whole turns of those that are revolute."""
    return np.where(revolute, steps - TURN * np.round(steps / TURN), steps)


def begins_of_times(t: Array, segment: Array | IntArray) -> BoolArray:
    """Mark the samples that do not continue the one before, shape (N,), by times [s]."""
    steps = np.diff(t)
    # equal stamps are those of a coarse clock
    gaps = (np.diff(segment) != 0) | ~((steps >= 0.0) & (steps <= LONGEST_GAP_S))
    return np.concatenate([np.ones(1, dtype=np.bool_), gaps])


def begins_of_states(q: Array, dq: Array, ddq: Array, revolute: BoolArray) -> BoolArray | None:
    """
    Mark the rows (N,) that do not continue the one before, where times are not known.

    Rows are a path if some time step leads from most of them to the next position and velocity. It
    begins anew where positions are farther apart than their velocities reach in a usual step. None
    where most rows do not follow: they are single states, in no order.
    """
    if len(q) < 2:
        return None
    speed = np.sqrt(np.mean(dq**2, axis=0))
    scale = np.where(speed > 0.0, speed, np.inf)
    step, way, rests, rate = _compared(q, dq, ddq, scale, revolute)
    moves = (step > 0.0) & (step <= LONGEST_GAP_S)
    if not moves.any() or moves.sum() < LEAST_CONTINUING * np.count_nonzero(~rests):
        return None
    farthest = FARTHEST * np.median(step[moves]) * (np.maximum(rate[1:], rate[:-1]) + SLOWEST)
    return np.concatenate([np.ones(1, dtype=np.bool_), ~(way <= farthest)])


@jit
def _compared(
    q: Array, dq: Array, ddq: Array, scale: Array, revolute: BoolArray
) -> tuple[Array, Array, BoolArray, Array]:
    """
    Compare rows with the next, in units of the scale.

    Return the time step that leads there, nan where none does or the arm rests; the way; whether
    it rests, each (N - 1,); and the speeds (N,).
    """
    count, n = q.shape
    step, way = np.full(count - 1, np.nan), np.zeros(count - 1)
    rests, rate = np.ones(count - 1, dtype=np.bool_), np.zeros(count)
    dx, dv, v, a = np.empty((4, n))
    for t in range(count):
        for j in range(n):
            rate[t] += (dq[t, j] / scale[j]) ** 2
    for t in range(count - 1):
        along = speed = turned = change = aside = beside = 0.0
        for j in range(n):
            dx[j], dv[j] = q[t + 1, j] - q[t, j], (dq[t + 1, j] - dq[t, j]) / scale[j]
            if revolute[j] and abs(dx[j]) > 0.5 * TURN:
                dx[j] -= TURN * np.round(dx[j] / TURN)
            dx[j] /= scale[j]
            v[j] = 0.5 * (dq[t + 1, j] + dq[t, j]) / scale[j]
            a[j] = 0.5 * (ddq[t + 1, j] + ddq[t, j]) / scale[j]
            rests[t] &= abs(v[j]) < AT_REST
            way[t] += dx[j] ** 2
            along, speed = along + dx[j] * v[j], speed + v[j] ** 2
            turned, change = turned + dv[j] ** 2, change + a[j] ** 2
        leads = along / speed
        for j in range(n):
            aside += (dx[j] - v[j] * leads) ** 2
            beside += (dv[j] - a[j] * leads) ** 2
        most = AGREE * (np.sqrt(turned) + np.sqrt(change) * leads)
        if not rests[t] and aside <= ALIGNED**2 * way[t] and np.sqrt(beside) <= most:
            step[t] = leads
    way, rate = np.sqrt(way), np.sqrt(rate)
    return step, way, rests, rate
