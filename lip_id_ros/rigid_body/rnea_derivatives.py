"""
Derivatives of the recursive Newton-Euler algorithm by the placements of the joints.

Every direction of a placement is a perturbation that propagates to the tip as a change of motions
and back to the base as a change of wrenches (maths.md, section 10).

"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lip_id_ros.arrays import Array
from lip_id_ros.numba_jit import jit
from lip_id_ros.rigid_body.chain import (
    add_joint_motion,
    base_acceleration,
    Chain,
    joint_row,
    joint_transform,
    link_inertia,
)
from lip_id_ros.rigid_body.spatial import (
    add,
    add_wrenches,
    cross,
    load,
    load_transform,
    newton_euler,
    newton_euler_derivative,
    propagate_motion,
    SpatialMotion,
    store,
    store_transform,
    to_child,
    to_parent,
    Transform,
    transform_wrench,
    Vec3,
    Wrench,
    ZERO,
)

DIRECTIONS = 6
"""Of a placement: three rotations about its own axes, three shifts of its origin."""


class Workspace(NamedTuple):
    """
    Working memory: all links of a chain at one joint state.

    The last index of a perturbation is its direction, so that the compiler turns loops over
    directions into vector instructions.

    `transforms`, shape (n, 4, 3).
    `parent_motions`, `motions`, shape (n + 1, 3, 3): motion without and with the link's own joint;
    row 0 is the base, row i + 1 link i.
    `wrenches`, shape (n, 2, 3): total wrench of a link and all links that it carries.
    `frame_change`, shape (6, 6): change of a link's frame: its rotation, expressed in the link,
    and the translation of its origin, expressed in the parent.
    `motion_change`, shape (9, 6): change of a link's motion.
    `wrench_changes`, shape (n, 6, 6): change of the wrench of each link alone.
    `total_change`, shape (6, 6): change of the total wrench of a link and all links that it
    carries.

    """

    transforms: Array
    parent_motions: Array
    motions: Array
    wrenches: Array
    frame_change: Array
    motion_change: Array
    wrench_changes: Array
    total_change: Array


@jit
def placement_derivatives(
    chain: Chain, parameters: Array, q: Array, dq: Array, ddq: Array
) -> Array:
    """
    Differentiate the torques by the placements of the joints, at contiguous joint states (N, n).

    The result has shape (N, n, n, 6), of torque i by joint j's rotations (its rotation matrix
    times a small rotation about the axes of its own frame) and translations.

    """
    count, n = q.shape
    out = np.zeros((count, n, n, DIRECTIONS))
    work = Workspace(
        np.empty((n, 4, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n + 1, 3, 3)),
        np.empty((n, 2, 3)),
        np.empty((6, DIRECTIONS)),
        np.empty((9, DIRECTIONS)),
        np.empty((n, 6, DIRECTIONS)),
        np.empty((6, DIRECTIONS)),
    )
    for t in range(count):
        _motions_and_wrenches(work, chain, parameters, q[t], dq[t], ddq[t])
        for i in range(n):
            _frame_change(work.frame_change, chain, i, q[t, i])
            _motion_change(work, i)
            _to_tip(work, chain, parameters, i, dq[t])
            _to_base(out[t, :, i], work, chain, i)
    return out


@jit
def _motions_and_wrenches(
    work: Workspace, chain: Chain, parameters: Array, q: Array, dq: Array, ddq: Array
) -> None:
    n = len(q)
    motion = SpatialMotion(ZERO, ZERO, base_acceleration(chain))
    _store_motion(work.motions, 0, motion)
    for i in range(n):
        x = joint_transform(chain, i, q[i])
        store_transform(work.transforms, i, x)
        motion = propagate_motion(motion, x)
        _store_motion(work.parent_motions, i + 1, motion)
        motion = add_joint_motion(motion, chain.prismatic[i], dq[i], ddq[i])
        _store_motion(work.motions, i + 1, motion)
    total = Wrench(ZERO, ZERO)
    for i in range(n - 1, -1, -1):
        total = add_wrenches(
            total, newton_euler(link_inertia(parameters, i), _motion(work.motions, i + 1))
        )
        store(work.wrenches, i, 0, total.torque)
        store(work.wrenches, i, 1, total.force)
        total = transform_wrench(total, load_transform(work.transforms, i))


@jit
def _frame_change(change: Array, chain: Chain, i: int, q: float) -> None:
    change[:] = 0.0
    for d in range(3):
        change[3 + d, 3 + d] = 1.0
        unit = 1.0 * (d == 0), 1.0 * (d == 1), 1.0 * (d == 2)
        if chain.prismatic[i]:  # it slides along an axis that turns
            _put(change, 0, d, unit)
            _put(
                change,
                3,
                d,
                to_parent(joint_transform(chain, i, 0.0).rotation, cross(unit, (0.0, 0.0, q))),
            )
        else:
            c, s = np.cos(q), np.sin(q)
            _put(change, 0, d, (c * unit[0] + s * unit[1], c * unit[1] - s * unit[0], unit[2]))


@jit
def _motion_change(work: Workspace, i: int) -> None:
    before, own = _motion(work.motions, i), _motion(work.parent_motions, i + 1)
    axes, w = load_transform(work.transforms, i).rotation, before.angular_velocity
    for d in range(DIRECTIONS):
        axis, shift = _get(work.frame_change, 0, d), _get(work.frame_change, 3, d)
        linear = add(cross(w, cross(w, shift)), cross(before.angular_acceleration, shift))
        _put(work.motion_change, 0, d, cross(own.angular_velocity, axis))
        _put(work.motion_change, 3, d, cross(own.angular_acceleration, axis))
        _put(
            work.motion_change,
            6,
            d,
            add(cross(own.linear_acceleration, axis), to_child(axes, linear)),
        )


@jit
def _to_tip(work: Workspace, chain: Chain, parameters: Array, i: int, dq: Array) -> None:
    """Set the changes of the wrenches of the links from i to the tip."""
    n, change = len(dq), work.motion_change
    for j in range(i, n):
        motion, own = _motion(work.motions, j + 1), link_inertia(parameters, j)
        wrenches, prismatic, speed = work.wrench_changes[j], chain.prismatic[j], dq[j]
        for d in range(DIRECTIONS):
            now = SpatialMotion(_get(change, 0, d), _get(change, 3, d), _get(change, 6, d))
            now = _add_joint_change(now, prismatic, speed)
            found = newton_euler_derivative(own, motion, now)
            _put(wrenches, 0, d, found.torque)
            _put(wrenches, 3, d, found.force)
            _put(change, 0, d, now.angular_velocity)
            _put(change, 3, d, now.angular_acceleration)
            _put(change, 6, d, now.linear_acceleration)
        if j + 1 < n:
            x = load_transform(work.transforms, j + 1)
            for d in range(DIRECTIONS):
                now = SpatialMotion(_get(change, 0, d), _get(change, 3, d), _get(change, 6, d))
                now = _propagate_change(now, motion.angular_velocity, x)
                _put(change, 0, d, now.angular_velocity)
                _put(change, 3, d, now.angular_acceleration)
                _put(change, 6, d, now.linear_acceleration)


@jit
def _propagate_change(change: SpatialMotion, w: Vec3, x: Transform) -> SpatialMotion:
    """Return the change of a frame fixed to a link with angular velocity w."""
    dw, da, dd = change
    r = x.translation
    centripetal = add(cross(w, cross(dw, r)), cross(dw, cross(w, r)))
    return SpatialMotion(
        to_child(x.rotation, dw),
        to_child(x.rotation, da),
        to_child(x.rotation, add(add(dd, cross(da, r)), centripetal)),
    )


@jit
def _add_joint_change(change: SpatialMotion, prismatic: bool, dq: float) -> SpatialMotion:
    dw, da, dd = change
    x, y = dw[1] * dq, -dw[0] * dq
    if prismatic:
        return SpatialMotion(dw, da, add(dd, (2.0 * x, 2.0 * y, 0.0)))
    return SpatialMotion(dw, add(da, (x, y, 0.0)), dd)


@jit
def _to_base(out: Array, work: Workspace, chain: Chain, i: int) -> None:
    """Set the changes of all torques, shape (n, 6)."""
    total = work.total_change
    total[:] = 0.0
    for j in range(len(out) - 1, i, -1):
        total += work.wrench_changes[j]
        out[j] = total[joint_row(chain.prismatic[j])]
        _transform(total, load_transform(work.transforms, j))
    total += work.wrench_changes[i]
    out[i] = total[joint_row(chain.prismatic[i])]
    _transform_at_the_joint(work, i)
    for j in range(i - 1, -1, -1):
        out[j] = total[joint_row(chain.prismatic[j])]
        _transform(total, load_transform(work.transforms, j))


@jit
def _transform(total: Array, x: Transform) -> None:
    for d in range(DIRECTIONS):
        found = transform_wrench(Wrench(_get(total, 0, d), _get(total, 3, d)), x)
        _put(total, 0, d, found.torque)
        _put(total, 3, d, found.force)


@jit
def _transform_at_the_joint(work: Workspace, i: int) -> None:
    # The frame of link i rotates together with the wrench on it, and its origin moves.
    x, total = load_transform(work.transforms, i), work.total_change
    whole = Wrench(load(work.wrenches, i, 0), load(work.wrenches, i, 1))
    force = to_parent(x.rotation, whole.force)
    for d in range(DIRECTIONS):
        axis, shift = _get(work.frame_change, 0, d), _get(work.frame_change, 3, d)
        turned = Wrench(cross(axis, whole.torque), cross(axis, whole.force))
        own = Wrench(_get(total, 0, d), _get(total, 3, d))
        found = add_wrenches(
            transform_wrench(add_wrenches(own, turned), x), Wrench(cross(shift, force), ZERO)
        )
        _put(total, 0, d, found.torque)
        _put(total, 3, d, found.force)


@jit
def _get(array: Array, row: int, d: int) -> Vec3:
    return array[row, d], array[row + 1, d], array[row + 2, d]


@jit
def _put(array: Array, row: int, d: int, a: Vec3) -> None:
    array[row, d], array[row + 1, d], array[row + 2, d] = a


@jit
def _motion(array: Array, i: int) -> SpatialMotion:
    return SpatialMotion(load(array, i, 0), load(array, i, 1), load(array, i, 2))


@jit
def _store_motion(array: Array, i: int, motion: SpatialMotion) -> None:
    store(array, i, 0, motion.angular_velocity)
    store(array, i, 1, motion.angular_acceleration)
    store(array, i, 2, motion.linear_acceleration)
