"""How torques change with the placements of the joints (docs/maths.md, section 10)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lip_id_ros.kernels.lanes import compiled
from lip_id_ros.kernels.rigid_links.chain import (
    ANGULAR,
    ANGULAR_RATE,
    Chain,
    LINEAR_RATE,
    Links,
    move,
    new_links,
)
from lip_id_ros.kernels.rigid_links.vectors import cross, turn, turn_back
from lip_id_ros.kernels.rigid_links.wrench import shift, wrench, wrench_change

Array = NDArray[np.float64]

DIRECTIONS = 6
"""Of a placement: three rotations about its own axes, three shifts of its origin."""


class Changes(NamedTuple):
    """
    Working memory of one direction.

    Attributes
    ----------
    axis : array, shape (3,)
        The rotation, in the frame of the moved link.
    shift : array, shape (3,)
        The shift of its origin, in the frame of the link before.
    motion : array, shape (3, 3)
        Change of a link's motion.
    wrenches : array, shape (n, 2, 3)
        Changes of the wrenches.
    now, work : arrays, shapes (2, 3) and (3, 3)

    """

    axis: Array
    shift: Array
    motion: Array
    wrenches: Array
    now: Array
    work: Array


@compiled
def torque_sensitivity(chain: Chain, parameters: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """
    Differentiate the torques by the placements of the joints, at given parameters.

    Parameters
    ----------
    chain : Chain
    parameters : array, shape (n, 11)
    q, dq, ddq : arrays, shape (N, n)
        Joint states; contiguous.

    Returns
    -------
    array, shape (N, n, n, 6)
        Of torque i by joint j's rotations (its rotation matrix times a small rotation about the
        axes of its own frame) and translations.

    """
    count, n = q.shape
    out = np.zeros((count, n, n, DIRECTIONS))
    links = new_links(n)
    wrenches = np.zeros((n, 2, 3))
    changes = Changes(
        np.zeros(3), np.zeros(3), np.zeros((3, 3)), np.zeros((n, 2, 3)), np.zeros((2, 3)),
        np.zeros((3, 3)),
    )  # fmt: skip
    for t in range(count):
        move(links, chain, q[t], dq[t], ddq[t])
        _wrenches(wrenches, links, parameters)
        for i in range(n):
            for direction in range(DIRECTIONS):
                _displace(changes, chain, i, direction, q[t, i])
                _outward(changes, links, chain, parameters, i, dq[t])
                _inward(out[t, :, i, direction], changes, links, chain, wrenches, i)
    return out


@compiled
def _wrenches(out: Array, links: Links, parameters: Array) -> None:
    """Set what moves each link and all beyond it, in its frame."""
    n = len(parameters)
    for i in range(n):
        wrench(out[i], parameters[i], links.motions[i + 1], links.work)
    for i in range(n - 1, 0, -1):
        _add_shifted(out[i - 1], out[i], links, i)


@compiled
def _add_shifted(out: Array, wrench: Array, links: Links, i: int) -> None:
    shifted = np.empty((2, 3))
    shift(shifted, wrench, links.rotations[i], links.offsets[i], links.work)
    for k in range(3):
        out[0, k] += shifted[0, k]
        out[1, k] += shifted[1, k]


@compiled
def _displace(changes: Changes, chain: Chain, i: int, direction: int, q: float) -> None:
    """Set how the frame of link i moves in that of the link before it."""
    axis, offset = changes.axis, changes.shift
    axis[:], offset[:] = 0.0, 0.0
    if direction >= 3:
        offset[direction - 3] = 1.0
        return
    axis[direction] = 1.0
    if chain.prismatic[i]:  # it slides along an axis that turns
        for k in range(3):
            rotation = chain.rotations[i, k]
            offset[k] = q * (rotation[0] * axis[1] - rotation[1] * axis[0])
        return
    x, y, cos, sin = axis[0], axis[1], np.cos(q), np.sin(q)
    axis[0], axis[1] = cos * x + sin * y, cos * y - sin * x


@compiled
def _outward(
    changes: Changes, links: Links, chain: Chain, parameters: Array, i: int, dq: Array
) -> None:
    """Set the changes of the wrenches of the links from i to the tip."""
    motion, work = changes.motion, changes.work
    for row in range(3):
        cross(links.carried[i + 1, row], changes.axis, motion[row])
    cross(links.motions[i, ANGULAR], changes.shift, work[0])
    cross(links.motions[i, ANGULAR], work[0], work[1])
    cross(links.motions[i, ANGULAR_RATE], changes.shift, work[0])
    for k in range(3):
        work[0, k] += work[1, k]
    turn_back(links.rotations[i], work[0], work[1])
    for k in range(3):
        motion[LINEAR_RATE, k] += work[1, k]
    for j in range(i, len(dq)):
        if j > i:
            _carry_change(motion, links, j, work)
        _add_joint_change(motion, chain.prismatic[j], dq[j])
        wrench_change(changes.wrenches[j], parameters[j], links.motions[j + 1], motion, work)


@compiled
def _carry_change(motion: Array, links: Links, j: int, work: Array) -> None:
    """Take the change of motion of link j - 1 over to what link j has of it."""
    w, offset, rotation = links.motions[j, ANGULAR], links.offsets[j], links.rotations[j]
    cross(motion[ANGULAR], offset, work[0])
    cross(w, work[0], work[1])
    for k in range(3):
        motion[LINEAR_RATE, k] += work[1, k]
    cross(w, offset, work[0])
    cross(motion[ANGULAR], work[0], work[1])
    cross(motion[ANGULAR_RATE], offset, work[0])
    for k in range(3):
        motion[LINEAR_RATE, k] += work[0, k] + work[1, k]
    for row in range(3):
        turn_back(rotation, motion[row], work[0])
        motion[row] = work[0]


@compiled
def _add_joint_change(motion: Array, prismatic: bool, dq: float) -> None:
    w = motion[ANGULAR]
    row, factor = (LINEAR_RATE, 2.0) if prismatic else (ANGULAR_RATE, 1.0)
    motion[row, 0] += factor * w[1] * dq
    motion[row, 1] -= factor * w[0] * dq


@compiled
def _inward(
    out: Array, changes: Changes, links: Links, chain: Chain, wrenches: Array, i: int
) -> None:
    """Set the changes of all torques, shape (n,)."""
    changed, now, work = changes.wrenches, changes.now, changes.work
    for j in range(len(wrenches) - 1, i - 1, -1):
        out[j] = changed[j, 1 if chain.prismatic[j] else 0, 2]
        if j > i:
            _add_shifted(changed[j - 1], changed[j], links, j)
    for row in range(2):  # link i turns with what acts on it
        cross(changes.axis, wrenches[i, row], work[0])
        for k in range(3):
            changed[i, row, k] += work[0, k]
    shift(now, changed[i], links.rotations[i], links.offsets[i], work)
    turn(links.rotations[i], wrenches[i, 1], work[0])
    cross(changes.shift, work[0], work[1])
    for k in range(3):
        now[0, k] += work[1, k]
    for j in range(i - 1, -1, -1):
        out[j] = now[1 if chain.prismatic[j] else 0, 2]
        shift(changed[j], now, links.rotations[j], links.offsets[j], work)
        now[:] = changed[j]
