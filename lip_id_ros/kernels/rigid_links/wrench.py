"""The wrench that moves a rigid link: torque about its frame's origin, then force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.vectors import cross, turn

Array = NDArray[np.float64]

INERTIA = 4
"""Where the six numbers of the inertia begin among a link's parameters."""


@compiled
def wrench_columns(out: Array, motion: Array) -> None:
    """
    Set the wrench (6, 10) of unit parameters of a link with the motion (3, 3).

    With angular velocity w, its rate a, linear acceleration d, first moment h and inertia I: force
    m d + a x h + w x (w x h), torque I a + w x I w + h x d (Newton and Euler).

    """
    w0, w1, w2 = motion[0, 0], motion[0, 1], motion[0, 2]
    a0, a1, a2 = motion[1, 0], motion[1, 1], motion[1, 2]
    d0, d1, d2 = motion[2, 0], motion[2, 1], motion[2, 2]
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
def wrench(out: Array, parameters: Array, motion: Array, work: Array) -> None:
    """Set the wrench (2, 3) of a link with parameters (11,); `work` has shape (3, 3)."""
    mass, moment = parameters[0], parameters[1:INERTIA]
    w, a, d = motion[0], motion[1], motion[2]
    _times_inertia(parameters, w, work[0])
    cross(w, work[0], work[1])
    cross(moment, d, work[0])
    _times_inertia(parameters, a, out[0])
    for k in range(3):
        out[0, k] += work[0, k] + work[1, k]
    cross(w, moment, work[0])
    cross(w, work[0], work[1])
    cross(a, moment, work[0])
    for k in range(3):
        out[1, k] = mass * d[k] + work[0, k] + work[1, k]


@compiled
def wrench_change(
    out: Array, parameters: Array, motion: Array, change: Array, work: Array
) -> None:
    """Set the change (2, 3) of the wrench that goes with a change (3, 3) of the motion."""
    mass, moment = parameters[0], parameters[1:INERTIA]
    w, dw, da, dd = motion[0], change[0], change[1], change[2]
    _times_inertia(parameters, da, out[0])
    _times_inertia(parameters, w, work[0])
    cross(dw, work[0], work[1])
    _times_inertia(parameters, dw, work[0])
    cross(w, work[0], work[2])
    cross(moment, dd, work[0])
    for k in range(3):
        out[0, k] += work[0, k] + work[1, k] + work[2, k]
    cross(w, moment, work[0])
    cross(dw, work[0], work[1])
    cross(dw, moment, work[0])
    cross(w, work[0], work[2])
    cross(da, moment, work[0])
    for k in range(3):
        out[1, k] = mass * dd[k] + work[0, k] + work[1, k] + work[2, k]


@compiled
def shift(out: Array, wrench: Array, rotation: Array, offset: Array, work: Array) -> None:
    """Set a wrench (2, 3) in the frame of the link before; `out` is not `wrench`."""
    turn(rotation, wrench[1], out[1])
    turn(rotation, wrench[0], out[0])
    cross(offset, out[1], work[0])
    for k in range(3):
        out[0, k] += work[0, k]


@compiled
def _times_inertia(parameters: Array, a: Array, out: Array) -> None:
    xx, xy, xz = parameters[INERTIA], parameters[INERTIA + 1], parameters[INERTIA + 2]
    yy, yz, zz = parameters[INERTIA + 3], parameters[INERTIA + 4], parameters[INERTIA + 5]
    out[0] = xx * a[0] + xy * a[1] + xz * a[2]
    out[1] = xy * a[0] + yy * a[1] + yz * a[2]
    out[2] = xz * a[0] + yz * a[1] + zz * a[2]
