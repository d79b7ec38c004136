"""Torques and energies of unit parameters (docs/maths.md, section 10)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.chain import (
    ANGULAR,
    Chain,
    move,
    new_links,
    PARAMETERS,
    place_joint,
)
from lip_id_ros.kernels.rigid_links.vectors import cross, turn_back
from lip_id_ros.kernels.rigid_links.wrench import shift, wrench_columns

Array = NDArray[np.float64]


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
    links = new_links(n)
    columns = np.empty((6, PARAMETERS - 1))
    now, before = np.empty((2, 3)), np.empty((2, 3))
    for t in range(count):
        move(links, chain, q[t], dq[t], ddq[t])
        for j in range(n):
            out[t, j, PARAMETERS * j + PARAMETERS - 1] = ddq[t, j]
            wrench_columns(columns, links.motions[j + 1])
            for c in range(PARAMETERS - 1):
                for k in range(3):
                    now[0, k], now[1, k] = columns[k, c], columns[3 + k, c]
                for i in range(j, -1, -1):
                    row = 1 if chain.prismatic[i] else 0
                    out[t, i, PARAMETERS * j + c] = now[row, 2]
                    shift(before, now, links.rotations[i], links.offsets[i], links.work)
                    now[:] = before
    return out


@compiled
def kinetic_regressor(chain: Chain, q: Array, dq: Array) -> Array:
    """Kinetic energies of unit parameters at (N, n) positions and velocities, (N, 11 n)."""
    count, n = q.shape
    out = np.zeros((count, PARAMETERS * n))
    links, still = new_links(n), np.zeros(n)
    v, past = np.zeros(3), np.zeros(3)
    for t in range(count):
        move(links, chain, q[t], dq[t], still)
        v[:] = 0.0
        for j in range(n):
            cross(links.motions[j, ANGULAR], links.offsets[j], past)
            for k in range(3):
                past[k] += v[k]
            turn_back(links.rotations[j], past, v)
            if chain.prismatic[j]:
                v[2] += dq[t, j]
            _kinetic(out[t, PARAMETERS * j :], links.motions[j + 1, ANGULAR], v, dq[t, j])
    return out


@compiled
def _kinetic(out: Array, w: Array, v: Array, dq: float) -> None:
    out[0] = 0.5 * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    cross(v, w, out[1:4])
    out[4], out[5], out[6] = 0.5 * w[0] * w[0], w[0] * w[1], w[0] * w[2]
    out[7], out[8], out[9] = 0.5 * w[1] * w[1], w[1] * w[2], 0.5 * w[2] * w[2]
    out[10] = 0.5 * dq * dq


@compiled
def potential_regressor(chain: Chain, q: Array) -> Array:
    """Potential energies of unit parameters at (N, n) positions, shape (N, 11 n)."""
    count, n = q.shape
    out = np.zeros((count, PARAMETERS * n))
    rotation, offset = np.empty((3, 3)), np.empty(3)
    up, past = np.empty(3), np.empty(3)
    for t in range(count):
        height = 0.0
        up[:] = -chain.gravity
        for j in range(n):
            place_joint(rotation, offset, chain, j, q[t, j])
            for k in range(3):
                height += up[k] * offset[k]
                past[k] = up[k]
            turn_back(rotation, past, up)
            out[t, PARAMETERS * j] = height
            out[t, PARAMETERS * j + 1 : PARAMETERS * j + 4] = up
    return out
