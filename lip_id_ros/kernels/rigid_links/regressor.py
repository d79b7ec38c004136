"""Torques and energies of unit parameters (docs/maths.md, section 10)."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.chain import (
    carried,
    Chain,
    load_place,
    Motion,
    PARAMETERS,
    Place,
    place,
    store_place,
    upward,
    velocity,
    with_joint,
)
from lip_id_ros.kernels.rigid_links.triples import cross, dot, NOTHING, outward, plus, Triple
from lip_id_ros.kernels.rigid_links.wrench import row_along_joint, shifted, Wrench


@compiled
def torque_regressor(chain: Chain, q: Array, dq: Array, ddq: Array) -> Array:
    """
    Torques of unit parameters.

    Parameters
    ----------
    chain : Chain
    q, dq, ddq : arrays, shape (N, n)
        Joint states; contiguous.

    Returns
    -------
    array, shape (N, n, 11 n)

    """
    count, n = q.shape
    out = np.zeros((count, n, PARAMETERS * n))
    places = np.empty((n, 4, 3))
    columns = np.empty((6, PARAMETERS - 1))
    for t in range(count):
        motion = Motion(NOTHING, NOTHING, upward(chain))
        for j in range(n):
            at = place(chain, j, q[t, j])
            store_place(places, j, at)
            motion = with_joint(carried(motion, at), chain.prismatic[j], dq[t, j], ddq[t, j])
            _wrench_columns(columns, motion)
            out[t, j, PARAMETERS * (j + 1) - 1] = ddq[t, j]
            for i in range(j, -1, -1):
                row = row_along_joint(chain.prismatic[i])
                for c in range(PARAMETERS - 1):
                    out[t, i, PARAMETERS * j + c] = columns[row, c]
                _shift_columns(columns, load_place(places, i))
    return out


@compiled
def _wrench_columns(out: Array, motion: Motion) -> None:
    """Set the wrenches (6, 10) of unit parameters of a link, torque before force."""
    (w0, w1, w2), (a0, a1, a2), (d0, d1, d2) = motion
    out[:] = 0.0
    out[3, 0], out[4, 0], out[5, 0] = d0, d1, d2
    out[0, 2], out[0, 3] = d2, -d1
    out[1, 1], out[1, 3] = -d2, d0
    out[2, 1], out[2, 2] = d1, -d0
    out[3, 1], out[3, 2], out[3, 3] = -w1 * w1 - w2 * w2, w0 * w1 - a2, w0 * w2 + a1
    out[4, 1], out[4, 2], out[4, 3] = w0 * w1 + a2, -w0 * w0 - w2 * w2, w1 * w2 - a0
    out[5, 1], out[5, 2], out[5, 3] = w0 * w2 - a1, w1 * w2 + a0, -w0 * w0 - w1 * w1
    out[0, 4], out[1, 4], out[2, 4] = a0, w0 * w2, -w0 * w1
    out[0, 5], out[1, 5], out[2, 5] = a1 - w0 * w2, a0 + w1 * w2, w0 * w0 - w1 * w1
    out[0, 6], out[1, 6], out[2, 6] = a2 + w0 * w1, w2 * w2 - w0 * w0, a0 - w1 * w2
    out[0, 7], out[1, 7], out[2, 7] = -w1 * w2, a1, w0 * w1
    out[0, 8], out[1, 8], out[2, 8] = w1 * w1 - w2 * w2, a2 - w0 * w1, a1 + w0 * w2
    out[0, 9], out[1, 9], out[2, 9] = w1 * w2, -w0 * w2, a2


@compiled
def _shift_columns(x: Array, at: Place) -> None:
    for c in range(PARAMETERS - 1):
        one = Wrench((x[0, c], x[1, c], x[2, c]), (x[3, c], x[4, c], x[5, c]))
        (x[0, c], x[1, c], x[2, c]), (x[3, c], x[4, c], x[5, c]) = shifted(one, at)


@compiled
def kinetic_regressor(chain: Chain, q: Array, dq: Array) -> Array:
    """Kinetic energies of unit parameters at (N, n) positions and velocities, (N, 11 n)."""
    count, n = q.shape
    out = np.zeros((count, PARAMETERS * n))
    for t in range(count):
        w = v = NOTHING
        for j in range(n):
            at = place(chain, j, q[t, j])
            v = velocity(v, w, at, chain.prismatic[j], dq[t, j])
            w = outward(at.axes, w)
            if not chain.prismatic[j]:
                w = plus(w, (0.0, 0.0, dq[t, j]))
            _kinetic(out[t, PARAMETERS * j :], w, v, dq[t, j])
    return out


@compiled
def _kinetic(out: Array, w: Triple, v: Triple, dq: float) -> None:
    out[0] = 0.5 * dot(v, v)
    out[1], out[2], out[3] = cross(v, w)
    out[4], out[5], out[6] = 0.5 * w[0] * w[0], w[0] * w[1], w[0] * w[2]
    out[7], out[8], out[9] = 0.5 * w[1] * w[1], w[1] * w[2], 0.5 * w[2] * w[2]
    out[10] = 0.5 * dq * dq


@compiled
def potential_regressor(chain: Chain, q: Array) -> Array:
    """Potential energies of unit parameters at (N, n) positions, shape (N, 11 n)."""
    count, n = q.shape
    out = np.zeros((count, PARAMETERS * n))
    for t in range(count):
        height, up = 0.0, upward(chain)
        for j in range(n):
            at = place(chain, j, q[t, j])
            height += dot(up, at.origin)
            up = outward(at.axes, up)
            first = PARAMETERS * j
            out[t, first] = height
            out[t, first + 1], out[t, first + 2], out[t, first + 3] = up
    return out
