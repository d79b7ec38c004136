"""Torques and energies of unit link parameters: the regressor (maths.md, section 10)."""

from __future__ import annotations

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit, jit_inlined
from lip_id_ros.rigid_body.chain import (
    add_coupled_rows,
    base_acceleration,
    Chain,
    LINK_PARAMETERS,
    ROTOR,
)
from lip_id_ros.rigid_body.motions import (
    ACCELERATION,
    AXIS,
    frame_of,
    set_accelerations,
    set_frames,
    set_velocities,
    VECTORS,
    VELOCITY,
)
from lip_id_ros.rigid_body.spatial import (
    add,
    cross,
    dot,
    inwards,
    load_twist,
    Twist,
    twist_into,
)


@jit
def torque_regressor(chain: Chain, q: Array, dq: Array, ddq: Array) -> Array:
    """Torques of unit parameters, shape (N, n, 11 n), at contiguous joint states (N, n)."""
    count, n = q.shape
    out = np.zeros((count, n, LINK_PARAMETERS * n))
    work = np.empty((n + 1, VECTORS, 3))
    wrenches = np.zeros((6, ROTOR))
    for t in range(count):
        set_frames(work, chain, q[t])
        set_velocities(work, chain, dq[t])
        set_accelerations(work, chain, base_acceleration(chain), ddq[t])
        set_torque_regressor(out[t], wrenches, work, chain, ddq[t])
    return out


@jit_inlined
def set_torque_regressor(
    out: Array, wrenches: Array, work: Array, chain: Chain, ddq: Array
) -> None:
    """Set torques of unit parameters, (n, 11 n), where they are not 0, by motions with gravity."""
    n = len(ddq)
    for j in range(n):
        frame = frame_of(work, j + 1)
        v = twist_into(frame, load_twist(work, j + 1, VELOCITY))
        _set_unit_wrenches(wrenches, v, twist_into(frame, load_twist(work, j + 1, ACCELERATION)))
        for i in range(j + 1):
            (s0, s1, s2), (s3, s4, s5) = twist_into(frame, load_twist(work, i + 1, AXIS))
            for c in range(ROTOR):
                torque = s0 * wrenches[0, c] + s1 * wrenches[1, c] + s2 * wrenches[2, c]
                force = s3 * wrenches[3, c] + s4 * wrenches[4, c] + s5 * wrenches[5, c]
                out[i, LINK_PARAMETERS * j + c] = torque + force
    add_coupled_rows(out, chain)
    for j in range(n):  # a rotor turns with its drive
        out[j, LINK_PARAMETERS * j + ROTOR] = ddq[j]


@jit_inlined
def _set_unit_wrenches(out: Array, v: Twist, a: Twist) -> None:
    """
    Set the wrenches (6, 10) of unit parameters of a link by its motion, torque before force.

    With angular velocity w, its rate a, acceleration d of the origin, first moment h and inertia
    I: force m d + a x h + w x (w x h), torque I a + w x I w + h x d.
    """
    (w0, w1, w2), (a0, a1, a2) = v.angular, a.angular
    d0, d1, d2 = add(a.linear, cross(v.angular, v.linear))
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
def kinetic_regressor(chain: Chain, q: Array, dq: Array) -> Array:
    """Kinetic energies of unit parameters at (N, n) positions and velocities, (N, 11 n)."""
    count, n = q.shape
    out = np.empty((count, LINK_PARAMETERS * n))
    work = np.empty((n + 1, VECTORS, 3))
    for t in range(count):
        set_frames(work, chain, q[t])
        set_velocities(work, chain, dq[t])
        for j in range(n):
            w, v = twist_into(frame_of(work, j + 1), load_twist(work, j + 1, VELOCITY))
            row = out[t, LINK_PARAMETERS * j :]
            row[0] = 0.5 * dot(v, v)
            row[1], row[2], row[3] = cross(v, w)
            row[4], row[5], row[6] = 0.5 * w[0] * w[0], w[0] * w[1], w[0] * w[2]
            row[7], row[8], row[9] = 0.5 * w[1] * w[1], w[1] * w[2], 0.5 * w[2] * w[2]
            row[ROTOR] = 0.5 * dq[t, j] ** 2
    return out


@jit
def potential_regressor(chain: Chain, q: Array) -> Array:
    """Potential energies of unit parameters at (N, n) positions, shape (N, 11 n)."""
    count, n = q.shape
    out = np.zeros((count, LINK_PARAMETERS * n))
    work, up = np.empty((n + 1, VECTORS, 3)), base_acceleration(chain)
    for t in range(count):
        set_frames(work, chain, q[t])
        for j in range(n):
            frame, row = frame_of(work, j + 1), out[t, LINK_PARAMETERS * j :]
            row[0] = dot(up, frame.translation)
            row[1], row[2], row[3] = inwards(frame.rotation, up)
    return out
