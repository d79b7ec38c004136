"""Torques and energies of unit link parameters: the regressor (maths.md, section 10)."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit
from lip_id_ros.rigid_body.chain import (
    add_coupled_rows,
    add_joint_motion,
    base_acceleration,
    Chain,
    joint_row,
    joint_transform,
    LINK_PARAMETERS,
    serial_motion,
)
from lip_id_ros.rigid_body.spatial import (
    add,
    cross,
    dot,
    load_transform,
    propagate_motion,
    propagate_velocity,
    SpatialMotion,
    store_transform,
    to_child,
    Transform,
    transform_wrench,
    Vec3,
    Wrench,
    ZERO,
)


@jit
def torque_regressor(chain: Chain, q: Array, dq: Array, ddq: Array) -> Array:
    """Torques of unit parameters, shape (N, n, 11 n), at contiguous joint states (N, n)."""
    count, n = q.shape
    out = np.zeros((count, n, LINK_PARAMETERS * n))
    faster = ddq
    q, dq, ddq = (serial_motion(chain, q), serial_motion(chain, dq), serial_motion(chain, ddq))
    transforms = np.empty((n, 4, 3))
    columns = np.empty((6, LINK_PARAMETERS - 1))
    for t in range(count):
        motion = SpatialMotion(ZERO, ZERO, base_acceleration(chain))
        for j in range(n):
            x = joint_transform(chain, j, q[t, j])
            store_transform(transforms, j, x)
            motion = add_joint_motion(
                propagate_motion(motion, x), chain.prismatic[j], dq[t, j], ddq[t, j]
            )
            _wrench_columns(columns, motion)
            for i in range(j, -1, -1):
                row = joint_row(chain.prismatic[i])
                for c in range(LINK_PARAMETERS - 1):
                    out[t, i, LINK_PARAMETERS * j + c] = columns[row, c]
                _transform_columns(columns, load_transform(transforms, i))
        add_coupled_rows(out[t], chain)
        for j in range(n):  # a rotor turns with its drive
            out[t, j, LINK_PARAMETERS * (j + 1) - 1] = faster[t, j]
    return out


@jit
def _wrench_columns(out: Array, motion: SpatialMotion) -> None:
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


@jit
def _transform_columns(columns: Array, x: Transform) -> None:
    for c in range(LINK_PARAMETERS - 1):
        torque = columns[0, c], columns[1, c], columns[2, c]
        force = columns[3, c], columns[4, c], columns[5, c]
        torque, force = transform_wrench(Wrench(torque, force), x)
        columns[0, c], columns[1, c], columns[2, c] = torque
        columns[3, c], columns[4, c], columns[5, c] = force


@jit
def kinetic_regressor(chain: Chain, q: Array, dq: Array) -> Array:
    """Kinetic energies of unit parameters at (N, n) positions and velocities, (N, 11 n)."""
    count, n = q.shape
    out = np.zeros((count, LINK_PARAMETERS * n))
    of_drives, q, dq = dq, serial_motion(chain, q), serial_motion(chain, dq)
    for t in range(count):
        w = v = ZERO
        for j in range(n):
            x = joint_transform(chain, j, q[t, j])
            v = propagate_velocity(v, w, x)
            w = to_child(x.rotation, w)
            if chain.prismatic[j]:
                v = add(v, (0.0, 0.0, dq[t, j]))
            else:
                w = add(w, (0.0, 0.0, dq[t, j]))
            _kinetic(out[t, LINK_PARAMETERS * j :], w, v, of_drives[t, j])
    return out


@jit
def _kinetic(out: Array, w: Vec3, v: Vec3, dq: float) -> None:
    out[0] = 0.5 * dot(v, v)
    out[1], out[2], out[3] = cross(v, w)
    out[4], out[5], out[6] = 0.5 * w[0] * w[0], w[0] * w[1], w[0] * w[2]
    out[7], out[8], out[9] = 0.5 * w[1] * w[1], w[1] * w[2], 0.5 * w[2] * w[2]
    out[10] = 0.5 * dq * dq


@jit
def potential_regressor(chain: Chain, q: Array) -> Array:
    """Potential energies of unit parameters at (N, n) positions, shape (N, 11 n)."""
    count, n = q.shape
    out = np.zeros((count, LINK_PARAMETERS * n))
    q = serial_motion(chain, q)
    for t in range(count):
        height, up = 0.0, base_acceleration(chain)
        for j in range(n):
            x = joint_transform(chain, j, q[t, j])
            height += dot(up, x.translation)
            up = to_child(x.rotation, up)
            first = LINK_PARAMETERS * j
            out[t, first] = height
            out[t, first + 1], out[t, first + 2], out[t, first + 3] = up
    return out
