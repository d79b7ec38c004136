"""Paths of joints: which samples continue one another, and the states of Dahl's friction."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array, BoolArray, IntArray
from lip_id_ros.joint_history import DISPLACEMENTS
from lip_id_ros.numba_jit import jit

LONGEST_GAP_S = 0.5
"""Time without samples after which nothing is known of the friction's state [s]."""

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


def dahl_states(q: Array, begins: BoolArray, start: Array | None = None) -> Array:
    """
    Return the states of Dahl's friction along a path, shape (N, n, D), between -1 and 1.

    dz/dx = (1 - z sign(dx)) / delta in the displacement x (Dahl, The Aerospace Corporation
    TOR-0158, 1968) has a closed form between samples, so that neither rates nor the noise of
    velocities matter. 0 where a path begins, since nothing is known there.

    Parameters
    ----------
    q : array, shape (N, n)
    begins : bool array, shape (N,)
        Samples that do not continue the one before.
    start : array, shape (n, D), optional
        State at the first sample.

    """
    first = np.zeros((q.shape[1], len(DISPLACEMENTS))) if start is None else start
    return np.asarray(_dahl(np.ascontiguousarray(q), begins, first, np.array(DISPLACEMENTS)))


def unknown_share(q: Array, begins: BoolArray) -> Array:
    """Return how much of each of `dahl_states` is still that of an unknown start, (N, n, D)."""
    lengths = np.abs(np.diff(q, axis=0, prepend=q[:1]))
    begins = begins | ~np.isfinite(lengths).all(axis=1)
    lengths[begins] = 0.0
    travelled = np.cumsum(lengths, axis=0)
    since = np.maximum.accumulate(np.where(begins, np.arange(len(q)), 0))
    return np.asarray(np.exp(-(travelled - travelled[since])[..., None] / np.array(DISPLACEMENTS)))


@jit
def _dahl(q: Array, begins: BoolArray, start: Array, displacements: Array) -> Array:
    out = np.zeros((*q.shape, len(displacements)))
    out[0] = start
    for t in range(1, len(q)):
        if begins[t]:
            continue
        for j in range(q.shape[1]):
            dx = q[t, j] - q[t - 1, j]
            if not np.isfinite(dx):
                continue  # nothing is known after it
            sign = np.sign(dx)
            for d in range(len(displacements)):
                rest = np.exp(-abs(dx) / displacements[d])
                out[t, j, d] = sign + (out[t - 1, j, d] - sign) * rest
    return out


def begins_of_times(t: Array, segment: Array | IntArray) -> BoolArray:
    """Mark the samples that do not continue the one before, shape (N,), by times [s]."""
    steps = np.diff(t)
    gaps = (np.diff(segment) != 0) | ~((steps > 0.0) & (steps <= LONGEST_GAP_S))
    return np.concatenate([np.ones(1, dtype=np.bool_), gaps])


def begins_of_states(q: Array, dq: Array, ddq: Array) -> BoolArray | None:
    """
    Mark the rows that do not continue the one before, shape (N,), where times are not known.

    Rows are a path if some time step leads from most of them to the next position and velocity. It
    begins anew where positions are farther apart than their velocities reach in a usual step. None
    where most rows do not follow: they are single states, in no order.

    Parameters
    ----------
    q, dq, ddq : arrays, shape (N, n)

    """
    if len(q) < 2:
        return None
    speed = np.sqrt(np.mean(dq**2, axis=0))
    scale = np.where(speed > 0.0, speed, np.inf)
    dx, dv = np.diff(q, axis=0) / scale, np.diff(dq, axis=0) / scale
    v, a = ((0.5 * (x[1:] + x[:-1])) / scale for x in (dq, ddq))
    rests = np.abs(v).max(axis=1) < AT_REST
    with np.errstate(divide='ignore', invalid='ignore'):
        step = np.sum(dx * v, axis=1) / np.sum(v**2, axis=1)
        follows = _norm(dx - v * step[:, None]) <= ALIGNED * _norm(dx)
        agrees = _norm(dv - a * step[:, None]) <= AGREE * (_norm(dv) + _norm(a) * step)
    moves = ~rests & follows & agrees & (step > 0.0) & (step <= LONGEST_GAP_S)
    if not moves.any() or moves.sum() < LEAST_CONTINUING * np.count_nonzero(~rests):
        return None
    usual, rows = float(np.median(step[moves])), _norm(dq / scale)
    farthest = FARTHEST * usual * (np.maximum(rows[1:], rows[:-1]) + SLOWEST)
    return np.concatenate([np.ones(1, dtype=np.bool_), ~(_norm(dx) <= farthest)])


def _norm(rows: Array) -> Array:
    return np.asarray(np.linalg.norm(rows, axis=1))
